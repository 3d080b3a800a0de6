"""A method of one's own stands in the paper's figures like any other; parts of section 4 run alone."""

from __future__ import annotations

import csv
import io
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from orthoscope.cli.paper import paper
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import InputError
from orthoscope.methods import calibrate
from orthoscope.paper.claims.in_figures import EXHIBITS, FIG6
from orthoscope.paper.documents import documents
from orthoscope.paper.entries import PAPER, PaperEntry, own_entry
from orthoscope.paper.section4 import PARTS, Plan, run
from orthoscope.paper.trials import Condition, simulated_trial, trial_judged
from orthoscope.targets.detections import Detections

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_method.py"
FEW = Plan.quick(trials=1, points=((3, 4),))


def three_coefficients(detections: Detections) -> Calibration:
    return calibrate(detections, method="fccm", lens="brown:k1,k2,k3")


def broken(detections: Detections) -> Calibration:
    raise ZeroDivisionError("a matrix of mine")


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_a_function_and_a_method_with_settings_are_named_by_with():
    mine = own_entry("json:dumps")
    assert (mine.name, mine.called) == ("dumps", "dumps")
    assert own_entry("mine=json:dumps").name == "mine"
    ours = own_entry("fccm:brown:k1,k2,k3")
    assert (ours.name, ours.method, ours.settings) == (
        "fccm:brown:k1,k2,k3",
        "fccm",
        {"lens": "brown:k1,k2,k3"},
    )
    assert own_entry("huber=fccm:loss=huber").settings == {"loss": "huber"}


@pytest.mark.parametrize(
    "text", ["nowhere.at_all:f", "json:no_such", "json", "json:__name__", "fccm:nolens", "=fccm:brown", ""]
)
def test_what_is_no_method_is_refused(text):
    with pytest.raises(InputError):
        own_entry(text)


def test_what_a_function_of_ones_own_raises_is_an_outcome_with_its_kind():
    data = simulated_trial("low", Condition(subgrid=(3, 4)), seed=0, trial=0)
    assert trial_judged(PaperEntry("b", broken, {}), data).failure == "ZeroDivisionError: a matrix of mine"
    with pytest.raises(InputError):  # but a wrong setting of ours is a wrong command
        trial_judged(PAPER[0]._replace(settings={"lens": "none"}), data)


@pytest.mark.slow
def test_one_figure_alone_has_its_own_file_and_ones_own_method_in_it():
    plan = replace(FEW, only=("fig4",), own=(PaperEntry("mine", three_coefficients, {}),))
    made = documents(run(plan))
    assert set(made.texts) == {"paper.html", "fig4.csv", "methods.csv", "trials.csv"}
    assert [row["trials"] for row in rows_of(made.texts["fig4.csv"]) if row["method"] == "mine"] == ["1"]
    row = next(row for row in rows_of(made.texts["trials.csv"]) if row["method"] == "FCCM")
    assert (row["settings"], row["seed"]) == ("lens=brown:k1,k2", "0")
    assert float(row["centre_x"]) == float(row["cx"])
    assert "k1=" in row["lens"]


def test_every_figure_is_a_part_and_the_command_s_help_names_all_parts():
    assert {kind.name for kind in (*EXHIBITS, FIG6)} <= set(PARTS)
    for kind in EXHIBITS:
        assert (kind.study, kind.scene) == (PARTS[kind.name].study, *PARTS[kind.name].scenes)
    told = next(option for option in paper.params if option.name == "only").help
    assert told
    for name in set(PARTS) - {f"fig{number}" for number in range(1, 8)}:
        assert name in told


@pytest.mark.parametrize(
    "changes",
    [
        {"only": ("fig9",)},
        {"noise_px": ()},
        {"noise_px": (-1.0,)},
        {"points": ((2, 4),)},
        {"own": (PAPER[0],)},
    ],
)
def test_a_plan_that_makes_no_sense_is_refused(changes):
    with pytest.raises(InputError):
        replace(FEW, **changes)


def test_parts_on_photographs_need_photographs():
    with pytest.raises(InputError, match="need photographs"):
        run(replace(FEW, only=("fig6", "table1")))


def test_tilt_and_fill_are_those_of_the_simulated_views():
    flat = simulated_trial("low", Condition(tilt=(0.0, 0.05), fill=(0.4, 0.5)), seed=0, trial=0)
    width = max(float(view.pixels[:, 0].max() - view.pixels[:, 0].min()) for view in flat.training.views)
    height = max(float(view.pixels[:, 1].max() - view.pixels[:, 1].min()) for view in flat.training.views)
    assert max(width / 640, height / 480) < 0.51
    tilts = [pose.rotation[2, 2] for pose in flat.test_poses]
    assert min(map(abs, tilts)) > 0.9  # the line of sight leans by half the field of view


def test_levels_that_cannot_be_read_are_a_wrong_command(tmp_path):
    for option, text in (("--noise", "much"), ("--points", "3by4")):
        told = CliRunner().invoke(paper, [option, text, "-o", str(tmp_path / "out")])
        assert told.exit_code == 2
        assert text in told.output


@pytest.mark.slow
def test_the_example_puts_opencv_into_figure_4_in_processes(tmp_path):
    """Two processes start and compute: three seconds."""
    command = [sys.executable, str(EXAMPLE), "--quick", "--out", str(tmp_path)]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    nce = {row["method"]: float(row["test_nce"]) for row in rows_of((tmp_path / "fig4.csv").read_text())}
    assert nce["OpenCV"] == pytest.approx(nce["FCCM 5 parameters"], rel=0.01)  # the same problem
