"""Tables of section 4 with what the paper claims about each, from the results of a run.

The distortion centre, step 2, times, Table 1, and the number behind Fig. 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import ndarray
from orthoscope.paper.claims import about_steps, sentences
from orthoscope.paper.claims.claim import Claim, ClaimVerdict
from orthoscope.paper.claims.wording import each_of
from orthoscope.paper.entries import MLDC, PAPER, REPEATED
from orthoscope.paper.photographs import obliqueness
from orthoscope.paper.section4 import SCENES, Results
from orthoscope.paper.step_two import of_step_two
from orthoscope.paper.trials import Outcome

__all__ = [
    "Centre",
    "ParameterColumn",
    "StepTwoRow",
    "centres",
    "parameter_columns",
    "stable_centre",
    "step_two_claims",
    "step_two_rows",
    "straightened_claims",
    "time_claims",
]

# A distortion centre that changes by less, pixels, from trial to trial is a stable one.
STEADY_PX = 2.0


@dataclass(frozen=True)
class Centre:
    """Where a method puts the distortion centre over the trials of a scene: means and standard deviations,
    pixels.
    """

    scene: str
    name: str
    trials: int
    x: tuple[float, float]
    y: tuple[float, float]


def centres(results: Results) -> list[Centre]:
    """Of every method that has a centre of its own, at the paper's noise and all points."""
    most = max((outcome.level for outcome in results.outcomes if outcome.study == "points"), default=0.0)
    found = []
    for scene in SCENES:
        chosen = [o for o in results.outcomes if (o.study, o.scene, o.level) == ("points", scene, most)]
        for name in dict.fromkeys(outcome.entry for outcome in chosen):
            of_entry = [o.judgement for o in chosen if o.entry == name and not o.judgement.failure]
            own = [j for j in of_entry if (j.centre_x, j.centre_y) != (j.cx, j.cy)]
            if own and len(own) == len(of_entry):
                x, y = np.array([(j.centre_x, j.centre_y) for j in own]).T
                if len(own) > 1 and np.ptp(x) == 0:
                    continue  # it is taken for granted, not computed
                found.append(Centre(scene, name, len(own), (_mean(x), _spread(x)), (_mean(y), _spread(y))))
    return found


def stable_centre(results: Results) -> tuple[Claim, ...]:
    """Whether MLDC's centre is the same over the trials, in each scene."""
    paper = sentences.STABLE
    said = []
    for scene in SCENES:
        if not results.plan.wants("points", scene):
            continue
        of_scene = {centre.name: centre for centre in centres(results) if centre.scene == scene}
        where, mldc = f"Section 5, {scene}", of_scene.get(MLDC)
        spread = {name: max(centre.x[1], centre.y[1]) for name, centre in of_scene.items()}
        if mldc is None or not np.isfinite(spread[MLDC]):
            said.append(Claim(where, paper, ClaimVerdict.OPEN, "Fewer than two trials gave a centre."))
            continue
        verdict = ClaimVerdict.HOLDS if spread[MLDC] < STEADY_PX else ClaimVerdict.FAILS
        finding = (
            f"Over {mldc.trials} trials its centre is at ({mldc.x[0]:.1f}, {mldc.y[0]:.1f}) px; standard"
            f" deviations of the worse coordinate, px: {each_of(spread)}."
        )
        said.append(Claim(where, paper, verdict, finding))
    return tuple(said)


@dataclass(frozen=True)
class ParameterColumn:
    """A column of Table 1: mean errors, and of fx, fy, cu, cv (pixels) and gamma (degrees) mean and standard
    deviation over the splits.
    """

    name: str
    values: dict[str, tuple[float, float]]
    training_nce: float
    test_nce: float
    failures: int


def parameter_columns(results: Results) -> list[ParameterColumn]:
    """Table 1, from all points; the paper's three first."""
    most = max((outcome.level for outcome in results.on_photographs), default=0.0)
    whole = [outcome for outcome in results.on_photographs if outcome.level == most]
    names = list(dict.fromkeys([*(entry.name for entry in PAPER), *(outcome.entry for outcome in whole)]))
    return [_parameters(name, [outcome for outcome in whole if outcome.entry == name]) for name in names]


def _parameters(name: str, outcomes: Sequence[Outcome]) -> ParameterColumn:
    given = [outcome.judgement for outcome in outcomes if not outcome.judgement.failure]
    fx, fy, cx, cy, skew = np.array([(j.fx, j.fy, j.cx, j.cy, j.skew) for j in given]).reshape(-1, 5).T
    columns = {"fx": fx, "fy": fy, "cu": cx, "cv": cy, "gamma": obliqueness(fx, skew)}
    return ParameterColumn(
        name,
        {
            key: (_mean(column), float(column.std(ddof=1)) if len(column) > 1 else float("nan"))
            for key, column in columns.items()
        },
        _mean(np.array([j.training_nce for j in given])),
        _mean(np.array([j.test_nce for j in given])),
        len(outcomes) - len(given),
    )


def _spread(values: ndarray) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else float("nan")


def _mean(values: ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")


@dataclass(frozen=True)
class StepTwoRow:
    """A row of the table of step 2: means over the trials."""

    scene: str
    name: str
    steps: float
    test_nce: float
    centre: tuple[float, float]


def step_two_rows(results: Results) -> list[StepTwoRow]:
    """Every degree, and every number of images that the lens was fitted to."""
    rows = []
    for scene in SCENES:
        for entry in of_step_two():
            given = [
                o.judgement
                for o in _of_study(results, "step2", scene)
                if o.entry == entry.name and not o.judgement.failure
            ]
            if given:
                steps, nce, x, y = np.array(
                    [(j.steps, j.test_nce, j.centre_x, j.centre_y) for j in given]
                ).mean(0)
                rows.append(StepTwoRow(scene, entry.name, float(steps), float(nce), (float(x), float(y))))
    return rows


def step_two_claims(results: Results) -> tuple[Claim, ...]:
    """What the paper says of the degree and of one image, in each scene."""
    judges = (about_steps.degree_does_not_matter, about_steps.one_image_is_enough)
    return tuple(
        judge(f"Section 3.2, {scene}", outcomes)
        for judge in judges
        for scene in SCENES
        if (outcomes := _of_study(results, "step2", scene))
    )


def time_claims(results: Results) -> tuple[Claim, ...]:
    """What the paper says of time; nothing where none was taken."""
    return (about_steps.time_grows("Times", results.timings),) if results.timings else ()


def straightened_claims(results: Results) -> tuple[Claim, ...]:
    """Fig. 7's sentence by a number: MLDC as printed, and repeated; nothing without photographs."""
    most = max((outcome.level for outcome in results.on_photographs), default=0.0)
    whole = [outcome for outcome in results.on_photographs if outcome.level == most]
    return tuple(
        about_steps.better_straightened("Fig. 7", whole, mldc=mldc) for mldc in (MLDC, REPEATED) if whole
    )


def _of_study(results: Results, study: str, scene: str) -> list[Outcome]:
    return [o for o in results.outcomes if (o.study, o.scene) == (study, scene)]
