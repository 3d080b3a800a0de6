"""The result of every method: the camera, where the target was, what it was made from and how it ended.

A calibration keeps its inputs, so that it can be recomputed, refitted with another lens and evaluated on its
own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.parameters import Parameters
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections
from orthoscope.targets.target import Target

__all__ = [
    "Calibration",
    "Candidate",
    "Uncertainty",
    "Variances",
    "corners_beyond",
    "points_of",
    "residuals_of",
    "rms",
]


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """What the data leave open about the camera.

    Attributes:
        names: the parameters that were estimated, `fx`, `cx`, `k1`...; a parameter tied to another bears both
            names, `fx=fy`.
        covariance: (k,k), in the parameters' own units.
        model: (k,k), the part of it that independent errors of corners make, for residuals as large as those
            found; the covariance itself where nothing is said.
    """

    names: tuple[str, ...]
    covariance: ndarray
    model: ndarray = None  # type: ignore[assignment]  # made below

    def __post_init__(self) -> None:
        k = len(self.names)
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(
            self, "covariance", frozen(np.reshape(self.covariance, (k, k)), (k, k), "covariance")
        )
        model = self.covariance if self.model is None else self.model
        object.__setattr__(self, "model", frozen(np.reshape(model, (k, k)), (k, k), "covariance of model"))

    def __repr__(self) -> str:
        told = (f"{name} {deviation:.2g}" for name, deviation in self.deviations.items())
        return f"Uncertainty({', '.join(told)})"

    @property
    def deviations(self) -> dict[str, float]:
        """The standard deviation of each estimated parameter."""
        roots = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return {
            single: float(root)
            for tied, root in zip(Parameters.of(self.names).groups, roots, strict=True)
            for single in tied
        }


class Variances(NamedTuple):
    """How large a fit with priors found noise and displacements to be (methods/decoupled/evidence.py).

    Attributes:
        noise: px^2 of a coordinate.
        surface: metres^2, of the target's smooth displacement along its plane and across it.
        singles: metres^2, of corners by themselves along each axis.
        bend: of the lens's displacement, squared unit of its plane.
        size: of the target, metres.
        likeness: of errors within a view, 1 or more.
    """

    noise: float
    surface: tuple[float, float]
    singles: tuple[float, float, float]
    bend: float
    size: float
    likeness: float


class Candidate(NamedTuple):
    """What a method tried, and how well it predicts photographs that it has not seen.

    Attributes:
        target: the kind of the target's shape.
        lens: a formula, or `free`.
        held_out_px: rms over all corners, each view predicted by the others, pixels per point; NaN where no
            view could judge it, or its fit was stopped on its way.
        standard_error_px: of it, views taken as independent draws.
        loses_px: its held-out error less that of the one that was taken.
        base: the formula under a free lens, or the formula itself.
        fit: `joint`, or `pairs` where the formula was fitted to the pairs of step 1.
        views: how many views could judge it.
    """

    target: str
    lens: str
    held_out_px: float
    standard_error_px: float
    loses_px: float
    base: str = ""
    fit: str = "joint"
    views: int = 0


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera with the evidence for it.

    Attributes:
        camera_from_target: one pose for each of `detections.views`, in their order.
        method, settings: what was called, so that it can be called again.
        status: how the solver ended, a sentence.
        steps: how many it took.
        assumptions: what was taken for granted because the data could not tell, each a sentence.
        target_shape: where the target's corners were found to be; flat where nothing is said.
        parameters: how many of camera and shape the data determined, a real number where priors shared in it.
        candidates: what else was tried, simplest first.
        free_camera: with the lens that no formula limits, where the camera's is a formula.
        variances: that a fit with priors found and ended with.
        kept: the fits that its method made, for evaluation in the same process; neither saved nor sent.
    Raises:
        InputError: poses and views, or the shape and the target, do not match in number.
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
    assumptions: tuple[str, ...] = ()
    # type: ignore[assignment]  # flat, made below for as many corners as there are
    target_shape: TargetShape = None  # type: ignore[assignment]
    parameters: float = float("nan")  # the uncertainty's, where nothing is said
    candidates: tuple[Candidate, ...] = ()
    free_camera: Camera | None = None
    variances: Variances | None = None
    kept: Any = field(default=None, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"kept": None}

    def __post_init__(self) -> None:
        corners = len(self.detections.target.points)
        if self.target_shape is None:
            object.__setattr__(self, "target_shape", TargetShape.flat(corners))
        elif len(self.target_shape.displacements) != corners:
            raise InputError(
                f"a shape of {len(self.target_shape.displacements)} corners for a target of {corners};"
                " expected one for each."
            )
        if np.isnan(self.parameters):
            object.__setattr__(self, "parameters", float(len(self.uncertainty.names)))
        object.__setattr__(self, "candidates", tuple(self.candidates))
        object.__setattr__(self, "camera_from_target", tuple(self.camera_from_target))
        if len(self.camera_from_target) != len(self.detections.views):
            raise InputError(
                f"{len(self.camera_from_target)} poses for {len(self.detections.views)} views; expected one"
                " for each."
            )

    def __repr__(self) -> str:
        return (
            f"Calibration({self.method}, rms {self.rms_px:.3g} px, target {self.target_shape.kind})\n"
            f"  {self.camera!r}\n  {self.detections!r}"
        )

    def residuals(self) -> tuple[Float[ndarray, "_ 2"], ...]:
        """Predicted minus detected, pixels, an array (n,2) for each view; the formula's own value where its
        domain has ended.
        """
        return residuals_of(self.camera, self.camera_from_target, self.detections, shape=self.target_shape)

    def corrected(self) -> Detections:
        """The detections with every corner where the pin-hole alone sees it (the paper's q_p).

        Detections of a straight photograph are detections like any: a calibration of these finds K and no
        lens. Corners beside or behind the camera have no such place and are left out.
        """
        K, points = self.camera.intrinsics, self.target_points
        views = []
        for pose, view in zip(self.camera_from_target, self.detections.views, strict=True):
            x, y, z = pose.apply(points[view.ids]).T
            front = z > 0
            pixels = np.stack(K.pixel(x[front] / z[front], y[front] / z[front]), axis=-1)
            views.append(replace(view, ids=view.ids[front], pixels=pixels))
        return replace(self.detections, views=tuple(views))

    @property
    def target_points(self) -> Float[ndarray, "m 3"]:
        """Where the target's corners are, metres, target frame: nominal points and what the shape adds."""
        return points_of(self.detections.target, self.target_shape)

    @property
    def rms_px(self) -> float:
        """Root mean square of |residual| over all corners, pixels (per point, as OpenCV's)."""
        return rms(np.concatenate(self.residuals()))


def points_of(target: Target, shape: TargetShape | None) -> Float[ndarray, "m 3"]:
    """Where a target's corners are, metres, target frame; nominally where no shape is known."""
    return target.points if shape is None else target.points + shape.displacements


def residuals_of(
    camera: Camera,
    camera_from_target: Sequence[Pose],
    detections: Detections,
    *,
    shape: TargetShape | None = None,
) -> tuple[Float[ndarray, "_ 2"], ...]:
    """Predicted minus detected, pixels, an array (n,2) for each view, for a camera and one pose for each
    view.
    """
    points, views = points_of(detections.target, shape), detections.views
    if not views:
        return ()
    placed = [pose.apply(points[view.ids]) for pose, view in zip(camera_from_target, views, strict=True)]
    apart = camera.project(np.concatenate(placed), beyond=True) - np.concatenate(
        [view.pixels for view in views]
    )
    return tuple(np.split(apart, np.cumsum([len(each) for each in placed])[:-1]))


def corners_beyond(
    camera: Camera, camera_from_target: Sequence[Pose], points: Float[ndarray, "m 3"], detections: Detections
) -> int:
    """How many corners lie where the lens formula has ended before them.

    Args:
        points: the target's corners as they are, metres.
    """
    views = zip(camera_from_target, detections.views, strict=True)
    placed = np.concatenate([pose.apply(points[view.ids]) for pose, view in views])
    return int(np.isnan(camera.project(placed)[:, 0]).sum())


def rms(residuals: Float[ndarray, "n 2"]) -> float:
    """Root mean square of |e| over points."""
    return float(np.sqrt((residuals * residuals).sum(-1).mean()))
