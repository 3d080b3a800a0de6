"""The paper's section 4 in its order: what is run, and the results of a run.

All trials of all studies are one list of jobs for one executor, each a picklable call with its own seed;
results come back in the list's order whatever the executor does, so the same seed gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

from orthoscope.models.lenses import LENSES
from orthoscope.paper.entries import PAPER, every_lens, fair_peers
from orthoscope.paper.eq7_searches import ALIKE, DAMPINGS, WEIGHTS, Eq7Search, member, rivals
from orthoscope.paper.photographs import SPLIT_COUNT, check_views, grids_of, split_outcomes
from orthoscope.paper.subgrids import subgrids
from orthoscope.paper.trials import Condition, Outcome, Study, trial_outcomes
from orthoscope.targets.detections import Detections

__all__ = ["PAPER_BOARD", "PAPER_NOISE_PX", "SCENES", "Plan", "Results", "run"]

SCENES = ("low", "high")
# The paper's sheet has so many inner corners.
PAPER_BOARD = (14, 20)
# The paper says that "some existing corner detection algorithms claim an accuracy of 0.1 pixels".
PAPER_NOISE_PX = 0.1
# So many numbers of points are tried, each of them a part of the paper's sheet.
GRID_COUNT = 8

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Plan:
    """How much is run: trials of figs. 2 to 5 and of the number of images; fewer for tables; which levels;
    the seed of everything random.

    Attributes:
        board: the sub-grid of the paper's board that all but the points' studies use, None for all of it.
        points: sub-grids of the paper's board.
        grids: how many of the photographed one.
        lenses: those that every method is tried with.
        dampings: of eq. (7), searched on data of condition eq7.
    """

    trials: int = 25
    seed: int = 0
    board: tuple[int, int] | None = None
    noise_px: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
    points: tuple[tuple[int, int], ...] = subgrids(PAPER_BOARD, GRID_COUNT)
    images: tuple[int, ...] = (1, 2, 3, 4, 5, 7, 10, 15)
    lenses: tuple[str, ...] = tuple(LENSES)
    dampings: tuple[tuple[str, float], ...] = DAMPINGS
    weights: tuple[tuple[float, float, float], ...] = WEIGHTS
    eq7: Condition = Condition(PAPER_NOISE_PX)
    grids: int = GRID_COUNT
    most_table_trials: int = 5

    @classmethod
    def quick(cls, *, trials: int = 2, seed: int = 0) -> Plan:
        """A look at everything in seconds: few levels, small boards, two dampings."""
        return cls(
            trials=trials,
            seed=seed,
            board=(6, 9),
            noise_px=(0.0, 0.5),
            points=((3, 4), (6, 9)),
            images=(1, 4),
            lenses=("brown",),
            dampings=(DAMPINGS[0], DAMPINGS[3]),
            eq7=Condition(PAPER_NOISE_PX, (5, 7), 5),
            grids=2,
            most_table_trials=1,
        )

    @property
    def table_trials(self) -> int:
        """Of the table of lenses and of the noise-free check, whose rows differ by far more than trials
        do.
        """
        return min(self.trials, self.most_table_trials)

    def studies(self) -> tuple[tuple[Study, int], ...]:
        """Each study and its number of trials."""
        everyone = (*PAPER, *fair_peers())
        noise = Study(
            "noise", self.noise_px, tuple(Condition(noise, self.board) for noise in self.noise_px), everyone
        )
        sizes = tuple(float(columns * rows) for columns, rows in self.points)
        points = Study(
            "points", sizes, tuple(Condition(PAPER_NOISE_PX, grid) for grid in self.points), everyone
        )
        images = Study(
            "images",
            tuple(map(float, self.images)),
            tuple(Condition(PAPER_NOISE_PX, self.board, m) for m in self.images),
            everyone,
        )
        exact = Study("exact", sizes[:1], (Condition(0.0, self.points[0]),), everyone)
        lenses = Study(
            "lenses", (PAPER_NOISE_PX,), (Condition(PAPER_NOISE_PX, self.board),), every_lens(self.lenses)
        )
        return (
            *((study, self.trials) for study in (noise, points, images)),
            *((study, self.table_trials) for study in (exact, lenses)),
        )


@dataclass(frozen=True, eq=False)
class Results:
    """What came out: every trial of the simulations, the cameras of eq. (7), every split of the photographs
    (none without photographs).
    """

    plan: Plan
    outcomes: Sequence[Outcome]
    members: Sequence[Eq7Search]
    on_photographs: Sequence[Outcome]
    detections: Detections | None


def run(
    plan: Plan,
    *,
    detections: Detections | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Results:
    """Run a plan, and the paper's section 4.2 on detections where there are any.

    Args:
        executor: where trials run; by default here, one after the other.
        progress: called with (jobs done, jobs).
    Raises:
        CalibrationError: the photographs are too few.
    """
    if detections:
        check_views(detections)
    simulated = [
        partial(trial_outcomes, study, scene, seed=plan.seed, trial=trial)
        for study, trials in plan.studies()
        for scene in SCENES
        for trial in range(trials)
    ]
    eq7 = [
        partial(_members, scene, searched, plan.eq7, plan.seed)
        for scene in SCENES
        for searched in (
            *((*damping, ALIKE) for damping in plan.dampings),
            *((*plan.dampings[0], weights) for weights in plan.weights),
            None,
        )
    ]
    real = (
        [
            partial(split_outcomes, detections, turn, grids=grids_of(detections, plan.grids))
            for turn in range(SPLIT_COUNT)
        ]
        if detections
        else []
    )
    # long jobs first: no one waits for the last
    done = _done((*eq7, *real, *simulated), executor, progress)
    first, second = len(eq7), len(eq7) + len(real)
    return Results(
        plan, _joined(done[second:]), _joined(done[:first]), _joined(done[first:second]), detections
    )


def _members(
    scene: str,
    searched: tuple[str, float, tuple[float, float, float]] | None,
    condition: Condition,
    seed: int,
) -> list[Eq7Search]:
    """One search of eq. (7), or what the others make of its data."""
    if searched is None:
        return rivals(scene, condition=condition, seed=seed)
    return [member(scene, *searched, condition=condition, seed=seed)]


def _done(jobs: Sequence[partial], executor: Executor | None, progress: Progress | None) -> list[list[Any]]:
    results = []
    for result in (executor.map if executor else map)(_call, jobs):
        results.append(result)
        if progress:
            progress(len(results), len(jobs))
    return results


def _call(job: partial) -> Any:
    return job()


def _joined(lists: Sequence[list[Any]]) -> list[Any]:
    return [entry for entries in lists for entry in entries]
