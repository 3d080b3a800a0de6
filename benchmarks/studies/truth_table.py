"""The truth table: what the verdict says of photographs whose truth is known, and whether that is right.

    python -m benchmarks.studies.truth_table               ten seeds of every scenario; writes docs/measured/verdict.md
    python -m benchmarks.studies.truth_table --seeds 2 --only zoom

Every scenario (scenarios.py) is made by cameras that are not this project's, calibrated and evaluated as a user would. A verdict
is right where its grade and its cause are among those that the scenario names, and, where two cameras are named, no photograph
is in the wrong group. Beside that two rules hold everywhere: nothing is called good whose true error is above 1 px or above
three times the predicted one; nothing is thrown away that is off by less than 0.1 px and less than the corners' noise.
Rows are kept in a file as they are found, so that a run that was stopped goes on.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.studies.scenarios import REFUSED, SCENARIOS, Scenario
from benchmarks.studies.worlds import World, made, true_error
from orthoscope import CalibrationError, Detections, View, chessboard
from orthoscope.evaluation.evaluate import Evaluation, evaluate
from orthoscope.evaluation.verdict.grades import GRADES, Grade
from orthoscope.methods import calibrate

__all__ = ["Row", "breach", "judged", "page"]

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/measured/verdict.md"
ROWS = ROOT / "build/truth_table.jsonl"
PLACES = 300  # corners at which the true error is looked at
FAR_PX, OFTEN = (
    1.0,
    3.0,
)  # a camera that is called good is off by no more, nor by so many times what was predicted
NEAR_PX = 0.1  # a camera that is off by less, and by less than the noise, is not thrown away


class Row(NamedTuple):
    """One scenario with one seed.

    Args:
        scenario: its name.
        seed: of its world.
        grade, cause: of the verdict; `refused` where calibrate said that the photographs cannot tell.
        right: whether both are among those that the scenario names.
        true_px, predicted_px: how far off the camera is; NaN where there is none.
        noise_px: of a corner, per point.
        grouped: photographs named, and those of them in the wrong group; None where no groups were named.
        told: the verdict's words.
    """

    scenario: str
    seed: int
    grade: str
    cause: str
    right: bool
    true_px: float
    predicted_px: float
    noise_px: float
    grouped: tuple[int, int] | None
    told: str


def judged(scenario: Scenario, seed: int) -> Row:
    """What the verdict says of a scenario's world, and whether it is right."""
    world = made(scenario.recipe, seed)
    noise = float(np.sqrt(2.0) * np.hypot(scenario.recipe.noise, scenario.recipe.alike))
    board = chessboard(*(scenario.board or scenario.recipe.board))
    views = tuple(View(*photograph) for photograph in world.photographs)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            calibration = calibrate(
                Detections(board, scenario.recipe.camera.size, views), **scenario.settings
            )
            found = evaluate(calibration)
    except CalibrationError as error:
        nothing = float("nan")
        right = REFUSED in scenario.grades
        return Row(
            scenario.name,
            seed,
            REFUSED,
            REFUSED,
            right,
            nothing,
            nothing,
            noise,
            None,
            str(error).split(".")[0],
        )
    pixels = np.concatenate([view.pixels for view in found.calibration.detections.views])
    pixels = pixels[:: max(1, len(pixels) // PLACES)]
    grouped = _grouped(found, world)
    return Row(
        scenario=scenario.name,
        seed=seed,
        grade=str(found.verdict.grade),
        cause=found.verdict.cause,
        right=found.verdict.grade in scenario.grades
        and found.verdict.cause in scenario.causes
        and (grouped is None or (scenario.groups and grouped[1] == 0)),
        true_px=true_error(world, pixels, found.calibration.camera.unproject(pixels)),
        predicted_px=found.situation.error_px,
        noise_px=noise,
        grouped=grouped,
        told=str(found.verdict),
    )


def _grouped(found: Evaluation, world: World) -> tuple[int, int] | None:
    """How many photographs were put into groups, and how many of them into the wrong one."""
    if not found.situation.groups:
        return None
    true = {
        photograph.image: group for photograph, group in zip(world.photographs, world.groups, strict=True)
    }
    named = [(true[image], i) for i, images in enumerate(found.situation.groups) for image in images]
    as_named = sum(group == i for group, i in named)
    return len(named), min(as_named, len(named) - as_named)


def breach(row: Row) -> str:
    """Which of the rules that hold everywhere a row breaks; empty for none."""
    if row.grade in (Grade.GOOD, Grade.REGION) and (
        row.true_px > FAR_PX or row.true_px > OFTEN * row.predicted_px
    ):
        return "called good"
    if row.grade == Grade.NO and row.true_px < min(NEAR_PX, row.noise_px):
        return "thrown away"
    return ""


def page(rows: Sequence[Row]) -> str:
    """The page that says all of it."""
    of = {scenario.name: [row for row in rows if row.scenario == scenario.name] for scenario in SCENARIOS}
    of = {name: found for name, found in of.items() if found}
    lines = ["# The verdict, measured", "", *_summary(rows, of), "", *_lines(of), ""]
    wrong = [row for row in rows if not row.right or breach(row)]
    lines += ["## What was wrong", ""]
    lines += [
        f"- {row.scenario}, seed {row.seed}: {row.grade}{f' ({row.cause})' if row.cause else ''}, off by {row.true_px:.2f} px, "
        f"predicted {row.predicted_px:.2f}{f'; {breach(row)}' if breach(row) else ''}"
        for row in wrong
    ] or ["Nothing."]
    return "\n".join(lines) + "\n"


def _summary(rows: Sequence[Row], of: dict[str, list[Row]]) -> list[str]:
    """What it is, and the figures over all scenarios."""
    seeds = max(len(found) for found in of.values())
    known = [row for row in rows if np.isfinite(row.true_px) and np.isfinite(row.predicted_px)]
    ratio = np.array([row.predicted_px / row.true_px for row in known])
    breaches = Counter(breach(row) for row in rows)
    agreeing = [
        row for row in rows if _scenario(row).recipe.cameras[0] == "one" and not _scenario(row).recipe.shutter
    ]
    alarms = sum(row.cause == "photographs" for row in agreeing)
    differing = [
        row for row in rows if "photographs" in _scenario(row).causes and len(_scenario(row).causes) == 1
    ]
    found = sum(row.cause == "photographs" for row in differing)
    named = [row for row in rows if row.grouped is not None]
    perfect = [
        row
        for row in rows
        if row.scenario.startswith(("perfect", "no distortion", "rational", "wide lens", "fisheye"))
    ]
    blamed = sum(row.cause in ("photographs", "lens", "target", "views", "corners") for row in perfect)
    return [
        f"Written by `python -m benchmarks.studies.truth_table`: {len(of)} scenarios, {seeds} seeds each, made by cameras that are not",
        "this project's (`benchmarks/studies/projectors.py`), calibrated and evaluated as a user would. What the grades mean, and how",
        "the error is predicted: [verdict.md](../verdict.md).",
        "",
        "| what | found |",
        "|---|---|",
        f"| grade and cause right | {_share(sum(row.right for row in rows), len(rows))} |",
        f"| called good, though off by more than 1 px or three times what was predicted | {_share(breaches['called good'], len(rows))} |",
        f"| thrown away, though off by less than 0.1 px and less than the noise | {_share(breaches['thrown away'], len(rows))} |",
        f"| predicted error over true error, geometric mean | {np.exp(np.log(ratio).mean()):.2f} |",
        f"| true error above twice the predicted one | {_share(int((ratio < 0.5).sum()), len(ratio))} |",
        f"| photographs that agree, said not to | {_share(alarms, len(agreeing))} |",
        f"| photographs that do not agree, found | {_share(found, len(differing))} |",
        f"| groups named with every photograph right | {_share(sum(row.grouped[1] == 0 for row in named if row.grouped), len(named))} |",
        f"| perfect photographs on which anything is blamed | {_share(blamed, len(perfect))} |",
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
        scenario = _scenario(rows[0])
        said = Counter(
            f"{row.grade}{f' ({row.cause})' if row.cause not in ('', REFUSED) else ''}" for row in rows
        )
        told = ", ".join(f"{what} {count}" for what, count in said.most_common())
        due = f"{', '.join(dict.fromkeys(scenario.grades))}; {', '.join(cause or '-' for cause in scenario.causes)}"
        true, predicted = (
            _median([getattr(row, which) for row in rows]) for which in ("true_px", "predicted_px")
        )
        lines.append(
            f"| {name} | {sum(row.right for row in rows)} of {len(rows)} | {told} | {true} | {predicted} | {due} |"
        )
    return lines


def _scenario(row: Row) -> Scenario:
    return next(scenario for scenario in SCENARIOS if scenario.name == row.scenario)


def _share(count: int, of: int) -> str:
    return f"{100.0 * count / max(of, 1):.1f} % ({count} of {of})"


def _median(values: Iterable[float]) -> str:
    known = [value for value in values if np.isfinite(value)]
    return f"{np.median(known):.2f}" if known else "-"


def _read(path: Path) -> list[Row]:
    if not path.exists():
        return []
    rows = [Row(**json.loads(line)) for line in path.read_text().splitlines()]
    return [row._replace(grouped=tuple(row.grouped) if row.grouped else None) for row in rows]  # type: ignore[arg-type]


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
                print(
                    f"{'' if row.right else 'WRONG '}{breach(row)} {row.scenario} {seed}: {row.told}",
                    file=sys.stderr,
                )
    names = {scenario.name for scenario in wanted}
    text = page([row for row in rows if row.scenario in names and row.seed < asked.seeds])
    if asked.only:
        print(text)
    else:
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        PAGE.write_text(text)


if __name__ == "__main__":
    main()
