"""Whether the views tell the camera, and what they leave open.

Three cases. Fewer numbers than unknowns: nothing to solve. A scale that stays vague: seen by targets that are
all parallel to one plane a camera may be longer and its targets farther away, and a lens with more
coefficients than the corners tell does the like; then there is no camera to hand out. Coefficients that only
together make the image, as those of a fraction do: the camera is known, they are not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.fitting.calibration import Uncertainty
from orthoscope.fitting.reprojection import Estimate
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.parameters import Parameters
from orthoscope.solve.least_squares import Solution
from orthoscope.targets.detections import Detections

__all__ = ["LEAST_NOISE_PX", "check_enough", "check_known", "told"]

# Corners are never taken to be better than this, pixels, when asking what views or lines can tell.
LEAST_NOISE_PX = 0.1
# A scale less certain than this share of itself is not known.
VAGUE_SHARE = 0.1
# Targets that are turned against the first by less than this, radians, count as parallel.
PARALLEL_ANGLE = np.deg2rad(10.0)


def check_enough(used: Detections, free: Sequence[str]) -> None:
    """Says where there are more unknowns than measured numbers.

    Args:
        used: what was found.
        free: parameters of the camera.
    Raises:
        CalibrationError: there are.
    """
    measured, unknowns = 2 * used.corners, len(free) + 6 * len(used.views)
    if measured < unknowns:
        raise CalibrationError(
            f"{used.corners} corners in {_views(used)} are {measured} numbers, fewer than the {unknowns}"
            f" unknowns (6 for each view, {len(free)} of the camera). Take more photographs, or free fewer"
            " coefficients of the lens, as in --lens brown:k1."
        )


def check_known(
    solution: Solution[Estimate], free: Sequence[str], covariance: Float[ndarray, "k k"], used: Detections
) -> None:
    """Says where the views leave the scale at the image's centre open.

    Args:
        solution: what was found.
        free: parameters of the camera.
        covariance: of the free parameters.
        used: the views.
    Raises:
        CalibrationError: they do.
    """
    camera, poses = solution.unknowns
    variance = solution.cost / max(2 * used.corners - len(free) - 6 * len(used.views), 1)
    deviation = _relative_deviation_of_scale(camera, free, covariance) * max(
        1.0, LEAST_NOISE_PX / max(np.sqrt(variance), 1e-150)
    )
    if deviation < VAGUE_SHARE:
        return
    how = (
        f"its standard deviation is {100 * deviation:.0f} % of itself"
        if np.isfinite(deviation)
        else "any value fits"
    )
    shows = f"{_views(used)} {'shows' if len(used.views) == 1 else 'show'}"
    why = (
        f"{shows} the target (nearly) parallel to one plane, and then distance and focal length cannot be"
        " told apart"
        if _largest_turn(poses.rotation) < PARALLEL_ANGLE
        else f"{shows} too little of it, or the lens has more coefficients than they can tell"
    )
    raise CalibrationError(
        f"the camera cannot be known from these photographs: its focal length is open ({how})."
        f" {why[0].upper()}{why[1:]}. Take more photographs, with the target tilted by 20 to 45 degrees in"
        " different directions."
    )


def told(free: Sequence[str], covariance: Float[ndarray, "k k"]) -> tuple[Uncertainty, tuple[str, ...]]:
    """The uncertainty of the parameters that the views tell, and what to say of the others."""
    known = np.isfinite(np.diag(covariance))
    names = [name for name, is_known in zip(free, known, strict=True) if is_known]
    others = ", ".join(name for name in free if name not in names)
    said = (
        (f"{others}: the views do not tell them apart; other values together make the same images",)
        if others
        else ()
    )
    return Uncertainty(tuple(names), covariance[np.ix_(known, known)]), said


def _views(used: Detections) -> str:
    return "one view" if len(used.views) == 1 else f"{len(used.views)} views"


def _relative_deviation_of_scale(camera: Camera, free: Sequence[str], covariance: ndarray) -> float:
    """Standard deviation of pixels per radian at the image's centre, as a share of it.

    Some lenses share this scale between fx and a coefficient, and neither then is certain by itself.
    """
    parameters = Parameters.of(free)
    image = camera.linearise(np.array([[1e-4, 2e-4], [0.0, 0.0], [1.0, 1.0]]), parameters)
    scale, gradient = np.diff(image.u)[0], np.diff(image.by_parameters()[:, 0])[:, 0]
    usual = np.array(
        [1.0 if set(names) <= set(parameters.coefficients) else scale for names in parameters.groups]
    )
    matters = (
        np.abs(gradient) * usual > 1e-5 * scale
    )  # the others may be open, and infinity times nothing is not nothing
    gradient, covariance = gradient[matters], covariance[np.ix_(matters, matters)]
    if not np.isfinite(covariance).all():
        return np.inf
    return float(np.sqrt(gradient @ covariance @ gradient) / scale)


def _largest_turn(rotations: Float[ndarray, "m 3 3"]) -> float:
    """The largest angle, radians, between the target's normal in the first view and in another."""
    normals = rotations[:, :, 2]
    return float(np.arccos(np.clip(normals @ normals[0], -1.0, 1.0)).max())
