"""`orthoscope compare`: what it prints, what it writes, what it refuses."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from orthoscope.cli.compare import compare
from orthoscope.evaluation.comparison.entry import USUAL
from orthoscope.fitting.unseen.held_out import USUAL_FOLDS
from orthoscope.formats.own.json import load, load_detections, save

FILES = {"comparison.json", "comparison.html", "comparison.svg"}
THREE = ("--with", "fccm:brown", "--with", "fccm:brown:k1", "--with", "mldc")


def test_it_prints_a_table_the_best_first_and_what_follows(run, calibrated, tmp_path):
    told = run("compare", calibrated / "detections.json", *THREE, "-o", tmp_path)
    assert told.code == 0, told.err
    views, headings, *rows = told.out.splitlines()
    assert views == "views      10 used, 0 set aside; 540 corners; 5 folds held out"
    assert headings.split() == [
        "held",
        "out",
        "(px)",
        "loses",
        "(px)",
        "NCE",
        "used",
        "(px)",
        "parameters",
        "seconds",
        "lens",
        "target",
    ]
    assert rows[0].split()[0] == "fccm:brown"
    assert {row.split()[0] for row in rows[1:3]} == {"fccm:brown:k1", "mldc"}
    assert re.fullmatch(r"fccm:brown +0\.\d+ ± 0\.\d+ +best( +[\d.]+){4} +brown +flat", rows[0])
    assert "verdict    fccm:brown predicts these photographs best" in told.out
    assert re.search(r"The next, (fccm:brown:k1|mldc), loses", told.out)
    assert {path.name for path in tmp_path.iterdir()} == FILES
    assert all(str(tmp_path / name) in rows[-1] for name in FILES)


def test_its_json_has_every_number_of_every_entry_and_is_the_file(run, calibrated, tmp_path):
    told = run("compare", calibrated / "detections.json", *THREE, "--folds", "3", "--json", "-o", tmp_path)
    numbers = json.loads(told.out)
    assert (tmp_path / "comparison.json").read_text() == told.out
    assert load(tmp_path / "comparison.json").detections.corners == 540
    assert (numbers["folds"], len(numbers["detections"]["views"])) == (3, 10)
    best, worse, _ = numbers["standings"]
    assert (best["name"], best["method"], best["settings"], best["lens"]) == (
        "fccm:brown",
        "fccm",
        {"lens": "brown"},
        "brown",
    )
    assert best["loses_px"] == best["loses_error_px"] == 0.0
    assert worse["loses_px"] == pytest.approx(worse["held_out_px"] - best["held_out_px"])
    assert np.sqrt(sum(best["squares"]) / 540) == pytest.approx(best["held_out_px"])
    assert all(best[key] > 0 for key in ("error_px", "nce", "rms_px", "parameters", "seconds"))
    assert "failure" not in best
    assert numbers["conclusions"][0].startswith("fccm:brown predicts")


def test_one_that_cannot_is_told_with_the_reason_and_the_others_are_compared(run, calibrated, tmp_path):
    detections = load_detections(calibrated / "detections.json")
    save(replace(detections, target=replace(detections.target, lines=())), tmp_path / "scattered.json")
    told = run(
        "compare",
        tmp_path / "scattered.json",
        "--with",
        "nmldc",
        "--with",
        "fccm:brown:k1",
        "-o",
        tmp_path / "out",
    )
    assert told.code == 0, told.err
    assert re.search(r"^cannot     nmldc: .*straightness cannot be judged", told.out, re.MULTILINE)
    assert "verdict    fccm:brown:k1 predicts" in told.out
    assert json.loads((tmp_path / "out/comparison.json").read_text())["standings"][1]["held_out_px"] is None


@pytest.mark.slow
def test_the_same_twice_gives_the_same_but_for_the_seconds(run, calibrated, tmp_path):
    for name in ("a", "b"):
        assert run("compare", calibrated / "detections.json", *THREE, "-o", tmp_path / name).code == 0
    first, second = (json.loads((tmp_path / name / "comparison.json").read_text()) for name in ("a", "b"))
    for entry in (*first["standings"], *second["standings"]):
        assert entry.pop("seconds") > 0
    assert first == second
    assert (tmp_path / "a/comparison.svg").read_bytes() == (tmp_path / "b/comparison.svg").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--with", "magic"), "magic"),
        (("--with", "fccm:brown:k9"), "k9"),
        (("--with", "fccm:shape=flat"), "shape"),
        (("--with", "fccm:free"), "free"),
        (("--folds", "1"), "folds"),
    ],
)
def test_a_wrong_command_leaves_with_2_and_writes_nothing(run, calibrated, tmp_path, arguments, word):
    told = run("compare", calibrated / "detections.json", *arguments, "-o", tmp_path / "out")
    assert (told.code, told.out) == (2, "")
    assert word in told.err
    assert not (tmp_path / "out").exists()


def test_too_few_photographs_leave_with_1(run, calibrated, tmp_path):
    save(load_detections(calibrated / "detections.json").only(range(3)), tmp_path / "three.json")
    told = run("compare", tmp_path / "three.json", "--with", "fccm", "-o", tmp_path / "out")
    assert told.code == 1
    assert "expected 4 at least" in told.err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_left_alone_it_compares_every_method_in_two_processes_on_photographs(run, photos, tmp_path):
    told = run(
        "compare",
        photos,
        "--target",
        "chessboard:9x6:25mm",
        "--jobs",
        "2",
        "--folds",
        "2",
        "--json",
        "-o",
        tmp_path,
    )
    assert told.code == 0, told.err
    numbers = json.loads(told.out)
    assert {entry["name"] for entry in numbers["standings"]} == set(USUAL)
    assert all(entry["held_out_px"] for entry in numbers["standings"])


def test_its_folds_are_the_usual_ones():
    assert {option.name: option.default for option in compare.params}["folds"] == USUAL_FOLDS
