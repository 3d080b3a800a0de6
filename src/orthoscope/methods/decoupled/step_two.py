"""Step 2 of `decoupled`: a lens formula from pairs of a corner's true direction and the pixel where it was
seen.

The paper's section 3.2 for any formula: there are no poses in it and no target, only K and the formula's
coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from orthoscope.fitting.lens_fit import FOCAL, about_principal_point, converted, fit_pairs
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.methods.decoupled.step_one import StepOneFit
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.table import parse_lens
from orthoscope.models.parameters import INTRINSICS, Parameters

__all__ = ["by_simplicity", "formula_from_pairs", "nearest_formula", "pairs_of_step_one"]


def by_simplicity(formulas: Iterable[str]) -> tuple[str, ...]:
    """Formulas, fewest coefficients to find first."""
    return tuple(sorted(formulas, key=lambda text: (len(parse_lens(text)[1]), text)))


def pairs_of_step_one(fit: StepOneFit) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 2"]]:
    """Corrected corners in the camera's frame, metres, and the pixels where they were detected."""
    observations, poses = fit.problem.measurements.observations, fit.estimate.poses
    in_camera = (
        np.einsum("vab,pb->vpa", poses.rotation, fit.problem.corners(fit.estimate))
        + poses.translation[:, None]
    )
    seen = observations.present > 0
    return in_camera[seen], observations.pixels()[seen]


def formula_from_pairs(fit: StepOneFit, lens: str) -> tuple[Camera, tuple[str, ...]]:
    """The camera with a formula, such as `brown` or `rational:k1,k4`, that best takes each corrected corner
    to its pixel.

    Also the names of the parameters that were fitted.

    Raises:
        CalibrationError: the formula cannot see that far from the axis.
        InputError: a lens that is none.
    """
    kind, coefficients = parse_lens(lens)
    free = (*Parameters.of(fit.problem.free).only(INTRINSICS).names, *coefficients)
    rays, pixels = pairs_of_step_one(fit)
    starts = [replace(fit.estimate.camera, lens=kind(**start)) for start in kind.starts]
    camera = fit_pairs(about_principal_point(rays, pixels, free), starts, loss=fit.loss).unknowns
    if not np.isfinite(camera.project(rays)).all():
        raise CalibrationError(
            f"the lens {lens} does not reach all corners. Use one that reaches farther, such as --lens"
            " kannala_brandt."
        )
    return camera, free


def nearest_formula(camera: Camera, rays: Float[ndarray, "n 3"], among: Sequence[str]) -> Camera:
    """The camera with the formula of `among` whose image of the rays is nearest to this camera's, in pixels.

    Raises:
        CalibrationError: none sees all the rays.
    """
    wanted = camera.project(rays)
    near: list[tuple[float, Camera]] = []
    for text in among:
        kind, free = parse_lens(text)
        try:
            other = converted(camera, kind, rays, free=(*FOCAL, *free))
        except CalibrationError:
            continue
        if np.isfinite(apart := ((other.project(rays) - wanted) ** 2).sum()):
            near.append((float(apart), other))
    if not near:
        raise CalibrationError(
            f"none of {', '.join(among)} sees as far from the axis as this camera does. Use a tool with a"
            " lens of the angle."
        )
    return min(near, key=lambda pair: pair[0])[1]
