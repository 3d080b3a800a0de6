"""Weights found, not asked for: how large noise, displacements of corners and of the lens are, from the data
themselves.

The marginal likelihood of Gaussian priors is greatest where, for each group of unknowns with variance v,

    v = (sum of their squares) / gamma,      gamma = how many of them the data determined,
    sigma^2 = (sum of squared residuals) / (measurements - poses - camera - all gammas)

(D. MacKay, Bayesian interpolation, 1992). Groups: the surface in the target's plane and out of it; single
corners along each axis; the lens's displacement. Iterated with the estimate; a variance that the data do
not ask for runs to its floor, and the group to zero.

The errors of one view's corners are not independent (blur, a rolling shutter, a board that bends as it is
held): they have a smooth part, and smooth unknowns, the surface and the displacement, would take its chance
pattern for their own. `likeness` is how much larger smooth patterns over a view are in the residuals than
independent errors would make them; for smooth unknowns noise counts that much more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from orthoscope.fitting.calibration import Variances
from orthoscope.fitting.reprojection import POSE
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.methods.decoupled.normal_equations import SPACE, spline_unknowns
from orthoscope.methods.decoupled.problem import DecoupledEstimate, Joint, Known, Precisions
from orthoscope.solve.losses import Loss

__all__ = ["Evidence", "first_guess"]

# A printed corner's standard deviation starts from this share of the target's size; for a lens, from its
# image, a pixel's tenth.
GUESS_SHARE = 1e-3
# Below this share of it a variance that is taken over would need many rounds to grow.
AWAKE_SHARE = 0.03
# A standard deviation is at least this share of the target's size.
LEAST_SHARE = 1e-6
# A standard deviation is at most this share of the target's size.
MOST_SHARE = 0.03
# A bend is at least this, in the unit of the distorted plane.
LEAST_BEND = 1e-8
# A bend is at most this, in the unit of the distorted plane.
MOST_BEND = 0.1
# Noise and parameters may still change by this share.
SETTLED_SHARE = 0.01
# Without noise the squares that are left count as so much, px^2.
LEAST_SQUARES = 1e-24
PLANE, HEIGHT = slice(None, 2), slice(2, None)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Variances: noise, px^2 of a coordinate; surface (2,) in the plane and across, singles (3,), metres^2;
    bend, of the lens's plane.

    Attributes:
        size: of the target, metres.
        likeness: of errors within a view, 1 or more.
        parameters: how many the data determined, poses left out.
    """

    noise: float
    surface: tuple[float, float]
    singles: tuple[float, float, float]
    bend: float
    size: float
    likeness: float = 1.0
    parameters: float = float("nan")

    @property
    def variances(self) -> Variances:
        """To be kept with a calibration."""
        return Variances(self.noise, self.surface, self.singles, self.bend, self.size, self.likeness)

    @classmethod
    def of(cls, variances: Variances) -> Evidence:
        """As a calibration kept it."""
        return cls(*variances)

    def awake(self) -> Evidence:
        """With no variance of the target's shape so small that it could not grow."""
        least = (AWAKE_SHARE * GUESS_SHARE * self.size) ** 2
        surface, singles = np.maximum(self.surface, least), np.maximum(self.singles, least)
        return replace(
            self,
            surface=(float(surface[0]), float(surface[1])),
            singles=(float(singles[0]), float(singles[1]), float(singles[2])),
        )

    def precisions(self, coefficients: int) -> Precisions:
        """What a problem with so many coefficients of the surface is to know."""
        plane, height = self.surface
        smooth = self.likeness * self.noise
        surface = np.broadcast_to(smooth / np.array([plane, plane, height]), (coefficients, SPACE))
        return Precisions(surface, self.noise / np.array(self.singles), smooth / self.bend)

    def renewed(
        self, problem: Joint, unknowns: DecoupledEstimate, *, known: Known, loss: Loss, residuals: ndarray
    ) -> Evidence:
        """The variances that an estimate and what the data determined of it speak for.

        Args:
            loss: how errors count.
            residuals: of the problem at the estimate.
        Raises:
            CalibrationError: the estimate leaves errors that are no number.
        """
        observations = problem.measurements.observations
        bend_cost, _, _ = problem.penalties(unknowns)
        determined = len(problem.free) + known.spline + float(known.surface.sum() + known.singles.sum())
        freedom = 2 * observations.corners - POSE * len(observations.order) - determined
        left = float(loss.cost((residuals**2).sum(2)).sum())
        if not left < np.inf:  # not a number too: nothing was fitted
            raise CalibrationError("the photographs leave this model so open that its errors are no number.")
        noise = max(left, LEAST_SQUARES) / max(freedom, 1.0)
        low, high = (LEAST_SHARE * self.size) ** 2, (MOST_SHARE * self.size) ** 2
        surface = [
            _variance(unknowns.surface[:, part], float(known.surface[:, part].sum()), low, high)
            for part in (PLANE, HEIGHT)
        ]
        singles = [
            _variance(unknowns.singles[:, axis], float(known.singles[axis]), low, high)
            for axis in range(SPACE)
        ]
        bend = self.bend
        if spline_unknowns(unknowns.camera):
            squares = bend_cost / problem.precisions.spline
            bend = float(np.clip(squares / max(known.spline, 1e-9), LEAST_BEND**2, MOST_BEND**2))
        likeness = _likeness(problem, residuals, noise)
        return replace(
            self,
            likeness=likeness,
            noise=noise,
            surface=(surface[0], surface[1]),
            singles=(singles[0], singles[1], singles[2]),
            bend=bend,
            parameters=determined,
        )

    def agrees_with(self, other: Evidence) -> bool:
        """Whether noise and the number of determined parameters are as good as the same, so that the camera
        no longer moves.
        """
        return bool(
            abs(self.noise / other.noise - 1.0) < SETTLED_SHARE
            and abs(self.parameters / other.parameters - 1.0) < SETTLED_SHARE
        )


def first_guess(noise: float, size: float, focal: float) -> Evidence:
    """Where to start from.  noise: px^2 of a coordinate.  size: of the target, metres.  focal: pixels."""
    corner = (GUESS_SHARE * size) ** 2
    return Evidence(noise, (corner, corner), (corner, corner, corner), (0.1 / focal) ** 2, size)


def _likeness(problem: Joint, residuals: Float[ndarray, "m p 2"], noise: float) -> float:
    """Mean square of smooth patterns in the residuals of a view, over what independent errors of this
    variance would give.
    """
    seen, patterns = problem.measurements.observations.present, problem.smooth_patterns
    found = np.tensordot(residuals, patterns, axes=(1, 0))
    expected = noise * (seen @ patterns**2)
    return max(1.0, float((found**2).sum() / (2.0 * expected.sum())))


def _variance(values: np.ndarray, known: float, low: float, high: float) -> float:
    """known: how many of the values the data determined."""
    return float(np.clip((values**2).sum() / max(known, 1e-9), low, high)) if values.size else low
