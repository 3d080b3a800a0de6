"""The pin-hole alone: K and poses for corners that are taken to have no lens distortion.

Zhang's sections 3.1 and 3.2 without his 3.3, the paper's eq. (4). `nmldc` fits it to corners that it has
straightened; for corners as they were detected it is the pin-hole least-squares member, where `mldc` takes
its corrected points from.
"""

from __future__ import annotations

from dataclasses import replace

from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.starts.initial_camera import StartingCameras, starts
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.models.lenses.table import Brown
from orthoscope.solve.least_squares import Options, Solution, Status, solve
from orthoscope.solve.losses import Linear, Loss

__all__ = ["fit_pinhole", "pinhole_start"]


def pinhole_start(bases: StartingCameras) -> Estimate:
    """Zhang's closed form; where these corners have none, the K of a lens that was fitted to them.

    Raises:
        CalibrationError: the corners fit no camera.
    """
    if bases.pinhole is not None:
        return bases.pinhole
    return bases.posed(replace(next(starts(bases, Brown)).camera, lens=Brown()))


def fit_pinhole(
    bases: StartingCameras, *, loss: Loss | None = None, options: Options | None = None
) -> Solution[Estimate]:
    """The K and poses that minimise eq. (4), the parameters of K free that the views can tell.

    Raises:
        CalibrationError: no pin-hole sees the target as it is in the views, or they leave its focal length
            open.
    """
    start = pinhole_start(bases)
    problem = Reprojection(bases.observations, bases.points, start.camera, bases.narrowing.free)
    solution = solve(problem, start, loss=loss or Linear(), options=options)
    if solution.status is Status.NO_COST:
        raise CalibrationError(
            "no pin-hole sees the target as it is in these views: some corners would be behind the camera. "
            "Check the target's columns and rows and the order of the corners."
        )
    return solution
