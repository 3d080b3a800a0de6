"""The error on photographs that a camera was not made from: each left out in its turn, or in whole parts.

By default each photograph is left out in its turn by one linear step from the fit that used them all
(fitting/unseen/leave_one_out.py), which costs no fit; it agrees with refits within a few per cent
(docs/measured/choice.md). Methods that fit pin-hole and lens one after the other have no such step: their
photographs are dealt into folds, and the method is called again without each (fitting/unseen/held_out.py).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.metrics import held_out_nce, nce_of
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.unseen.held_out import FEWEST_VIEWS, held_out, rms_and_error
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods import METHODS

__all__ = ["UnseenViews", "in_folds", "in_turn"]


class UnseenViews(NamedTuple):
    """What was found.

    Attributes:
        residuals: (n,2) of each view, predicted minus detected, pixels; NaN where nothing foresees them.
        rms_px, error_px: of all, per point, and its standard error over views; NaN where there are none.
        nce: of all, NaN where there are none.
        folds: in how many parts the views were held out; 0 for each in its turn.
    """

    residuals: tuple[Float[ndarray, "_ 2"], ...]
    rms_px: float
    error_px: float
    nce: float
    folds: int


def in_turn(calibration: Calibration, left_out: Float[ndarray, "m n"]) -> UnseenViews:
    """Each view left out in its turn.

    Args:
        left_out: residuals of each view by the calibration's fit without it, as in `LeaveOneOut`.
    """
    views = calibration.detections.views
    by_corner = left_out.reshape(len(views), 2, -1).transpose(0, 2, 1)
    foreseen = len(views) >= FEWEST_VIEWS
    residuals = tuple(
        np.ascontiguousarray(of_view[view.ids]) if foreseen else np.full((len(view.ids), 2), np.nan)
        for of_view, view in zip(by_corner, views, strict=True)
    )
    squares = np.array([float((e * e).sum()) for e in residuals])
    rms, error = rms_and_error(squares, np.array([len(e) for e in residuals], dtype=float))
    return UnseenViews(residuals, rms, error, _nce(calibration, residuals), 0)


def in_folds(
    calibration: Calibration,
    folds: int,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> UnseenViews:
    """Views dealt into folds, the calibration's own method called again without each.

    Args:
        folds: how many.
        executor, progress: as in `held_out`.
    """
    detections = calibration.detections
    refit = partial(METHODS[calibration.method], **calibration.settings)
    unseen = held_out(detections, refit, folds=folds, executor=executor, progress=progress)
    nce = held_out_nce(unseen, detections)
    return UnseenViews(unseen.residuals, unseen.rms_px, unseen.standard_error_px, nce, folds)


def _nce(calibration: Calibration, residuals: tuple[ndarray, ...]) -> float:
    """NCE of left-out residuals: by the calibration's camera, pixels moved so that it misses by as much."""
    known = [i for i, e in enumerate(residuals) if np.isfinite(e).all()]
    if not known:
        return float("nan")
    detections, own = calibration.detections, calibration.residuals()
    moved = tuple(
        replace(detections.views[i], pixels=detections.views[i].pixels + own[i] - residuals[i]) for i in known
    )
    return nce_of(
        calibration.camera,
        [calibration.camera_from_target[i] for i in known],
        replace(detections, views=moved),
        shape=calibration.target_shape,
    )
