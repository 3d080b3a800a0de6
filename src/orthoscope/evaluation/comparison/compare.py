"""Methods and lenses side by side, on photographs that each of them has not seen.

All meet the same corners in the same folds of views: an entry is called again, with the settings that the
user gave, without a fold; on the fold's views lens and target shape are fixed and the pose is fitted. What it
chooses by itself it chooses anew in each fold, so the choice is judged too. Since the views are the same for
all, what tells two entries apart is the difference from view to view: its standard error is mostly far below
that of each error alone. Corners that do not belong (outliers.py) are left out once, for all: nobody can
foresee a misread corner, and one would outweigh all that is compared. A camera from elsewhere stays as it is
and has seen none of the views: it meets all of them with poses fitted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from orthoscope.evaluation.comparison.entry import USUAL, Entry, parse_entry
from orthoscope.evaluation.comparison.same_photographs import made_from
from orthoscope.evaluation.metrics import held_out_nce, lateral_errors, normalised_calibration_error
from orthoscope.evaluation.same_board import same_board
from orthoscope.fitting.board_order import listed_as_known
from orthoscope.fitting.calibration import residuals_of
from orthoscope.fitting.disc_centres import has_outlines
from orthoscope.fitting.resection import resect
from orthoscope.fitting.unseen.held_out import (
    FEWEST_VIEWS,
    USUAL_FOLDS,
    folds_of_views,
    held_out,
    rms_and_error,
)
from orthoscope.geometry.arrays import CalibrationError, Float, InputError, ndarray
from orthoscope.geometry.numbers import with_error
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods import METHODS, calibrate
from orthoscope.methods.outliers.outliers import without_outliers
from orthoscope.models.camera import Camera
from orthoscope.models.image_size import of_another_size
from orthoscope.models.lenses.table import lens_name
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections

__all__ = ["Comparison", "Standing", "compare", "paired_difference"]

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, eq=False)
class Standing:
    """How an entry did; NaN where it could not be judged, and `failure` says why.

    Attributes:
        entry: the method with its settings.
        squares: (m,) of each view the sum of squared held-out residuals, px^2.
        camera, target_shape: calibrated from all views; None where they tell no camera.
        lens: the lens that it came to, as the method's setting names it.
        held_out_px, error_px: rms per point and its standard error.
        loses_px, loses_error_px: against the best, paired by view.
        nce: of held-out views.
        rms_px: on the photographs that were used.
        parameters: how many of camera and target shape the data determined; NaN where it is not told.
        seconds: that the calibration from all views took.
        failure: why it could not be judged.
    """

    entry: Entry
    squares: Float[ndarray, " m"]
    camera: Camera | None = None
    target_shape: TargetShape | None = None
    lens: str = ""
    held_out_px: float = float("nan")
    error_px: float = float("nan")
    loses_px: float = float("nan")
    loses_error_px: float = float("nan")
    nce: float = float("nan")
    rms_px: float = float("nan")
    parameters: float = float("nan")
    seconds: float = float("nan")
    failure: str = ""

    @property
    def shape(self) -> str:
        """The kind of target shape that it came to; empty without a camera."""
        return self.target_shape.kind if self.target_shape else ""


@dataclass(frozen=True, eq=False)
class Comparison:
    """All entries, the best first and those that could not be judged last; the detections and the number of
    folds they were judged by.
    """

    detections: Detections
    folds: int
    standings: tuple[Standing, ...]

    def __repr__(self) -> str:
        told = (
            f"\n  {each.entry.name}: {each.failure or with_error(each.held_out_px, each.error_px) + ' px'}"
            for each in self.standings
        )
        return f"Comparison({len(self.standings)} entries, held out on {self.detections!r}){''.join(told)}"

    @property
    def judged(self) -> tuple[Standing, ...]:
        """Those that every view could judge, the best first; empty where there are none."""
        return tuple(standing for standing in self.standings if np.isfinite(standing.held_out_px))


@with_one_thread
def compare(
    detections: Detections,
    entries: Sequence[Entry | str] = USUAL,
    *,
    folds: int = USUAL_FOLDS,
    executor: Executor | None = None,
    progress: Progress | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> Comparison:
    """Judge methods and lenses by the same photographs, which none of them has seen.

    An entry that cannot has a standing that says why.

    Args:
        detections: of the photographs.
        entries: as in `parse_entry`, or its results.
        folds: in how many parts the views are held out.
        executor: where the folds run; the calibrations that are timed run here.
        progress: called with (calibrations done, calibrations, entry).
        clock: seconds.
    Raises:
        InputError: an entry or a setting that is none.
        CalibrationError: too few views to hold any out, or the corners fit no camera.
    """
    chosen = _distinct(entries)
    used = without_outliers(calibrate(detections).detections if has_outlines(detections) else detections)
    if len(used.views) < FEWEST_VIEWS:
        raise CalibrationError(
            f"{len(used.views)} of the views can be used; expected {FEWEST_VIEWS} at least, so that some can"
            " be held out. Take more photographs."
        )
    parts = len(folds_of_views(len(used.views), folds))
    told = partial(_tell, progress, len(chosen) * (1 + parts))
    standings = []
    for done, entry in enumerate(chosen, 1):
        standings.append(_calibrated(entry, used, clock))
        told(done, entry.name)
    for i, standing in enumerate(standings):
        before = len(chosen) + i * parts
        standings[i] = _judged(
            standing, used, folds, executor, partial(_tell_fold, told, before, standing.entry.name)
        )
        told(before + parts, standing.entry.name)
    return Comparison(used, parts, _ranked(standings, _corners(used)))


def paired_difference(
    squares: Float[ndarray, " m"], others: Float[ndarray, " m"], corners: Float[ndarray, " m"]
) -> tuple[float, float]:
    """How much larger the rms per point of one is than that of the other, pixels, and its standard error.

    Views are taken as independent draws, to first order, as in `rms_and_error`.

    Args:
        squares: sum of squared residuals of each view, px^2.
        others: those of the other.
        corners: of each view.
    """
    (rms, share), (other_rms, other_share) = (
        _rms_and_shares(squares, corners),
        _rms_and_shares(others, corners),
    )
    views = len(corners)
    error = float("nan") if views < 2 else np.sqrt(views / (views - 1) * ((share - other_share) ** 2).sum())
    return float(rms - other_rms), float(error)


def _rms_and_shares(
    squares: Float[ndarray, " m"], corners: Float[ndarray, " m"]
) -> tuple[float, Float[ndarray, " m"]]:
    """The rms per point, pixels, and by how much each view moves it."""
    mean = squares.sum() / corners.sum()
    rms = float(np.sqrt(mean))
    return rms, (
        (squares - corners * mean) / (2.0 * rms * corners.sum()) if rms > 0 else np.zeros_like(squares)
    )


def _distinct(entries: Sequence[Entry | str]) -> list[Entry]:
    """The entries in their order, each once.

    Raises:
        InputError: there are none.
    """
    parsed = (parse_entry(entry) if isinstance(entry, str) else entry for entry in entries)
    if chosen := list({entry.name: entry for entry in parsed}.values()):
        return chosen
    raise InputError("nobody was named to be compared; expected one at least, such as fccm:brown.")


def _calibrated(entry: Entry, used: Detections, clock: Callable[[], float]) -> Standing:
    """The entry's calibration from all views; a camera that is given, as it is."""
    squares, begun = np.full(len(used.views), np.nan), clock()
    if entry.camera is not None:
        return _given(entry, entry.camera, used, squares)
    try:
        found = METHODS[entry.method](used, **entry.settings)
    except CalibrationError as error:
        return Standing(entry, squares, failure=str(error))
    seconds = clock() - begun
    known = found.parameters if found.uncertainty.names else float("nan")
    lens = str(found.settings.get("lens", ""))
    came_to = Standing(entry, squares, found.camera, found.target_shape, lens)
    return replace(came_to, rms_px=found.rms_px, parameters=known, seconds=seconds)


def _given(entry: Entry, camera: Camera, used: Detections, squares: Float[ndarray, " m"]) -> Standing:
    """The standing of a camera from elsewhere, before it is judged."""
    if told := of_another_size(camera, used.image_size):
        return Standing(entry, squares, failure=told)
    shape = TargetShape("flat", np.zeros_like(used.target.points))
    if made := entry.calibration:
        if known := made_from(made, used):
            which = f"{known} of these {len(used.views)} photographs"
            return Standing(entry, squares, failure=f"it was made from {which}; judge it by others")
        learnt = made.target_shape
        try:
            if (
                len(learnt.displacements) == len(shape.displacements)
                and same_board(camera, learnt, used).same
            ):
                shape = learnt
        except CalibrationError as error:
            return Standing(entry, squares, failure=str(error))
    return Standing(entry, squares, camera, shape, lens_name(camera.lens))


def _with_poses_alone(standing: Standing, camera: Camera, used: Detections) -> Standing:
    """The same judged: camera and shape fixed, the pose of each view fitted."""
    shape = standing.target_shape
    used = listed_as_known(camera, used, shape)
    try:
        poses = resect(camera, used, shape=shape)
    except CalibrationError as error:
        return replace(standing, failure=str(error))
    residuals = residuals_of(camera, poses, used, shape=shape)
    squares = np.array([float((e * e).sum()) for e in residuals])
    held_out_px, error_px = rms_and_error(squares, _corners(used))
    estimated, observed = lateral_errors(camera, poses, used, shape=shape)
    nce = normalised_calibration_error(estimated, observed, camera.intrinsics)
    return replace(standing, squares=squares, held_out_px=held_out_px, error_px=error_px, nce=nce)


def _judged(
    standing: Standing,
    used: Detections,
    folds: int,
    executor: Executor | None,
    progress: Callable[[int, int], None],
) -> Standing:
    """The same with its held-out errors; an entry that has none in some view is not compared, since the
    others meet them all.
    """
    if standing.camera is None:
        return standing
    if standing.entry.camera is not None:
        return _with_poses_alone(standing, standing.camera, used)
    refit = partial(METHODS[standing.entry.method], **standing.entry.settings)
    unseen = held_out(used, refit, folds=folds, executor=executor, progress=progress)
    squares = np.array([(e * e).sum() for e in unseen.residuals])
    if missing := int(np.isnan(squares).sum()):
        failure = (
            f"{missing} of {len(squares)} photographs could not be judged: calibrated without them, no camera"
            " sees them"
        )
        return replace(standing, squares=squares, failure=failure)
    return replace(
        standing,
        squares=squares,
        held_out_px=unseen.rms_px,
        error_px=unseen.standard_error_px,
        nce=held_out_nce(unseen, used),
    )


def _ranked(standings: Sequence[Standing], corners: Float[ndarray, " m"]) -> tuple[Standing, ...]:
    """The best first, with what each loses against it; those without an error last, in their order."""
    ranked = sorted(standings, key=lambda standing: (np.isnan(standing.held_out_px), standing.held_out_px))
    best, compared = ranked[0].squares, []
    for standing in ranked:
        judged = np.isfinite(standing.held_out_px)
        loses, error = (
            paired_difference(standing.squares, best, corners) if judged else (float("nan"), float("nan"))
        )
        compared.append(replace(standing, loses_px=loses, loses_error_px=error))
    return tuple(compared)


def _corners(used: Detections) -> Float[ndarray, " m"]:
    """Of each view, how many."""
    return np.array([len(view.ids) for view in used.views], dtype=float)


def _tell(progress: Progress | None, to_do: int, done: int, name: str) -> None:
    if progress:
        progress(done, to_do, name)


def _tell_fold(told: Callable[[int, str], None], before: int, name: str, done: int, _folds: int) -> None:
    told(before + done, name)
