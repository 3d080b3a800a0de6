"""Levenberg-Marquardt over one shared block and one block for each view; it knows no camera.

Floor 2.  With s the shared step, v_j the step of view j, and sums over all measurements (weighted by the loss):

    [ A    B_1 ... B_m ] [ s  ]     [ a   ]        A = S^T S,  B_j = S^T V_j,  C_j = V_j^T V_j,  a = S^T e,  c_j = V_j^T e
    [ B_1' C_1         ] [ v_1]  = -[ c_1 ]
    [ ...        ...   ] [ ...]     [ ... ]

The views are eliminated: (A - sum B_j C_j^-1 B_j') s = -(a - sum B_j C_j^-1 c_j), then v_j = -C_j^-1 (c_j + B_j' s).  Damping adds lambda
times the diagonal (D. Marquardt, 1963) or times the identity (K. Levenberg, 1944); lambda follows the gain ratio, actual over predicted
reduction (H. B. Nielsen, IMM-REP-1999-05).  A problem owns its unknowns: it forms these sums at a place and moves along a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.solve.losses import Linear, Loss

__all__ = ["NormalEquations", "Options", "Problem", "Solution", "Status", "shared_covariance", "solve"]

Unknowns = TypeVar("Unknowns")


class NormalEquations(NamedTuple):
    """The sums at one place: cost is the sum of rho, the rest as in the module's docstring; views m may be 0, widths p of C and k of A too."""

    cost: float
    A: Float[ndarray, "k k"]
    a: Float[ndarray, " k"]
    B: Float[ndarray, "m k p"]
    C: Float[ndarray, "m p p"]
    c: Float[ndarray, "m p"]


class Problem(Protocol[Unknowns]):
    """What `solve` needs of a problem."""

    def linearise(self, unknowns: Unknowns, loss: Loss) -> NormalEquations:
        """The sums at `unknowns`; a cost that is not finite says that there is no solution there."""
        ...

    def move(self, unknowns: Unknowns, shared: Float[ndarray, " k"], views: Float[ndarray, "m p"]) -> Unknowns:
        """The unknowns after a step (rotations step on their manifold)."""
        ...


class Status(StrEnum):
    """How a solve ended; the value is a sentence to show."""

    CONVERGED = "converged"
    STEP_LIMIT = "stopped at the step limit; raise max_steps or give a better start"
    STUCK = "stopped where no step lowers the cost, short of the tolerance; the data may not determine all unknowns"
    NO_COST = "could not start: the cost at the starting values is not finite"


@dataclass(frozen=True)
class Options:
    """How to solve.

    tolerance: stop when a step promises to lower the cost by less than this share of it.  floor: or by less than this, absolutely, in
    the residual's unit squared (noise-free data).  damping: lambda at the start.  damp: "diagonal" or "identity".
    progress: called after each step with (step, cost).
    """

    max_steps: int = 100
    tolerance: float = 1e-11
    floor: float = 1e-20
    damping: float = 1e-6
    damp: str = "diagonal"
    progress: Callable[[int, float], None] | None = None

    def __post_init__(self) -> None:
        if self.damp not in ("diagonal", "identity"):
            raise InputError(f"damp is {self.damp!r}; expected 'diagonal' or 'identity'.")


@dataclass(frozen=True, eq=False)
class Solution(Generic[Unknowns]):
    """Where a solve ended: the unknowns, the sums there, how many steps were taken and why it stopped."""

    unknowns: Unknowns
    sums: NormalEquations
    steps: int
    status: Status

    @property
    def cost(self) -> float:
        """The sum of rho at the end."""
        return self.sums.cost


def solve(problem: Problem[Unknowns], start: Unknowns, *, loss: Loss | None = None, options: Options | None = None) -> Solution[Unknowns]:
    """The unknowns that minimise the problem's cost, near the start."""
    loss, options = loss or Linear(), options or Options()
    here, sums = start, problem.linearise(start, loss)
    if not np.isfinite(sums.cost):
        return Solution(here, sums, 0, Status.NO_COST)
    damping, growth = options.damping, 2.0
    for step in range(1, options.max_steps + 1):
        shared, views, promised = _damped_step(sums, damping, options.damp)
        settled = promised <= options.tolerance * sums.cost + options.floor
        there = problem.move(here, shared, views) if np.isfinite(promised) else here
        trial = problem.linearise(there, loss)
        gained = sums.cost - trial.cost
        if np.isfinite(promised) and np.isfinite(trial.cost) and gained >= 0:
            here, sums = there, trial
            if options.progress:
                options.progress(step, sums.cost)
            if settled:
                return Solution(here, sums, step, Status.CONVERGED)
            ratio = gained / promised if promised > 0 else 1.0
            damping *= 0.1 if ratio > 0.75 else max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
            damping, growth = max(damping, 1e-15), 2.0
        elif settled or (np.isfinite(trial.cost) and -gained <= 1e-13 * sums.cost):
            return Solution(here, sums, step, Status.CONVERGED)  # what is left is rounding
        else:
            damping, growth = max(damping, 1e-8) * growth, 2.0 * growth
            if damping > 1e12:
                return Solution(here, sums, step, Status.STUCK)
    return Solution(here, sums, options.max_steps, Status.STEP_LIMIT)


def shared_covariance(sums: NormalEquations, measurements: int) -> Float[ndarray, "k k"]:
    """Covariance of the shared unknowns for noise as large as the residuals found; infinite where the data do not determine them.

    measurements: how many numbers were measured (two for each corner).  The variance is cost / (measurements - unknowns).
    """
    k, unknowns = len(sums.a), len(sums.a) + sums.c.size
    eliminated, _, _ = _eliminate(sums, 0.0, "diagonal")
    scale = np.sqrt(np.maximum(np.diag(sums.A), 1e-300))  # conditioning is judged between unknowns of like size
    values, vectors = np.linalg.eigh(eliminated / np.outer(scale, scale))
    variance = sums.cost / max(measurements - unknowns, 1)
    if k == 0 or values[0] <= 1e-15 * k:
        return np.full((k, k), np.inf)
    return variance * (vectors / values) @ vectors.T / np.outer(scale, scale)


def _damped_step(sums: NormalEquations, damping: float, damp: str) -> tuple[ndarray, ndarray, float]:
    """Shared step, view steps, and the reduction of the cost that the quadratic model promises."""
    eliminated, right, inverse = _eliminate(sums, damping, damp)
    shared = -np.linalg.lstsq(eliminated, right, rcond=None)[0] if _singular(eliminated) else -np.linalg.solve(eliminated, right)
    views = -(inverse @ (sums.c + shared @ sums.B)[:, :, None])[:, :, 0]
    damped = damping * (_weights(sums.A, damp) @ shared**2 + (_weights(sums.C, damp) * views**2).sum())
    return shared, views, float(-(sums.a @ shared) - (sums.c * views).sum() + damped)


def _eliminate(sums: NormalEquations, damping: float, damp: str) -> tuple[ndarray, ndarray, ndarray]:
    """The shared system after the views are eliminated, its right side, and C^-1 of each view, all damped."""
    m, k, p = sums.B.shape
    C = sums.C + damping * _weights(sums.C, damp)[:, :, None] * np.eye(p)
    inverse = np.linalg.inv(C) if m else C
    B = sums.B.transpose(1, 0, 2).reshape(k, m * p)
    Y = (sums.B @ inverse).transpose(1, 0, 2).reshape(k, m * p)
    eliminated = sums.A + damping * np.diag(_weights(sums.A, damp)) - Y @ B.T
    return eliminated, sums.a - Y @ sums.c.reshape(-1), inverse


def _weights(block: ndarray, damp: str) -> ndarray:
    """What damping is multiplied by on the diagonal of a block (or of each of a stack)."""
    diagonal = np.diagonal(block, axis1=-2, axis2=-1)
    return np.maximum(diagonal, 1e-12) if damp == "diagonal" else np.ones_like(diagonal)


def _singular(matrix: ndarray) -> bool:
    diagonal = np.diag(matrix)
    return bool(len(diagonal)) and not (diagonal > 0).all()
