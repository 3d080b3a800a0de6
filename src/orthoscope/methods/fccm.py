"""Full calibration (FCCM), the paper's first peer: pin-hole, lens and poses in one least-squares problem.

Floor 3.  Steps as in Zhang's section 3, for any lens of LENSES, partial boards and lenses past 90 degrees (start.py):
1. a homography for each view; 2. K in closed form, or an equidistant lens; 3. poses; 4. everything together, Levenberg-Marquardt.
Z. Zhang, A flexible new technique for camera calibration, TPAMI 22(11), 2000.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orthoscope.version import __version__
from orthoscope.geometry.arrays import CalibrationError, Float, InputError, ndarray
from orthoscope.geometry.target import Detections
from orthoscope.methods.calibration import Calibration, Uncertainty
from orthoscope.methods.closed_form import poses_of_camera
from orthoscope.methods.observations import Observations
from orthoscope.methods.reprojection import Estimate, Reprojection
from orthoscope.methods.screening import screened
from orthoscope.methods.start import Narrowing, starting_cameras, suited_lens
from orthoscope.models.camera import Camera
from orthoscope.models.lenses import parse_lens
from orthoscope.solve.least_squares import Options, Solution, Status, shared_covariance, solve
from orthoscope.solve.losses import LOSSES, Loss

__all__ = ["fccm"]

AUTO = "auto"
ADEQUATE = 0.003  # an rms below this share of the diagonal is a minimum worth having; above it the other start is tried too
NOISE = 0.1  # px: corners are never taken to be better than this when asking what the views can tell
VAGUE = 0.05  # a focal length less certain than this share of itself is not known


def fccm(
    detections: Detections,
    *,
    lens: str = "auto",
    skew: bool = False,
    loss: str = "linear",
    loss_scale: float = 1.0,
    max_steps: int = 200,
    progress: Callable[[int, float], None] | None = None,
) -> Calibration:
    """Calibrate pin-hole, lens and poses jointly (Zhang's full calibration; the paper's FCCM).

    lens: a name of LENSES, or with the coefficients to free, `brown:k1,k2`; `auto` takes brown, or kannala_brandt for wide views.  skew: whether K has one.  loss, loss_scale: a name of LOSSES and where
    it starts to matter, pixels.  progress: called after each step with (step, cost).
    Raises CalibrationError where the views cannot tell the camera, InputError for a setting that is none.
    """
    if loss not in LOSSES:
        raise InputError(f"loss {loss!r} is not known; expected one of {', '.join(LOSSES)}.")
    used = screened(detections)
    observations, points = Observations.of(used), used.target.points
    narrowing = Narrowing.of(len(used.views), skew=skew)
    if lens == AUTO:
        lens = suited_lens(observations, points, used.image_size, narrowing)
    kind, coefficients = parse_lens(lens)
    free = (*narrowing.free, *coefficients)
    starts = starting_cameras(observations, points, used.image_size, kind, narrowing)
    options = Options(max_steps=max_steps, progress=progress)
    solution = _best(starts, observations, points, free, LOSSES[loss](loss_scale), options)
    camera, poses = solution.unknowns
    covariance = shared_covariance(solution.sums, 2 * observations.corners)
    _check_known(camera, free, covariance, solution.cost, observations)
    return Calibration(
        camera=camera,
        camera_from_target=observations.poses_in_order(poses),
        detections=used,
        method="fccm",
        settings={"lens": lens, "skew": skew, "loss": loss, "loss_scale": loss_scale, "max_steps": max_steps},
        uncertainty=Uncertainty(free, covariance),
        status=solution.status.value,
        steps=solution.steps,
        version=__version__,
        assumptions=(narrowing.assumption,) if narrowing.assumption else (),
    )


def _best(
    starts: list[Camera], observations: Observations, points: Float[ndarray, "p 3"], free: tuple[str, ...], loss: Loss, options: Options
) -> Solution[Estimate]:
    """The joint refinement from the first start that ends well, or else the best of all."""
    best: Solution[Estimate] | None = None
    enough = observations.corners * float(loss.cost(np.array((ADEQUATE * np.hypot(*starts[0].image_size)) ** 2)))
    for camera in starts:
        problem = Reprojection(observations, points, camera, free)
        solution = solve(problem, Estimate(camera, poses_of_camera(camera, observations, points)), loss=loss, options=options)
        if camera.lens.scaled_by:  # at the minimum already: this only expresses it, and its covariance, by K's scale
            here = solution.unknowns
            solution = solve(problem, Estimate(here.camera.with_unit_scale(), here.poses), loss=loss, options=options)
        if solution.status is not Status.NO_COST and (best is None or solution.cost < best.cost):
            best = solution
        if best is not None and best.cost < enough:
            return best
    if best is None:
        raise CalibrationError(
            "no start led anywhere: the corners of some view cannot be images of the target in front of a camera. "
            "Check the target's columns and rows, and the corners' order."
        )
    return best


def _check_known(camera: Camera, free: tuple[str, ...], covariance: ndarray, cost: float, observations: Observations) -> None:
    """Raises CalibrationError where the views leave the focal length open, as parallel ones do."""
    unknowns = len(free) + 6 * len(observations.order)
    variance = cost / max(2 * observations.corners - unknowns, 1)
    widened = np.sqrt(np.diag(covariance)[0] * max(1.0, NOISE**2 / max(variance, 1e-300)))
    if widened < VAGUE * camera.intrinsics.fx:
        return
    told = f"its standard deviation is {100 * widened / camera.intrinsics.fx:.0f} % of itself" if np.isfinite(widened) else "any value fits"
    many = "the one view shows" if len(observations.order) == 1 else f"the {len(observations.order)} views show"
    raise CalibrationError(
        f"the camera cannot be known from these photographs: {many} the target (nearly) parallel to one plane, and then "
        f"distance and focal length cannot be told apart ({told}). Take photographs with the target tilted by 20 to 45 degrees, in different directions."
    )
