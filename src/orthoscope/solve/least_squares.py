"""Levenberg-Marquardt over one shared block and one block for each view; it knows no camera.

Each step solves the normal equations at a place (block_system.py), damped; lambda follows the gain ratio,
actual over predicted reduction (H. B. Nielsen, IMM-REP-1999-05; step_size.py). A problem owns its unknowns:
it forms these sums at a place and moves along a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, Protocol, TypeVar

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.solve.block_system import NormalEquations, damped_step
from orthoscope.solve.losses import Linear, Loss
from orthoscope.solve.step_size import LEAST_DAMPING, Damping, Pace

__all__ = ["Options", "Problem", "Solution", "Status", "solve"]

Unknowns = TypeVar("Unknowns")

# Damping is at most this.
MOST_DAMPING = 1e12


class Problem(Protocol[Unknowns]):
    """What `solve` needs of a problem."""

    def linearise(self, unknowns: Unknowns, loss: Loss) -> NormalEquations:
        """The sums at a place; a cost that is not finite says that there is no solution there.

        Args:
            unknowns: the place.
            loss: what a squared residual costs.
        """
        ...

    def move(
        self, unknowns: Unknowns, shared: Float[ndarray, " k"], views: Float[ndarray, "m p"]
    ) -> Unknowns:
        """The unknowns after a step (rotations step on their manifold).

        Args:
            unknowns: those before it.
            shared: the shared step s, (k,).
            views: each view's step, (m,p).
        """
        ...


class Status(StrEnum):
    """How a solve ended; the value is a sentence to show."""

    CONVERGED = "converged"
    STEP_LIMIT = "stopped at the step limit; raise max_steps or give a better start"
    STUCK = (
        "stopped where only tiny steps lower the cost, short of a minimum; give a better start or fewer"
        " unknowns"
    )
    NO_COST = "could not start: the cost at the starting values is not finite"


@dataclass(frozen=True)
class Options:
    """How to solve.

    Attributes:
        max_steps: how many steps are tried at most.
        tolerance: a step that promises to lower the cost by no more than this share of it is the end.
        floor: so is one that promises no more than this, in the residual's unit squared (noise-free data).
        damping: lambda at the start.
        damp: what lambda is multiplied by, "diagonal" or "identity".
        trusting: whether the last step, known by how promises shrink, is taken without forming the sums after
            it; the solution's sums are then those before it, and its cost is what that step promised.
        progress: called with (step, cost) after each step that lowered the cost.
    Raises:
        InputError: damp is another word.
    """

    max_steps: int = 100
    tolerance: float = 1e-11
    floor: float = 1e-18
    damping: float = 1e-6
    damp: str = "diagonal"
    trusting: bool = False
    progress: Callable[[int, float], None] | None = None

    def __post_init__(self) -> None:
        if self.damp not in ("diagonal", "identity"):
            raise InputError(f"damp is {self.damp!r}; expected 'diagonal' or 'identity'.")


@dataclass(frozen=True, eq=False)
class Solution(Generic[Unknowns]):
    """Where a solve ended.

    Attributes:
        unknowns: what was found.
        sums: those at the unknowns.
        steps: how many were tried.
        status: why it stopped.
    """

    unknowns: Unknowns
    sums: NormalEquations
    steps: int
    status: Status

    @property
    def cost(self) -> float:
        """The sum of rho at the end."""
        return self.sums.cost


def solve(
    problem: Problem[Unknowns], start: Unknowns, *, loss: Loss | None = None, options: Options | None = None
) -> Solution[Unknowns]:
    """The unknowns that minimise the problem's cost, near the start.

    Args:
        problem: forms the sums at a place and moves along a step.
        start: the unknowns to begin with.
        loss: what a squared residual costs; least squares by default.
        options: how to solve.
    Returns:
        The place with the least cost that was met; its status says how the solve ended.
    """
    loss, options = loss or Linear(), options or Options()
    here, sums = start, problem.linearise(start, loss)
    if not np.isfinite(sums.cost):
        return Solution(here, sums, 0, Status.NO_COST)
    damping, steps, before = Damping(options.damping), 0, 0.0
    pace = Pace()
    while True:
        shared, views, promised = damped_step(sums, damping.value, options.damp)
        if status := _ending(sums, promised, damping.value, steps, options):
            return Solution(here, sums, steps, status)
        steps += 1
        if options.trusting and (last := _last_step(sums, promised, before, options)):
            shared, views, promised = last
            return Solution(
                problem.move(here, shared, views), _lowered(sums, promised), steps, Status.CONVERGED
            )
        before = 0.0
        there, trial, gained, length = here, sums, -np.inf, 1.0
        if 0.0 < promised < np.inf:
            length = pace.length(promised)
            there = problem.move(here, length * shared, length * views)
            trial = problem.linearise(there, loss)
            gained = sums.cost - trial.cost  # NaN or -inf where there is no solution
        if gained >= 0.0:
            here, sums, before = there, trial, promised if length == 1.0 else 0.0
            damping.loosen(gained / promised)
            pace.took(gained / promised)
            if options.progress:
                options.progress(steps, sums.cost)
        else:
            damping.tighten()
            pace = Pace()


def _ending(
    sums: NormalEquations, promised: float, damping: float, steps: int, options: Options
) -> Status | None:
    """How to end here, or None to go on.

    A damped step that promises nothing marks a minimum only if one as free as the first promises nothing too.
    """
    if _is_little(promised, sums, options):
        free = promised if damping <= options.damping else damped_step(sums, options.damping, options.damp)[2]
        return Status.CONVERGED if _is_little(free, sums, options) else Status.STUCK
    if damping > MOST_DAMPING:
        return Status.STUCK
    return Status.STEP_LIMIT if steps >= options.max_steps else None


def _is_little(promised: float, sums: NormalEquations, options: Options) -> bool:
    """Whether a promised reduction of the cost is not worth a step."""
    return abs(promised) <= options.tolerance * sums.cost + options.floor


def _last_step(
    sums: NormalEquations, promised: float, before: float, options: Options
) -> tuple[ndarray, ndarray, float] | None:
    """The undamped step and its promise, if it is the last one; else None.

    It is where promises that go on shrinking as they have since the one `before` are little after it.
    """

    def is_last(promised: float) -> bool:
        return 0.0 < promised < before and _is_little(promised * promised / before, sums, options)

    if not is_last(promised):
        return None
    # In a flat valley it is the damping that makes a promise small, so the last step has none.
    step = damped_step(sums, LEAST_DAMPING, options.damp)
    return step if is_last(step[2]) else None


def _lowered(sums: NormalEquations, promised: float) -> NormalEquations:
    """The sums with the cost that was promised."""
    return sums._replace(cost=max(sums.cost - promised, 0.0))
