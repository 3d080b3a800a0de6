"""Boards that are what they are said to be, and boards that are not, seen by cameras whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy import ndarray

from orthoscope.fitting.calibration import Calibration, Uncertainty
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import Target, chessboard

__all__ = [
    "BOARD",
    "NARROW",
    "WIDE",
    "bent",
    "known",
    "perfect",
    "photographs_of",
    "seen_by_the_truth",
    "stretched",
    "thinned",
]

BOARD = chessboard(9, 6, 0.025)
NARROW = Camera(
    (640, 480), Intrinsics(520.0, 524.0, 325.0, 236.0), Brown(k1=-0.28, k2=0.09, p1=1e-3, p2=-6e-4, k3=-0.02)
)
WIDE = Camera(
    (640, 480), Intrinsics(205.0, 206.0, 318.0, 242.0), KannalaBrandt(k1=-0.02, k2=0.003, k3=-0.002, k4=2e-4)
)
NOISE = 0.2  # px per coordinate


def perfect(
    camera: Camera, views: int, seed: int, *, board: Target = BOARD, noise_px: float = NOISE, **how
) -> tuple[Scene, Detections]:
    """A board that is what it is said to be, as a person would photograph it; how: as in random_views."""
    rng = np.random.default_rng(seed)
    scene = Scene(camera, board, random_views(camera, board, views, rng=rng, **how))
    return scene, simulate_detections(scene, noise_px=noise_px, rng=rng)


def known(scene: Scene, detections: Detections) -> Calibration:
    """The truth as a calibration: nothing was fitted."""
    none = Uncertainty((), np.zeros((0, 0)))
    return Calibration(scene.camera, scene.camera_from_target, detections, "fccm", {}, none, "known", 0, "0")


def seen_by_the_truth(camera: Camera, views: int, seed: int, **how) -> Calibration:
    """A perfect board, and the truth as its calibration."""
    return known(*perfect(camera, views, seed, **how))


def photographs_of(
    points: ndarray, views: int, seed: int, *, camera: Camera = NARROW, noise_px: float = NOISE
) -> Detections:
    """A board whose corners are at `points` (54,3) metres instead of where BOARD has them."""
    scene, said = perfect(camera, views, seed, noise_px=noise_px)
    moved = zip(scene.camera_from_target, said.views, strict=True)
    shifts = (
        camera.project(pose.apply(points)) - camera.project(pose.apply(BOARD.points)) for pose, _ in moved
    )
    views_ = (
        View(view.image, view.ids, view.pixels + shift[view.ids])
        for view, shift in zip(said.views, shifts, strict=True)
    )
    return replace(said, views=tuple(views_))


def bent(millimetres: float) -> ndarray:
    """BOARD curled about its shorter axis, its ends so many millimetres behind its middle."""
    x = BOARD.points[:, 0] - BOARD.points[:, 0].mean()
    return BOARD.points + np.outer(1e-3 * millimetres * (x / np.abs(x).max()) ** 2, [0.0, 0.0, 1.0])


def stretched(share: float) -> ndarray:
    """BOARD longer by this share along its rows."""
    return BOARD.points * [1.0 + share, 1.0, 1.0]


def thinned(detections: Detections, share: tuple[float, float], seed: int) -> Detections:
    """A random share of each view's corners."""
    rng = np.random.default_rng(seed)

    def some(view: View) -> View:
        keep = rng.permutation(len(view.ids))[: int(rng.uniform(*share) * len(view.ids))]
        return View(view.image, view.ids[keep], view.pixels[keep])

    return replace(detections, views=tuple(some(view) for view in detections.views))
