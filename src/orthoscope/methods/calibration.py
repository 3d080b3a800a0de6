"""The result of every method: the camera, where the target was, what it was made from and how it ended.

Floor 3.  A calibration keeps its inputs, so that it can be recomputed, refitted with another lens and evaluated on its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.geometry.target import Detections
from orthoscope.models.camera import Camera

__all__ = ["Calibration", "Uncertainty", "residuals_of", "rms"]


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """What the data leave open about the camera.

    names: the parameters that were estimated, `fx`, `cx`, `k1`...; a parameter tied to another bears both names, `fx=fy`.
    covariance: (k,k), in the parameters' own units, for residuals as large as those found.
    """

    names: tuple[str, ...]
    covariance: ndarray

    def __post_init__(self) -> None:
        k = len(self.names)
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "covariance", frozen(np.reshape(self.covariance, (k, k)), (k, k), "covariance"))

    @property
    def deviations(self) -> dict[str, float]:
        """The standard deviation of each estimated parameter."""
        roots = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return {single: float(root) for name, root in zip(self.names, roots, strict=True) for single in name.split("=")}


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera with the evidence for it.

    camera_from_target: one pose for each of `detections.views`, in their order.  method, settings: what was called, so that it can be
    called again.  status: how the solver ended, a sentence.  steps: how many it took.  assumptions: what was taken for granted
    because the data could not tell, each a sentence.
    Raises InputError where poses and views do not match in number.
    """

    camera: Camera
    camera_from_target: tuple[Pose, ...]
    detections: Detections
    method: str
    settings: Mapping[str, Any]
    uncertainty: Uncertainty
    status: str
    steps: int
    version: str
    assumptions: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "camera_from_target", tuple(self.camera_from_target))
        if len(self.camera_from_target) != len(self.detections.views):
            raise InputError(f"{len(self.camera_from_target)} poses for {len(self.detections.views)} views; expected one for each.")

    def residuals(self) -> tuple[Float[ndarray, "_ 2"], ...]:
        """Predicted minus detected, pixels, an array (n,2) for each view; the formula's own value where its domain has ended."""
        return residuals_of(self.camera, self.camera_from_target, self.detections)

    @property
    def rms_px(self) -> float:
        """Root mean square of |residual| over all corners, pixels (per point, as OpenCV's)."""
        return rms(np.concatenate(self.residuals()))


def residuals_of(camera: Camera, camera_from_target: Sequence[Pose], detections: Detections) -> tuple[Float[ndarray, "_ 2"], ...]:
    """Predicted minus detected, pixels, an array (n,2) for each view, for a camera and one pose for each view."""
    points = detections.target.points
    return tuple(
        camera.project(pose.apply(points[view.ids]), beyond=True) - view.pixels
        for pose, view in zip(camera_from_target, detections.views, strict=True)
    )


def rms(residuals: Float[ndarray, "n 2"]) -> float:
    """Root mean square of |e| over points."""
    return float(np.sqrt((residuals * residuals).sum(-1).mean()))
