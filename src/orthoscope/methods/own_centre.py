"""A full calibration whose lens has a distortion centre of its own: the frame of the lens is freed with the
rest.

The camera is L lens(L^-1 K ray), L = [s 0 centre_x; 0 s centre_y; 0 0 1]: the lens is radial in pixels about
its centre, as the paper's is.  s follows fx: for a lens of the plane it is the unit of the radius and nothing
else, a lens of the angle has its angles from it. What stretches the straight image as K does is held (a1 of
`pfet` at 1), and decentering is left to the centre, since to first order the two are one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orthoscope.fitting.identifiability import LEAST_NOISE_PX
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.mldc.lens_about_centre import CENTRE, SCALE
from orthoscope.models.camera import Camera
from orthoscope.models.parameters import Parameters
from orthoscope.solve.block_system import shared_covariance
from orthoscope.solve.least_squares import Options, Solution, Status, solve
from orthoscope.solve.losses import Loss

__all__ = ["CENTRE_OPEN", "centre_is_told", "with_own_centre"]

# A centre less certain than this share of the diagonal is not known: fitted to noise alone, a lens has one
# that seems certain to 2 or 3 %.
VAGUE_SHARE = 0.01

CENTRE_OPEN = "the views do not tell the distortion centre; it is taken at the principal point"


def with_own_centre(
    near: Estimate,
    observations: Observations,
    points: Float[ndarray, "p 3"],
    of_pinhole: Sequence[str],
    coefficients: Sequence[str],
    *,
    loss: Loss,
    options: Options,
) -> tuple[Solution[Estimate], tuple[str, ...]] | None:
    """The joint minimum with the centre free, and the names of what was; None where the views do not tell the
    centre.

    Args:
        near: the minimum with the lens about the principal point.
        observations: the corners.
        points: of the target, metres.
        of_pinhole: which parameters of K move.
        coefficients: which of the lens's.
        loss: how large errors count.
        options: of the solver.
    """
    camera = near.camera.with_unit_scale()
    K = camera.intrinsics
    shape = tuple(name for name in coefficients if name != SCALE.get(type(camera.lens)))
    free = (
        *(f"{name}=frame_scale" if name.startswith("fx") else name for name in of_pinhole),
        *shape,
        *CENTRE,
    )
    start = replace(camera, lens_frame=replace(K, fy=K.fx, skew=0.0))
    problem = Reprojection(observations, points, start, free)
    solution = solve(problem, Estimate(start, near.poses), loss=loss, options=options)
    if solution.status is Status.NO_COST:
        return None
    measured = 2 * observations.corners
    covariance = shared_covariance(solution.sums, measured)
    variance = solution.cost / max(measured - len(free) - 6 * len(near.poses.rotation), 1)
    told = centre_is_told(solution.unknowns.camera, free, covariance, float(np.sqrt(variance)))
    return (solution, free) if told else None


def centre_is_told(
    camera: Camera, free: Sequence[str], covariance: Float[ndarray, "k k"], sigma: float
) -> bool:
    """Whether a camera's distortion centre lies in the image and is certain enough.

    Args:
        camera: with a lens frame.
        free: what was estimated.
        covariance: (k,k) of it, for noise as large as the residuals found.
        sigma: of a coordinate of a residual, pixels.
    """
    frame, (width, height) = camera.lens_frame, camera.image_size
    assert frame is not None
    names = Parameters.of(free).names
    spread = np.diag(covariance)[[names.index(name) for name in CENTRE]].max()
    deviation = np.sqrt(spread) * max(1.0, LEAST_NOISE_PX / max(sigma, 1e-150))
    inside = 0 <= frame.cx <= width - 1 and 0 <= frame.cy <= height - 1
    return inside and bool(deviation < VAGUE_SHARE * np.hypot(width, height))
