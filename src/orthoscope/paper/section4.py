"""The paper's section 4 in its order: what is run, and the results of a run.

All trials of all studies are one list of jobs for one executor, each a picklable call with its own seed;
results come back in the list's order whatever the executor does, so the same seed gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from orthoscope.geometry.arrays import InputError
from orthoscope.models.lenses.table import LENSES
from orthoscope.paper.entries import PAPER, PaperEntry, every_lens, fair_peers
from orthoscope.paper.eq7_searches import ALIKE, DAMPINGS, WEIGHTS, Eq7Search, member, rivals
from orthoscope.paper.photographs import SPLIT_COUNT, check_views, grids_of, split_outcomes
from orthoscope.paper.step_two import of_step_two
from orthoscope.paper.subgrids import subgrids
from orthoscope.paper.times import Timing, timings
from orthoscope.paper.trials import TRAINING_VIEWS, Condition, Outcome, Study, trial_outcomes
from orthoscope.simulation.scene import PAPER_FILL
from orthoscope.targets.detections import Detections

__all__ = [
    "ON_PHOTOGRAPHS",
    "PAPER_BOARD",
    "PAPER_NOISE_PX",
    "PARTS",
    "SCENES",
    "Part",
    "Plan",
    "Results",
    "run",
]

SCENES = ("low", "high")
# The paper's sheet has so many inner corners.
PAPER_BOARD = (14, 20)
# The paper says that "some existing corner detection algorithms claim an accuracy of 0.1 pixels".
PAPER_NOISE_PX = 0.1
# So many numbers of points are tried, each of them a part of the paper's sheet.
GRID_COUNT = 8

Progress = Callable[[int, int], None]


class Part(NamedTuple):
    """What stands on its own in section 4: the study that it needs, and in which scenes."""

    study: str
    scenes: tuple[str, ...]


# Studies that are not curves over trials of the simulation.
SEARCHES, TIMES, FIRST, ON_PHOTOGRAPHS = "eq7", "times", "fig1", "photographs"
# The figures and tables by the names of their files; whoever asks for some of them gets the studies of these.
PARTS = {
    "fig1": Part(FIRST, ()),
    "fig2": Part("noise", SCENES[:1]),
    "fig3": Part("noise", SCENES[1:]),
    "fig4": Part("points", SCENES[:1]),
    "fig5": Part("points", SCENES[1:]),
    "images_low": Part("images", SCENES[:1]),
    "images_high": Part("images", SCENES[1:]),
    "exact": Part("exact", SCENES),
    "step2": Part("step2", SCENES),
    "times": Part(TIMES, SCENES[:1]),
    "lenses": Part("lenses", SCENES),
    "eq7": Part(SEARCHES, SCENES),
    "fig6": Part(ON_PHOTOGRAPHS, ()),
    "fig7": Part(ON_PHOTOGRAPHS, ()),
    "table1": Part(ON_PHOTOGRAPHS, ()),
}


@dataclass(frozen=True)
class Plan:
    """How much is run.

    Attributes:
        trials: of figs. 4 and 5, where the paper has 25; fewer of the others.
        seed: of everything random.
        board: the sub-grid of the paper's board that all but the points' studies use, None for all of it.
        noise_px: levels of figs. 2 and 3.
        points: sub-grids of the paper's board, levels of figs. 4 and 5.
        images: numbers of them.
        lenses: those that every method is tried with.
        dampings: of eq. (7), searched on data of condition eq7.
        weights: of eq. (7), beside 1, 1, 1.
        eq7: what data it is searched on.
        grids: how many of the photographed board.
        most_trials: of figs. 2 and 3 and of the number of images, for which the paper names no number.
        most_table_trials: of the tables and of the noise-free check.
        timed: numbers of images that are timed.
        only: names of PARTS to run, all of them where none is named.
        own: methods of the user's own, which take part in every figure.
        tilt: least and greatest of the simulated views, radians.
        fill: least and greatest share of the image that the simulated board has.
    Raises:
        InputError: a part that there is not, no level, a level that makes no sense, or two methods of one
            name.
    """

    trials: int = 25
    seed: int = 0
    board: tuple[int, int] | None = None
    noise_px: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
    points: tuple[tuple[int, int], ...] = subgrids(PAPER_BOARD, GRID_COUNT)
    images: tuple[int, ...] = (1, 2, 3, 4, 5, 7, 10, 15)
    lenses: tuple[str, ...] = tuple(LENSES)
    dampings: tuple[tuple[str, float], ...] = DAMPINGS
    weights: tuple[tuple[float, float, float], ...] = WEIGHTS
    eq7: Condition = Condition(PAPER_NOISE_PX)
    grids: int = GRID_COUNT
    most_trials: int = 8
    most_table_trials: int = 3
    timed: tuple[int, ...] = (3, 5, 10, 15)
    only: tuple[str, ...] = ()
    own: tuple[PaperEntry, ...] = ()
    tilt: tuple[float, float] = (0.0, np.pi / 4)
    fill: tuple[float, float] = PAPER_FILL

    def __post_init__(self) -> None:
        if unknown := [name for name in self.only if name not in PARTS]:
            raise InputError(
                f"{unknown[0]!r} is no part of the paper's section 4; expected one of {', '.join(PARTS)}."
            )
        if not self.noise_px or not all(0 <= sigma < np.inf for sigma in self.noise_px):
            raise InputError(f"noise levels are {self.noise_px}; expected pixels, 0 or more.")
        for columns, rows in self.points:
            if not (3 <= columns <= PAPER_BOARD[0] and 3 <= rows <= PAPER_BOARD[1]):
                raise InputError(
                    f"a sub-grid of {columns} x {rows} points; expected 3 x 3 to"
                    f" {' x '.join(map(str, PAPER_BOARD))}."
                )
        names = [entry.name for entry in self.everyone()]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise InputError(f"two methods are called {twice[0]!r}; expected a name for each. Rename yours.")

    @classmethod
    def quick(cls, **changes: Any) -> Plan:
        """A look at everything in seconds: few levels, small boards, two dampings; changes: of a plan."""
        few: dict[str, Any] = {
            "trials": 2,
            "board": (6, 9),
            "noise_px": (PAPER_NOISE_PX, 0.5),
            "points": ((3, 4), (6, 9)),
            "images": (1, 4),
            "lenses": ("brown",),
            "dampings": (DAMPINGS[0], DAMPINGS[3]),
            "eq7": Condition(PAPER_NOISE_PX, (5, 7), 5),
            "grids": 2,
            "most_table_trials": 1,
            "timed": (),
        }
        return cls(**few | changes)

    def everyone(self) -> tuple[PaperEntry, ...]:
        """Who is compared in every figure: the paper's methods, ours, and the user's own."""
        return (*PAPER, *fair_peers(), *self.own)

    def wants(self, study: str, scene: str = "") -> bool:
        """Whether a study, in a scene, is among what was asked for."""
        parts = [PARTS[name] for name in self.only or PARTS]
        return any(part.study == study and (not scene or scene in part.scenes) for part in parts)

    def condition(
        self,
        noise_px: float = PAPER_NOISE_PX,
        subgrid: tuple[int, int] | None = None,
        views: int = TRAINING_VIEWS,
    ) -> Condition:
        """A condition with this plan's tilt and fill."""
        return Condition(noise_px, subgrid, views, self.tilt, self.fill)

    @property
    def table_trials(self) -> int:
        """Of the table of lenses and of the noise-free check, whose rows differ by far more than trials
        do.
        """
        return min(self.trials, self.most_table_trials)

    def studies(self) -> tuple[tuple[Study, int], ...]:
        """Each study and its number of trials."""
        everyone, at = self.everyone(), self.condition
        noise = Study(
            "noise", self.noise_px, tuple(at(noise, self.board) for noise in self.noise_px), everyone
        )
        sizes = tuple(float(columns * rows) for columns, rows in self.points)
        points = Study("points", sizes, tuple(at(subgrid=grid) for grid in self.points), everyone)
        images = Study(
            "images",
            tuple(map(float, self.images)),
            tuple(at(subgrid=self.board, views=m) for m in self.images),
            everyone,
        )
        exact = Study("exact", sizes[:1], (at(0.0, self.points[0]),), everyone)
        lenses = Study("lenses", (PAPER_NOISE_PX,), (at(subgrid=self.board),), every_lens(self.lenses))
        step2 = Study("step2", (PAPER_NOISE_PX,), (at(subgrid=self.board),), of_step_two())
        some = min(self.trials, self.most_trials)
        return (
            (points, self.trials),
            *((study, some) for study in (noise, images)),
            *((study, self.table_trials) for study in (exact, lenses, step2)),
        )


@dataclass(frozen=True, eq=False)
class Results:
    """What came out: every trial of the simulations, the cameras of eq. (7), times, every split of the
    photographs (none without photographs).
    """

    plan: Plan
    outcomes: Sequence[Outcome]
    members: Sequence[Eq7Search]
    timings: Sequence[Timing]
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
        plan: what and how much.
        detections: of photographs.
        executor: where trials run; by default here, one after the other.
        progress: called with (jobs done, jobs).
    Raises:
        CalibrationError: the photographs are too few.
        InputError: only parts that need photographs were asked for, and there are none.
    """
    if detections:
        check_views(detections)
    elif plan.only and all(PARTS[name].study == ON_PHOTOGRAPHS for name in plan.only):
        raise InputError(f"{', '.join(plan.only)} need photographs. Hand them in: --photos PHOTOS.")
    simulated = [
        partial(trial_outcomes, study, scene, seed=plan.seed, trial=trial)
        for study, trials in plan.studies()
        for scene in SCENES
        if plan.wants(study.name, scene)
        for trial in range(trials)
    ]
    eq7_condition = plan.eq7._replace(tilt=plan.tilt, fill=plan.fill)
    eq7 = [
        partial(_members, scene, searched, eq7_condition, plan.seed, plan.own)
        for scene in SCENES
        if plan.wants(SEARCHES)
        for searched in (
            *((*damping, ALIKE) for damping in plan.dampings),
            *((*plan.dampings[0], weights) for weights in plan.weights),
            None,
        )
    ]
    real = (
        [
            partial(
                split_outcomes,
                detections,
                turn,
                grids=grids_of(detections, plan.grids),
                entries=plan.everyone(),
            )
            for turn in range(SPLIT_COUNT)
        ]
        if detections and plan.wants(ON_PHOTOGRAPHS)
        else []
    )
    timed = (
        [
            partial(timings, plan.condition(subgrid=plan.board, views=count), seed=plan.seed)
            for count in plan.timed
        ]
        if plan.wants(TIMES)
        else []
    )
    # Long jobs come first: no one waits for the last.
    kinds = (eq7, timed, real, simulated)
    done = iter(_done([job for jobs in kinds for job in jobs], executor, progress))
    members, times, on_photographs, outcomes = (_joined([next(done) for _ in jobs]) for jobs in kinds)
    return Results(plan, outcomes, members, times, on_photographs, detections)


def _members(
    scene: str,
    searched: tuple[str, float, tuple[float, float, float]] | None,
    condition: Condition,
    seed: int,
    own: tuple[PaperEntry, ...],
) -> list[Eq7Search]:
    """One search of eq. (7), or what the others make of its data."""
    if searched is None:
        return rivals(scene, condition=condition, seed=seed, own=own)
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
