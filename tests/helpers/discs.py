"""Detections of discs as a detector of outlines makes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orthoscope.fitting.disc_centres import disc_offsets
from orthoscope.simulation.scene import Scene, simulate_detections
from orthoscope.targets.detections import Detections, View

__all__ = ["outlines_of"]


def outlines_of(scene: Scene, *, noise_px: float = 0.0) -> Detections:
    """What a detector of outlines sees."""
    exact = simulate_detections(scene, noise_px=noise_px, rng=np.random.default_rng(0))
    poses = dict(zip(scene.images, scene.camera_from_target, strict=True))
    radius = scene.target.disc_radii
    views = tuple(
        View(
            view.image,
            view.ids,
            view.pixels
            + disc_offsets(scene.camera, poses[view.image], scene.target.points[view.ids], radius[view.ids]),
        )
        for view in exact.views
    )
    return replace(exact, views=views, disc_centres=False)
