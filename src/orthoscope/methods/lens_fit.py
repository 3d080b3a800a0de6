"""A lens from pairs: rays on one side, the pixels where they fall on the other.

Floor 3.  No poses, no target: the unknowns are K and the coefficients, all of them shared.  The paper's section 3.2 for any lens; also how one lens
formula is turned into another (the rays are then those of the first).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.methods.reprojection import parameter_columns, with_parameters
from orthoscope.models.camera import Camera
from orthoscope.models.lens import Lens
from orthoscope.solve.least_squares import NormalEquations, Solution, Status, solve
from orthoscope.solve.losses import Loss

__all__ = ["converted", "fit_lens"]

FOCAL = ("fx", "fy", "cx", "cy")


class _Pairs:
    """The problem: |camera(ray) - pixel|, over the free parameters of the camera."""

    def __init__(self, rays: Float[ndarray, "n 3"], pixels: Float[ndarray, "n 2"], free: Sequence[str]) -> None:
        self.rays, self.pixels, self.free = rays, pixels, tuple(free)

    def linearise(self, unknowns: Camera, loss: Loss) -> NormalEquations:
        with np.errstate(all="ignore"):
            x, y = unknowns.lens.chart.flatten(*self.rays.T)
            columns, predicted = parameter_columns(unknowns, x, y, self.free)
            residual = predicted - self.pixels.T
            squared = (residual**2).sum(0)
            if (weight := loss.weight(squared)) is not None:
                columns, residual = columns * np.sqrt(weight), residual * np.sqrt(weight)
        k = len(self.free)
        S, e = columns.reshape(k, -1), residual.reshape(-1)
        return NormalEquations(float(loss.cost(squared).sum()), S @ S.T, S @ e, np.empty((0, k, 0)), np.empty((0, 0, 0)), np.empty((0, 0)))

    def move(self, unknowns: Camera, shared: ndarray, views: ndarray) -> Camera:
        return with_parameters(unknowns, self.free, shared)


def fit_lens(rays: Float[ndarray, "n 3"], pixels: Float[ndarray, "n 2"], start: Camera, free: Sequence[str]) -> Solution[Camera]:
    """The camera near `start` that best takes each ray to its pixel, by least squares in pixels over the free parameters."""
    return solve(_Pairs(rays, pixels, free), start)


def converted(camera: Camera, lens: type[Lens], rays: Float[ndarray, "n 3"]) -> Camera:
    """The camera with another lens formula, nearest in pixels to the first over the given rays.

    Every start that the formula names is tried, since some of them have more than one minimum.
    Raises CalibrationError where the formula cannot see these rays.
    """
    pixels = camera.project(rays)
    best: Solution[Camera] | None = None
    for coefficients in lens.starts:
        solution = fit_lens(rays, pixels, replace(camera, lens=lens(**coefficients)), (*FOCAL, *lens.free))
        if solution.status is not Status.NO_COST and (best is None or solution.cost < best.cost):
            best = solution
    if best is None:
        farthest = np.degrees(np.arccos(np.clip((rays[:, 2] / np.linalg.norm(rays, axis=1)).min(), -1, 1)))
        raise CalibrationError(
            f"the lens {lens.__name__} cannot see as far from its axis as these corners are ({farthest:.0f} degrees). "
            "Use a lens of the angle: --lens kannala_brandt."
        )
    return best.unknowns
