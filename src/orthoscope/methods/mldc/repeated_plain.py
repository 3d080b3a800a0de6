"""The two steps repeated as one reads them at first: the pin-hole on corrected corners, again and again.

Each round corrects the detected corners with the lens of the last one, fits the pin-hole to the corrected
corners (eq. 4, in the straight image), takes new pairs and fits the lens to them (eq. 9 and 10). Two costs,
one for each step: where nothing changes neither is at its minimum for all unknowns, and the rounds are slow
(hundreds, see `rate`) or, for a wide lens on partial boards, run away. It stands here for the paper's page;
repeated.py is the one to use.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.starts.initial_camera import StartingCameras
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.methods.mldc.lens_about_centre import (
    fit_centred_lens,
    paired_parameters,
    parse_centred_lens,
    refit_centred_lens,
)
from orthoscope.methods.mldc.pairs import pairs_of
from orthoscope.models.lenses.table import Brown
from orthoscope.solve.least_squares import Options, Status, solve
from orthoscope.solve.losses import Loss

__all__ = ["PlainRounds", "repeat_plainly"]

# A round that moves no corrected corner by more, px rms, has settled.
SETTLED_PX = 1e-6
# A step within a round starts where the last one ended, and stops where numbers do.
INNER_OPTIONS = Options(max_steps=4, tolerance=1e-14)


class PlainRounds(NamedTuple):
    """Where the rounds ended: camera and poses, how many there were, what the last moved the corrected
    corners by.
    """

    estimate: Estimate
    rounds: int
    moved_px: float

    @property
    def status(self) -> str:
        """A sentence."""
        if self.moved_px < SETTLED_PX:
            return Status.CONVERGED.value
        return (
            f"stopped after {self.rounds} plain rounds: a round still moves the corrected corners by"
            f" {self.moved_px:.2g} px; --set correct=repeated ends"
        )


def repeat_plainly(
    bases: StartingCameras,
    nearest: Estimate,
    lens: str,
    *,
    rounds: int,
    loss: Loss,
    progress: Callable[[int, float], None] | None = None,
) -> PlainRounds:
    """Rounds from the pin-hole that is fitted without a lens.

    Args:
        bases: the corners, and which parameters of K they tell.
        nearest: that pin-hole.
        lens: as `parse_centred_lens` reads it.
        rounds: at most so many.
        loss: how step 2 counts large errors.
        progress: called after each round with (round, cost of step 2).
    Raises:
        CalibrationError: the lens cannot see the corners, or has no straight place for one of them.
    """
    observations, free = bases.observations, paired_parameters(*parse_centred_lens(lens))
    present, detected = observations.present > 0, observations.pixels()
    camera = fit_centred_lens(
        *pairs_of(bases, nearest.poses), pinhole=nearest.camera, lens=lens, loss=loss
    ).unknowns
    poses, before, moved, number = nearest.poses, np.full_like(detected[present], np.nan), np.inf, 0
    for number in range(1, rounds + 1):
        corrected = camera.undistort_pixels(detected[present])
        if not np.isfinite(corrected).all():
            raise CalibrationError(
                f"after {number - 1} plain rounds the lens has no straight place for"
                f" {int(np.isnan(corrected[:, 0]).sum())} of {len(corrected)} corners. Use --set"
                " correct=repeated."
            )
        u, v = np.zeros_like(observations.u), np.zeros_like(observations.v)
        u[present], v[present] = corrected.T
        straight = replace(camera, lens=Brown(), lens_frame=None)
        problem = Reprojection(replace(observations, u=u, v=v), bases.points, straight, bases.narrowing.free)
        pinhole = solve(problem, Estimate(straight, poses), options=INNER_OPTIONS).unknowns
        poses = pinhole.poses
        start = replace(camera, intrinsics=pinhole.camera.intrinsics)
        fit = refit_centred_lens(
            *pairs_of(bases, poses), start=start, free=free, loss=loss, options=INNER_OPTIONS
        )
        if fit.status is Status.NO_COST:
            raise CalibrationError(
                f"after {number} plain rounds the lens cannot see all corners. Use --set correct=repeated."
            )
        camera = fit.unknowns
        moved = float(np.sqrt(((corrected - before) ** 2).sum(1).mean())) if number > 1 else np.inf
        before = corrected
        if progress:
            progress(number, fit.cost)
        if moved < SETTLED_PX:
            break
    return PlainRounds(Estimate(camera, poses), number, moved)
