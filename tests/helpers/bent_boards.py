"""Boards that are not what they are said to be, photographed by a known camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from helpers.scenes import BOARD
from orthoscope.models.camera import Camera
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections
from orthoscope.targets.target import Target

__all__ = ["bowed", "drawn", "photographed_with", "stretched"]


def stretched(share: float, target: Target = BOARD) -> np.ndarray:
    """Displacements (m,3), metres, of a print that is longer along x by this share: paper does that."""
    x = target.points[:, 0] - target.points[:, 0].mean()
    return np.outer(share * x, [1.0, 0.0, 0.0])


def bowed(height: float, target: Target = BOARD) -> np.ndarray:
    """Displacements (m,3), metres, of a board that curls along x, its ends this much behind its middle."""
    x = target.points[:, 0] - target.points[:, 0].mean()
    return np.outer(height * (x / np.abs(x).max()) ** 2, [0.0, 0.0, 1.0])


def drawn(sigma: tuple[float, float, float], target: Target = BOARD, *, seed: int = 0) -> np.ndarray:
    """Displacements (m,3), metres, of corners each by itself, with these deviations along the axes."""
    return np.random.default_rng(seed).standard_normal((len(target.points), 3)) * sigma


def photographed_with(
    displacements: np.ndarray,
    camera: Camera,
    views: int = 12,
    *,
    target: Target = BOARD,
    noise_px: float = 0.0,
    seed: int = 0,
    **how,
) -> Detections:
    """So many views of a target whose corners are displaced, as a person would take them; how: as in
    random_views.
    """
    poses = random_views(camera, target, views, rng=np.random.default_rng(seed), **how)
    said = simulate_detections(
        Scene(camera, target, poses), noise_px=noise_px, rng=np.random.default_rng(seed + 1000)
    )
    shifts = (
        camera.project(pose.apply(target.points + displacements)) - camera.project(pose.apply(target.points))
        for pose in poses
    )
    seen = (
        replace(view, pixels=view.pixels + shift[view.ids])
        for view, shift in zip(said.views, shifts, strict=True)
    )
    return replace(said, views=tuple(seen))
