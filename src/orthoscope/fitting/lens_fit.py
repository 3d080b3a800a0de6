"""A lens from pairs: rays on one side, the pixels where they fall on the other.

No poses, no target: the unknowns are parameters of the camera, all of them shared. The paper's section 3.2
for any lens (lens_about_centre.py fits it about a centre of its own); also how one lens formula is turned
into another: the rays are then those of the first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.lens import Formula
from orthoscope.models.parameters import Parameters
from orthoscope.solve.block_system import NormalEquations
from orthoscope.solve.least_squares import Options, Solution, Status, solve
from orthoscope.solve.losses import Loss

__all__ = ["FOCAL", "Pairs", "about_principal_point", "converted", "fit_lens", "fit_pairs"]

FOCAL = ("fx", "fy", "cx", "cy")

Columns = Callable[
    [Camera, Float[ndarray, "n 3"], Sequence[str]], tuple[Float[ndarray, "k 2 n"], Float[ndarray, "2 n"]]
]
Moved = Callable[[Camera, Sequence[str], Float[ndarray, " k"]], Camera]


class Pairs:
    """The problem: |camera(ray) - pixel|, over the free parameters of the camera.

    Args:
        rays: (n,3), of any length.
        pixels: where they are to fall, (n,2).
        free: the parameters that move.
        columns: d(u, v) by the free parameters, and (u, v).
        moved: the camera after a step of them.
    """

    def __init__(
        self,
        rays: Float[ndarray, "n 3"],
        pixels: Float[ndarray, "n 2"],
        free: Sequence[str],
        *,
        columns: Columns,
        moved: Moved,
    ) -> None:
        self.rays, self.pixels, self.free = rays, pixels, tuple(free)
        self._columns, self._moved = columns, moved

    def linearise(self, unknowns: Camera, loss: Loss) -> NormalEquations:
        """The solver's sums."""
        with np.errstate(all="ignore"):
            columns, predicted = self._columns(unknowns, self.rays, self.free)
            residual = predicted - self.pixels.T
            squared = (residual**2).sum(0)
            if (weight := loss.weight(squared)) is not None:
                columns, residual = columns * np.sqrt(weight), residual * np.sqrt(weight)
        k = len(self.free)
        S, e = columns.reshape(k, -1), residual.reshape(-1)
        return NormalEquations(
            float(loss.cost(squared).sum()),
            S @ S.T,
            S @ e,
            np.empty((0, k, 0)),
            np.empty((0, 0, 0)),
            np.empty((0, 0)),
        )

    def move(self, unknowns: Camera, shared: Float[ndarray, " k"], views: ndarray) -> Camera:
        """The camera after a step."""
        return self._moved(unknowns, self.free, shared)


def fit_lens(
    rays: Float[ndarray, "n 3"], pixels: Float[ndarray, "n 2"], start: Camera, free: Sequence[str]
) -> Solution[Camera]:
    """The camera that best takes each ray to its pixel, by least squares in pixels.

    Args:
        rays: (n,3), of any length.
        pixels: where they are to fall, (n,2).
        start: a camera near the one that is sought.
        free: parameters of K and lens that move.
    """
    return solve(about_principal_point(rays, pixels, free), start)


def converted(
    camera: Camera,
    lens: type[Formula],
    rays: Float[ndarray, "n 3"],
    *,
    free: Sequence[str] = (),
    starts: Sequence[Mapping[str, float]] = (),
) -> Camera:
    """The camera with another lens formula, nearest in pixels to the first over the given rays.

    Args:
        camera: the first.
        lens: the other formula.
        rays: (n,3), of any length.
        free: parameters of K and the lens that move; by default FOCAL and what the formula frees.
        starts: coefficients to start from; by default the formula's own.
    Raises:
        CalibrationError: the formula cannot see these rays.
    """
    cameras = [replace(camera, lens=lens(**coefficients)) for coefficients in starts or lens.starts]
    return fit_pairs(
        about_principal_point(rays, camera.project(rays), free or (*FOCAL, *lens.free)), cameras
    ).unknowns


def fit_pairs(
    problem: Pairs, starts: Sequence[Camera], *, loss: Loss | None = None, options: Options | None = None
) -> Solution[Camera]:
    """The fit with the lowest cost from any of the starts: some formulas have more than one minimum.

    Raises:
        CalibrationError: the formula cannot see the rays.
    """
    solutions = [solve(problem, start, loss=loss, options=options) for start in starts]
    usable = [solution for solution in solutions if solution.status is not Status.NO_COST]
    if usable:
        return min(usable, key=lambda solution: solution.cost)
    rays = problem.rays
    farthest = np.degrees(np.arccos(np.clip((rays[:, 2] / np.linalg.norm(rays, axis=1)).min(), -1, 1)))
    raise CalibrationError(
        f"the lens {type(starts[0].lens).__name__} cannot see as far from its axis as these corners are"
        f" ({farthest:.0f} degrees). Use a lens of the angle: --lens kannala_brandt."
    )


def about_principal_point(
    rays: Float[ndarray, "n 3"], pixels: Float[ndarray, "n 2"], free: Sequence[str]
) -> Pairs:
    """The problem of a camera whose lens stands about the principal point.

    Args:
        rays: (n,3), of any length.
        pixels: where they are to fall, (n,2).
        free: parameters of K and coefficients of the lens.
    """

    parameters = Parameters.of(free)

    def columns(
        camera: Camera, rays: Float[ndarray, "n 3"], _: Sequence[str]
    ) -> tuple[Float[ndarray, "k 2 n"], Float[ndarray, "2 n"]]:
        image = camera.linearise(rays.T, parameters)
        return image.by_parameters(), np.stack([image.u, image.v])

    def moved(camera: Camera, _: Sequence[str], step: Float[ndarray, " k"]) -> Camera:
        return parameters.moved(camera, step)

    return Pairs(rays, pixels, parameters.names, columns=columns, moved=moved)
