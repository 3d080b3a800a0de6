"""Is it the board that the camera was calibrated with?  The shape that was learnt goes with that board and
with no other.

The camera is fixed and the pose of each new view is fitted twice, once to corners of the learnt shape and
once to corners as they are said to be. Let a times the learnt shape be what the new views show: their squared
residuals are a parabola in a, lower at 1 than at 0 exactly where its minimum lies above one half. So the
shape that leaves less is the nearer one, and how sure that is says the difference from view to view.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.fitting.board_order import listed_as_known
from orthoscope.fitting.calibration import residuals_of
from orthoscope.fitting.resection import resect
from orthoscope.geometry.arrays import ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections

__all__ = ["SameBoard", "same_board"]

# A gain of more than so many standard errors over views is hardly chance.
SURE_ERRORS = 2.0


class SameBoard(NamedTuple):
    """Whether other photographs show the board that a camera was calibrated with.

    Attributes:
        same: whether its learnt shape fits them better than no shape.
        sure: whether views agree on that beyond chance.
        learnt_px, said_px: rms per point with the learnt shape, and with corners where they are said to be.
    """

    same: bool
    sure: bool
    learnt_px: float
    said_px: float


def same_board(camera: Camera, shape: TargetShape, detections: Detections) -> SameBoard:
    """Whether the target of these views is of a shape that was learnt.

    Args:
        camera: stays as it is.
        shape: of the target that it was calibrated with.
        detections: of a target with the same nominal corners.
    Raises:
        CalibrationError: no view can be used.
    """
    learnt, said = _squares(camera, detections, shape), _squares(camera, detections, None)
    gained = said - learnt
    corners = sum(len(view.ids) for view in detections.views)
    error = float(np.sqrt(len(gained)) * gained.std(ddof=1)) if len(gained) > 1 else np.inf
    return SameBoard(
        same=bool(gained.sum() > 0.0),
        sure=bool(abs(gained.sum()) > SURE_ERRORS * error),
        learnt_px=float(np.sqrt(learnt.sum() / corners)),
        said_px=float(np.sqrt(said.sum() / corners)),
    )


def _squares(camera: Camera, detections: Detections, shape: TargetShape | None) -> ndarray:
    """Of each view, its pose fitted, px^2."""
    detections = listed_as_known(camera, detections, shape)
    poses = resect(camera, detections, shape=shape)
    return np.array([float((e**2).sum()) for e in residuals_of(camera, poses, detections, shape=shape)])
