"""The judge: error on photographs that a calibration has not seen.

Views are dealt into folds; the method is called again without a fold; on the fold's views the lens and the
target's shape are fixed and only the pose is fitted. Folds come from numpy's default_rng(seed), so the same
data give the same folds.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from orthoscope.fitting.board_order import listed_as_known
from orthoscope.fitting.calibration import Calibration, residuals_of
from orthoscope.fitting.resection import resect
from orthoscope.geometry.arrays import CalibrationError, Float, InputError, Int, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.machine.blas import with_one_thread
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections

__all__ = ["FEWEST_VIEWS", "USUAL_FOLDS", "HeldOut", "folds_of_views", "held_out", "rms_and_error"]

# With fewer views a fold would leave a calibration that rests on assumptions.
FEWEST_VIEWS = 4
# Views are held out in so many parts where nobody says in how many.
USUAL_FOLDS = 5

Refit = Callable[[Detections], Calibration]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """For each view of the detections, in order: the camera and the target's shape from other views, its pose
    there, its residuals (n,2).

    None and NaN where there is no such camera.
    """

    cameras: tuple[Camera | None, ...]
    shapes: tuple[TargetShape | None, ...]
    camera_from_target: tuple[Pose | None, ...]
    residuals: tuple[Float[ndarray, "_ 2"], ...]

    @property
    def rms_px(self) -> float:
        """Root mean square of |residual| over all held-out corners, pixels per point; NaN where there are
        none.
        """
        return self._rms_and_error[0]

    @property
    def standard_error_px(self) -> float:
        """Standard error of `rms_px`, taking views as independent draws."""
        return self._rms_and_error[1]

    @property
    def _rms_and_error(self) -> tuple[float, float]:
        found = [e[np.isfinite(e).all(1)] for e in self.residuals]
        squares = np.array([(e * e).sum() if len(e) else np.nan for e in found])
        return rms_and_error(squares, np.array([len(e) for e in found], dtype=float))


def rms_and_error(squares: Float[ndarray, " m"], corners: Float[ndarray, " m"]) -> tuple[float, float]:
    """Root mean square per point over views, and its standard error, views taken as independent draws.

    Args:
        squares: of each view the sum of |residual|^2, NaN where there is none; such views take no part.
        corners: of each view.
    """
    known = np.isfinite(squares)
    squares, corners = squares[known], corners[known]
    views = len(squares)
    if not views:
        return float("nan"), float("nan")
    mean = squares.sum() / corners.sum()
    if views < 2 or not mean > 0:
        return float(np.sqrt(mean)), float("nan") if views < 2 else 0.0
    of_mean = np.sqrt(views / (views - 1) * ((squares - corners * mean) ** 2).sum()) / corners.sum()
    return float(np.sqrt(mean)), float(of_mean / (2.0 * np.sqrt(mean)))


def folds_of_views(views: int, folds: int, *, seed: int = 0) -> list[ndarray]:
    """Indices of the views of each fold: a permutation of default_rng(seed), cut into nearly equal parts.

    Raises:
        InputError: fewer than two folds.
    """
    if folds < 2:
        raise InputError(
            f"folds is {folds}; expected at least 2, so that there are views to learn from. 5 is usual."
        )
    return [
        np.sort(part)
        for part in np.array_split(np.random.default_rng(seed).permutation(views), min(folds, views))
    ]


@with_one_thread
def held_out(
    detections: Detections,
    refit: Refit,
    *,
    folds: int = USUAL_FOLDS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> HeldOut:
    """Held-out residuals of `refit` (a method with its settings) on these detections.

    A fold whose training views cannot tell the camera leaves its views without residuals (NaN); so do fewer
    than four views.

    Args:
        executor: where the folds run; by default here, one after the other.
        progress: called with (folds done, folds).
    Raises:
        InputError: fewer than two folds.
    """
    views = len(detections.views)
    cameras: list[Camera | None] = [None] * views
    shapes: list[TargetShape | None] = [None] * views
    poses: list[Pose | None] = [None] * views
    residuals = [np.full((len(view.ids), 2), np.nan) for view in detections.views]
    parts = folds_of_views(views, folds, seed=seed) if views >= FEWEST_VIEWS else []
    run = executor.map if executor else map
    fits = run(_fold, [detections] * len(parts), [refit] * len(parts), parts)
    for done, (part, fit) in enumerate(zip(parts, fits, strict=True), 1):
        if fit is not None:
            known, fitted, errors = fit
            for i, pose, e in zip(part, fitted, errors, strict=True):
                cameras[i], shapes[i], poses[i], residuals[i] = known.camera, known.target_shape, pose, e
        if progress:
            progress(done, len(parts))
    return HeldOut(tuple(cameras), tuple(shapes), tuple(poses), tuple(residuals))


@with_one_thread
def _fold(
    detections: Detections, refit: Refit, part: Int[ndarray, " f"]
) -> tuple[Calibration, tuple[Pose, ...], tuple[ndarray, ...]] | None:
    """Calibration from the other views, poses and residuals of these; None where the others cannot tell."""
    others = np.setdiff1d(np.arange(len(detections.views)), part)
    tested = detections.only(part)
    try:
        known = refit(detections.only(others))
        tested = listed_as_known(known.camera, tested, known.target_shape)
        poses = resect(known.camera, tested, shape=known.target_shape)
    except CalibrationError:
        return None
    return known, poses, residuals_of(known.camera, poses, tested, shape=known.target_shape)
