"""The truth table: what the verdict says of photographs whose truth is known, and whether that is right.

    python -m benchmarks.studies.truth_table               ten seeds of every scenario; writes
    docs/measured/verdict.md python -m benchmarks.studies.truth_table --seeds 2 --only zoom

Every scenario (scenarios.py) is made by cameras that are not this project's, calibrated and evaluated as a
user would. A verdict is right where its grade and its cause are among those that the scenario names, and,
where two cameras are named, no photograph is in the wrong group. Beside that two rules hold everywhere:
nothing is called good whose true error is above 1 px or above three times the predicted one; nothing is
thrown away that is off by less than 0.1 px and less than the corners' noise. Rows are kept in a file as they
are found, so that a run that was stopped goes on.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.studies.scenarios import REFUSED, SCENARIOS, Scenario
from benchmarks.studies.worlds import World, made, true_error
from orthoscope import CalibrationError, Detections, View, chessboard
from orthoscope.evaluation.evaluate import examine
from orthoscope.evaluation.verdict.facts import situation_of
from orthoscope.evaluation.verdict.grades import GRADES, Grade
from orthoscope.evaluation.verdict.situation import Situation
from orthoscope.evaluation.verdict.verdict import Verdict, verdict_on
from orthoscope.methods import calibrate

__all__ = ["Row", "judged", "page"]

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/measured/verdict.md"
ROWS = ROOT / "build/truth_table.jsonl"
PLACES = 300  # corners at which the true error is looked at
FAR_PX, OFTEN = (
    1.0,
    3.0,
)  # a camera that is called good is off by no more, nor by so many times what was predicted
TOO_FAR = "though off by more than 1 px or three times what was predicted"
NEAR = "though off by less than 0.1 px and less than the noise"
PERFECT = ("perfect", "no distortion", "rational", "wide lens", "fisheye", "large board")
BLAMES = ("photographs", "lens", "target", "views", "corners")
NEAR_PX = 0.1  # a camera that is off by less, and by less than the noise, is not thrown away


class Row(NamedTuple):
    """One scenario with one seed: the facts that were found. Grade and words are made of them anew.

    Args:
        scenario: its name.
        seed: of its world.
        facts: what the verdict is made from; None where calibrate said that the photographs cannot tell.
        true_px: how far off the camera is; NaN where there is none.
        grouped: photographs named, and those of them in the wrong group; None where no groups were named.
    """

    scenario: str
    seed: int
    facts: dict[str, Any] | None
    true_px: float
    grouped: tuple[int, int] | None

    @property
    def of(self) -> Scenario:
        """The scenario."""
        return next(scenario for scenario in SCENARIOS if scenario.name == self.scenario)

    @property
    def verdict(self) -> Verdict | None:
        """What is said; None where there is no calibration."""
        return verdict_on(Situation(**self.facts)) if self.facts else None

    @property
    def grade(self) -> str:
        """Of the verdict."""
        return str(self.verdict.grade) if self.verdict else REFUSED

    @property
    def cause(self) -> str:
        """Of the verdict."""
        return self.verdict.cause if self.verdict else REFUSED

    @property
    def predicted_px(self) -> float:
        """How far off the camera is said to be."""
        return self.facts["error_px"] if self.facts else float("nan")

    @property
    def right(self) -> bool:
        """Whether grade and cause are among those that the scenario names, and groups are as they were."""
        due = self.grade in self.of.grades and self.cause in self.of.causes
        if self.cause == "photographs" and self.grouped is not None:
            return due and self.of.groups and self.grouped[1] == 0
        return due

    @property
    def breach(self) -> str:
        """Which of the rules that hold everywhere is broken; empty for none."""
        if self.grade in (Grade.GOOD, Grade.REGION) and (
            self.true_px > FAR_PX or self.true_px > OFTEN * self.predicted_px
        ):
            return "called good"
        recipe = self.of.recipe
        noise = float(np.sqrt(2.0) * np.hypot(recipe.noise, recipe.alike))
        return "thrown away" if self.grade == Grade.NO and self.true_px < min(NEAR_PX, noise) else ""


def judged(scenario: Scenario, seed: int) -> Row:
    """What is found of a scenario's world."""
    world = made(scenario.recipe, seed)
    board = chessboard(*(scenario.board or scenario.recipe.board))
    views = tuple(View(*photograph) for photograph in world.photographs)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            detections = Detections(board, scenario.recipe.camera.size, views)
            calibration = calibrate(detections, **scenario.settings)
            situation = situation_of(examine(calibration))
    except CalibrationError:
        return Row(scenario.name, seed, None, float("nan"), None)
    pixels = np.concatenate([view.pixels for view in calibration.detections.views])
    pixels = pixels[:: max(1, len(pixels) // PLACES)]
    true_px = true_error(world, pixels, calibration.camera.unproject(pixels))
    return Row(scenario.name, seed, asdict(situation), true_px, _grouped(situation, world))


def _grouped(found: Situation, world: World) -> tuple[int, int] | None:
    """How many photographs were put into groups, and how many of them into the wrong one."""
    if not found.groups:
        return None
    true = {
        photograph.image: group for photograph, group in zip(world.photographs, world.groups, strict=True)
    }
    named = [(true[image], i) for i, images in enumerate(found.groups) for image in images]
    as_named = sum(group == i for group, i in named)
    return len(named), min(as_named, len(named) - as_named)


def page(rows: Sequence[Row]) -> str:
    """The page that says all of it."""
    of = {scenario.name: [row for row in rows if row.scenario == scenario.name] for scenario in SCENARIOS}
    of = {name: found for name, found in of.items() if found}
    lines = ["# The verdict, measured", "", *_summary(rows, of), "", *_lines(of), "", "## What was wrong", ""]
    wrong = [_wrong(row) for row in rows if not row.right or row.breach]
    return "\n".join([*lines, *(wrong or ["Nothing."])]) + "\n"


def _wrong(row: Row) -> str:
    cause = f" ({row.cause})" if row.cause else ""
    breach = f"; {row.breach}" if row.breach else ""
    figures = f"off by {row.true_px:.2f} px, predicted {row.predicted_px:.2f}"
    return f"- {row.scenario}, seed {row.seed}: {row.grade}{cause}, {figures}{breach}"


def _summary(rows: Sequence[Row], of: dict[str, list[Row]]) -> list[str]:
    """What it is, and the figures over all scenarios."""
    seeds = max(len(found) for found in of.values())
    ratio = np.array([row.predicted_px / row.true_px for row in rows])
    ratio = ratio[np.isfinite(ratio)]
    breaches = Counter(row.breach for row in rows)
    agreeing = [row for row in rows if row.of.recipe.cameras[0] == "one" and not row.of.recipe.shutter]
    differing = [row for row in rows if row.of.causes == ("photographs",)]
    named = [row.grouped for row in rows if row.grouped is not None and row.cause == "photographs"]
    perfect = [row for row in rows if row.scenario.startswith(PERFECT)]
    figures = (
        ("grade and cause right", _share([row.right for row in rows])),
        (f"called good, {TOO_FAR}", _of(breaches["called good"], rows)),
        (f"thrown away, {NEAR}", _of(breaches["thrown away"], rows)),
        ("predicted error over true error, geometric mean", f"{np.exp(np.log(ratio).mean()):.2f}"),
        ("true error above twice the predicted one", _share(ratio < 0.5)),
        ("photographs that agree, said not to", _share([row.cause == "photographs" for row in agreeing])),
        ("photographs that do not agree, found", _share([row.cause == "photographs" for row in differing])),
        ("groups named with every photograph right", _share([wrong == 0 for _, wrong in named])),
        ("perfect photographs on which anything is blamed", _share([row.cause in BLAMES for row in perfect])),
    )
    return [
        f"Written by `python -m benchmarks.studies.truth_table`: {len(of)} scenarios, {seeds} seeds each,",
        "made by cameras that are not this project's (`benchmarks/studies/projectors.py`), calibrated and",
        "judged as a user would. What the grades mean, how it is predicted: [verdict.md](../verdict.md).",
        "",
        "| what | found |",
        "|---|---|",
        *(f"| {what} | {found} |" for what, found in figures),
        "",
        "| grade | means |",
        "|---|---|",
        *(f"| {row.grade} | {row.says} |" for row in GRADES),
    ]


def _lines(of: dict[str, list[Row]]) -> list[str]:
    """A line for each scenario."""
    lines = [
        "## Scenario by scenario",
        "",
        "Errors are medians over seeds, px. What is right: grades, then causes (- for none).",
        "",
        "| scenario | right | said | true | predicted | what is right |",
        "|---|---|---|---|---|---|",
    ]
    for name, rows in of.items():
        scenario = rows[0].of
        said = Counter(_said(row) for row in rows)
        told = ", ".join(f"{what} {count}" for what, count in said.most_common())
        causes = ", ".join(cause or "-" for cause in dict.fromkeys(scenario.causes))
        due = f"{', '.join(dict.fromkeys(scenario.grades))}; {causes}"
        true, predicted = _median([row.true_px for row in rows]), _median([row.predicted_px for row in rows])
        right = sum(row.right for row in rows)
        lines.append(f"| {name} | {right} of {len(rows)} | {told} | {true} | {predicted} | {due} |")
    return lines


def _said(row: Row) -> str:
    return f"{row.grade} ({row.cause})" if row.cause not in ("", REFUSED) else row.grade


def _share(which: Sequence[bool] | np.ndarray) -> str:
    return _of(int(np.sum(which)), which)


def _of(count: int, all_of: Sequence[Any] | np.ndarray) -> str:
    return f"{100.0 * count / max(len(all_of), 1):.1f} % ({count} of {len(all_of)})"


def _median(values: Iterable[float]) -> str:
    known = [value for value in values if np.isfinite(value)]
    return f"{np.median(known):.2f}" if known else "-"


def _read(path: Path) -> list[Row]:
    if not path.exists():
        return []
    return [_row(json.loads(line)) for line in path.read_text().splitlines()]


def _row(written: dict[str, Any]) -> Row:
    """A row as it was before it was written: JSON has lists for tuples."""
    facts = written["facts"]
    if facts:
        facts["groups"] = tuple(tuple(group) for group in facts["groups"])
        facts["wild_in"] = tuple(facts.get("wild_in", ()))
        facts |= {name: tuple(tuple(pair) for pair in facts[name]) for name in ("suspects", "precious")}
    return Row(**{**written, "facts": facts, "grouped": written["grouped"] and tuple(written["grouped"])})


def main(arguments: Sequence[str] | None = None) -> None:
    """Find what is not yet in the file of rows, and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument(
        "--only", default="", help="a part of the scenarios' names; the page is then printed, not written"
    )
    parser.add_argument("--rows", type=Path, default=ROWS, help="where rows are kept")
    asked = parser.parse_args(arguments)
    rows = _read(asked.rows)
    have = {(row.scenario, row.seed) for row in rows}
    asked.rows.parent.mkdir(parents=True, exist_ok=True)
    wanted = [scenario for scenario in SCENARIOS if asked.only in scenario.name]
    with asked.rows.open("a") as file:
        for seed in range(asked.seeds):
            for scenario in wanted:
                if (scenario.name, seed) in have:
                    continue
                rows.append(judged(scenario, seed))
                file.write(json.dumps(rows[-1]._asdict()) + "\n")
                file.flush()
                row = rows[-1]
                right = "" if row.right else "WRONG "
                print(f"{right}{row.breach} {row.scenario} {seed}: {row.verdict or REFUSED}", file=sys.stderr)
    names = {scenario.name for scenario in wanted}
    text = page([row for row in rows if row.scenario in names and row.seed < asked.seeds])
    if asked.only:
        print(text)
    else:
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        PAGE.write_text(text)


if __name__ == "__main__":
    main()
