"""Levenberg-Marquardt over one shared block and one block for each view; it knows no camera.

With s the shared step, v_j the step of view j, and sums over all measurements (weighted by the loss):

    [ A    B_1 ... B_m ] [ s  ]     [ a   ]        A = S^T S,  B_j = S^T V_j,  C_j = V_j^T V_j,
    [ B_1' C_1         ] [ v_1]  = -[ c_1 ]        a = S^T e,  c_j = V_j^T e
    [ ...        ...   ] [ ...]     [ ... ]

The views are eliminated: (A - sum B_j C_j^-1 B_j') s = -(a - sum B_j C_j^-1 c_j), then v_j = -C_j^-1 (c_j +
B_j' s). Damping adds lambda times the diagonal (D. Marquardt, 1963) or times the identity (K. Levenberg,
1944); lambda follows the gain ratio, actual over predicted reduction (H. B. Nielsen, IMM-REP-1999-05). A
problem owns its unknowns: it forms these sums at a place and moves along a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.solve.losses import Linear, Loss

__all__ = [
    "NormalEquations",
    "Options",
    "Problem",
    "Solution",
    "Status",
    "after_step",
    "blocks_times",
    "eliminated",
    "inverse_roots",
    "shared_covariance",
    "side_by_side",
    "solve",
]

Unknowns = TypeVar("Unknowns")

# Damping is at least this.
LEAST_DAMPING = 1e-15
# Damping is at most this.
MOST_DAMPING = 1e12
# An eigenvalue of the scaled shared system that is no larger is rounding: nothing was measured there.
LARGEST_OPEN_EIGENVALUE = 1e-14
# Promises shrink alike where the share of one and that of the next differ by less than this.
STEADY_SHARE = 0.2
# No step is made longer than so many times.
LONGEST_STEP = 10.0
# Views are eliminated so many numbers at a time (16 MB).
NUMBERS_AT_ONCE = 1 << 21
# Blocks of more unknowns are not inverted, and solved so many rows at a time.
WIDEST_INVERTED = 64
# An unknown that has at least this share (squared) in such a direction is open too.
OPEN_SHARE = 1e-8


class NormalEquations(NamedTuple):
    """The sums at one place, as in the module's docstring.

    There may be no views (m = 0), no shared unknowns (k = 0) and view blocks of any width p.

    Attributes:
        cost: the sum of rho over all measurements, in the residual's unit squared.
        A: shared with shared unknowns, (k,k).
        a: shared unknowns with the residuals, (k,).
        B: shared with each view's unknowns, (m,k,p).
        C: each view's unknowns with themselves, (m,p,p).
        c: each view's unknowns with the residuals, (m,p).
    """

    cost: float
    A: Float[ndarray, "k k"]
    a: Float[ndarray, " k"]
    B: Float[ndarray, "m k p"]
    C: Float[ndarray, "m p p"]
    c: Float[ndarray, "m p"]


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
    damping, steps, before = _Damping(options.damping), 0, 0.0
    pace = _Pace()
    while True:
        shared, views, promised = _damped_step(sums, damping.value, options.damp)
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
            pace = _Pace()


def shared_covariance(sums: NormalEquations, measurements: int) -> Float[ndarray, "k k"]:
    """Covariance of the shared unknowns for noise as large as the residuals found.

    The variance of the noise is cost / (measurements - unknowns).

    Args:
        sums: those at the solution.
        measurements: how many numbers were measured (two for each corner).
    Returns:
        (k,k); rows and columns of unknowns that the data leave open are infinite.
    """
    unknowns = sums.a.size + sums.c.size
    variance = sums.cost / max(measurements - unknowns, 1)
    # Conditioning is judged between unknowns of like size.
    scale = np.sqrt(_weights(sums.A, "diagonal"))
    values, vectors = np.linalg.eigh(eliminated(sums, _open_roots(sums.C)) / np.outer(scale, scale))
    covariance = (
        variance
        * (vectors / np.maximum(values, LARGEST_OPEN_EIGENVALUE))
        @ vectors.T
        / np.outer(scale, scale)
    )
    is_open = (vectors[:, values <= LARGEST_OPEN_EIGENVALUE] ** 2).sum(1) > OPEN_SHARE
    covariance[is_open] = covariance[:, is_open] = np.inf
    return covariance


def after_step(
    sums: NormalEquations, shared: Float[ndarray, " k"], views: Float[ndarray, "m p"]
) -> NormalEquations:
    """The sums where a step leads, as far as residuals are linear.

    Args:
        sums: those before it.
        shared: the shared step, (k,).
        views: each view's step, (m,p).
    """
    B = side_by_side(sums.B)
    a = sums.a + sums.A @ shared + B @ views.T.ravel()
    c = sums.c + (shared @ B).reshape(views.T.shape).T + (sums.C @ views[:, :, None])[:, :, 0]
    cost = sums.cost + float((sums.a + a) @ shared + ((sums.c + c) * views).sum())
    return sums._replace(cost=cost, a=a, c=c)


class _Damping:
    """lambda, after Nielsen: less the better a step kept its promise, ever more after steps up the cost.

    Faster than his: a narrow valley (rational lenses have them) is walked with hardly any damping and left
    with a lot.
    """

    def __init__(self, value: float) -> None:
        self.value, self._growth = value, 2.0

    def loosen(self, ratio: float) -> None:
        """After a step that gained `ratio` times what it had promised."""
        factor = 0.1 if ratio > 0.75 else max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
        self.value, self._growth = max(factor * self.value, LEAST_DAMPING), 2.0

    def tighten(self) -> None:
        """After a step that was not taken."""
        self.value, self._growth = self._growth * max(self.value, 1e-12), 4.0 * self._growth


class _Pace:
    """How long a step is best.

    In a curved valley promises shrink by the same share time after time, as each step goes as much too far,
    or not far enough: a step that gains g times what it promised is 2 - g times as long as is best.
    """

    def __init__(self) -> None:
        self._promises: list[float] = []
        self._gain = 1.0

    def length(self, promised: float) -> float:
        """Of the next step, in steps as they are."""
        self._promises.append(promised)
        if len(self._promises) < 3:
            return 1.0
        first, second, third = self._promises[-3:]
        if not (third < second and abs(third * first / second**2 - 1.0) < STEADY_SHARE and self._gain < 2.0):
            return 1.0
        self._promises.clear()
        return min(1.0 / (2.0 - self._gain), LONGEST_STEP)

    def took(self, gain: float) -> None:
        """Says what the step gained, as a share of its promise."""
        self._gain = gain


def _ending(
    sums: NormalEquations, promised: float, damping: float, steps: int, options: Options
) -> Status | None:
    """How to end here, or None to go on.

    A damped step that promises nothing marks a minimum only if one as free as the first promises nothing too.
    """
    if _is_little(promised, sums, options):
        free = (
            promised if damping <= options.damping else _damped_step(sums, options.damping, options.damp)[2]
        )
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
    step = _damped_step(sums, LEAST_DAMPING, options.damp)
    return step if is_last(step[2]) else None


def _lowered(sums: NormalEquations, promised: float) -> NormalEquations:
    """The sums with the cost that was promised."""
    return sums._replace(cost=max(sums.cost - promised, 0.0))


def _damped_step(sums: NormalEquations, damping: float, damp: str) -> tuple[ndarray, ndarray, float]:
    """Shared step, view steps and what the quadratic model promises to take off the cost; NaN for no step."""
    of_shared, of_views = damping * _weights(sums.A, damp), damping * _weights(sums.C, damp)
    C = sums.C + of_views[:, :, None] * np.eye(sums.C.shape[2])
    try:
        system, solved = (_with_triangles if C.shape[2] > WIDEST_INVERTED else _with_inverses)(sums, C)
        system[np.diag_indices_from(system)] += of_shared
        B = side_by_side(sums.B)
        shared = -np.linalg.solve(system, sums.a - B @ solved(sums.c).T.ravel())
    except np.linalg.LinAlgError:  # singular as far as numbers go
        return np.zeros_like(sums.a), np.zeros_like(sums.c), float("nan")
    views = -solved(sums.c + (shared @ B).reshape(sums.c.T.shape).T)
    damped = of_shared @ shared**2 + (of_views * views**2).sum()
    return shared, views, float(-(sums.a @ shared) - (sums.c * views).sum() + damped)


def _with_inverses(
    sums: NormalEquations, C: Float[ndarray, "m p p"]
) -> tuple[ndarray, Callable[[ndarray], ndarray]]:
    """The shared system, and what takes (m,p) to C^-1 of it, by the inverse of each block.

    Raises:
        LinAlgError: a block is not positive, as far as numbers go.
    """
    roots = inverse_roots(C)
    inverse = roots @ roots.transpose(0, 2, 1)
    return eliminated(sums, roots), lambda right: (inverse @ right[:, :, None])[:, :, 0]


def _with_triangles(
    sums: NormalEquations, C: Float[ndarray, "m p p"]
) -> tuple[ndarray, Callable[[ndarray], ndarray]]:
    """The same for wide blocks, of which an inverse takes many times the work that a few solutions take.

    Raises:
        LinAlgError: a block is not positive, as far as numbers go.
    """
    L = np.linalg.cholesky(C)
    system = sums.A - (sums.B @ _by_triangles(L, sums.B.transpose(0, 2, 1))).sum(0)
    return system, lambda right: _by_triangles(L, right[:, :, None])[:, :, 0]


def _by_triangles(L: Float[ndarray, "m p p"], right: Float[ndarray, "m p r"]) -> Float[ndarray, "m p r"]:
    """C^-1 right of each block C = L L', forwards and backwards, some rows at a time."""
    solved, starts = right.copy(), range(0, L.shape[1], WIDEST_INVERTED)
    for start in starts:
        rows = slice(start, start + WIDEST_INVERTED)
        solved[:, rows] -= L[:, rows, :start] @ solved[:, :start]
        solved[:, rows] = np.linalg.solve(L[:, rows, rows], solved[:, rows])
    for start in reversed(starts):
        rows, after = slice(start, start + WIDEST_INVERTED), slice(start + WIDEST_INVERTED, None)
        solved[:, rows] -= L[:, after, rows].transpose(0, 2, 1) @ solved[:, after]
        solved[:, rows] = np.linalg.solve(L[:, rows, rows].transpose(0, 2, 1), solved[:, rows])
    return solved


def eliminated(sums: NormalEquations, roots: Float[ndarray, "m p p"]) -> Float[ndarray, "k k"]:
    """The shared system after the views are eliminated: a matrix times its own transpose, half the work of
    a product.

    Args:
        sums: of which A and B are used.
        roots: G of each view, C^-1 = G G'.
    """
    m, k, p = sums.B.shape
    left = sums.A.copy()
    at_once = max(1, NUMBERS_AT_ONCE // max(k * p, 1))
    for start in range(0, m, at_once):
        some = slice(start, start + at_once)
        W = blocks_times(sums.B[some], roots[some]).reshape(k, p * len(roots[some]))
        left -= W @ W.T
    return left


def side_by_side(B: Float[ndarray, "m k p"]) -> Float[ndarray, "k c"]:
    """All blocks beside each other, the first column of each first; no copy where they are stored so."""
    m, k, p = B.shape
    return B.transpose(1, 2, 0).reshape(k, p * m)


def blocks_times(B: Float[ndarray, "m k p"], G: Float[ndarray, "m p p"]) -> Float[ndarray, "k p m"]:
    """B G of every block, laid out as `side_by_side` wants it: all blocks at once, entry by entry."""
    factors = np.ascontiguousarray(G.transpose(1, 2, 0))
    return np.einsum("kim,ijm->kjm", B.transpose(1, 2, 0), factors)


def inverse_roots(C: Float[ndarray, "m p p"]) -> Float[ndarray, "m p p"]:
    """G of each block, C^-1 = G G'.

    Raises:
        LinAlgError: a block is not positive, as far as numbers go.
    """
    return np.linalg.inv(np.linalg.cholesky(C)).transpose(0, 2, 1)


def _open_roots(C: Float[ndarray, "m p p"]) -> Float[ndarray, "m p p"]:
    """G of each block, C^-1 = G G'; where nothing was measured, of what rounding would measure there."""
    scale = np.sqrt(_weights(C, "diagonal"))
    values, vectors = np.linalg.eigh(C / (scale[:, :, None] * scale[:, None, :]))
    return vectors / scale[:, :, None] / np.sqrt(np.maximum(values, LARGEST_OPEN_EIGENVALUE))[:, None]


def _weights(block: ndarray, damp: str) -> ndarray:
    """What damping is multiplied by on the diagonal of a block, or of each of a stack of blocks."""
    diagonal = np.diagonal(block, axis1=-2, axis2=-1)
    return np.maximum(diagonal, 1e-12) if damp == "diagonal" else np.ones_like(diagonal)
