"""Settings of a method from the command line, and the paper's corners as files."""

from __future__ import annotations

import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose, assert_array_equal

from orthoscope.cli.shared.method_settings import settings_from
from orthoscope.cli.simulate import simulate
from orthoscope.formats.own.json import load_detections
from orthoscope.geometry.arrays import InputError
from orthoscope.paper.trials import Condition, simulated


def test_settings_are_numbers_truth_values_lists_and_words():
    given = settings_from(
        ["correct=literal", "weights=1,1,1e4", "own_centre=true", "rounds=7", "lens=pfet:a1,a3"]
    )
    assert given == {
        "correct": "literal",
        "weights": [1, 1, 1e4],
        "own_centre": True,
        "rounds": 7,
        "lens": "pfet:a1,a3",
    }


@pytest.mark.parametrize(("texts", "words"), [(["correct"], "not NAME=VALUE"), (["a=1", "a=2"], "twice")])
def test_what_is_no_setting_is_refused(texts, words):
    with pytest.raises(InputError, match=words):
        settings_from(texts)


def test_the_papers_corners_are_those_of_its_first_trial(tmp_path):
    told = CliRunner().invoke(simulate, ["--paper", "low", "--noise", "0.1", "-o", str(tmp_path)])
    assert told.exit_code == 0, told.output
    for name, part in zip(
        ("training", "test"), simulated("low", Condition(0.1), seed=0, trial=0), strict=True
    ):
        read = load_detections(tmp_path / f"{name}.json")
        assert_array_equal(read.views[0].pixels, part.views[0].pixels)
        assert len(read.views) == len(part.views)
    assert (tmp_path / "truth.json").exists()


def test_corrected_points_are_written_as_pairs_and_as_detections(run, calibrated, tmp_path):
    told = run(
        *("calibrate", calibrated / "detections.json", "--method", "mldc", "--set", "correct=nearest"),
        *("--corrected", "--no-report", "-o", tmp_path),
    )
    assert told.code == 0, told.err
    straight, bent = (
        load_detections(tmp_path / "corrected.json"),
        load_detections(tmp_path / "detections.json"),
    )
    rows = (tmp_path / "corrected.csv").read_text().splitlines()
    assert rows[0] == "image,corner,detected_x,detected_y,corrected_x,corrected_y"
    assert len(rows) == 1 + bent.corners
    first = [float(part) for part in rows[1].split(",")[2:]]
    assert_allclose(first, [*bent.views[0].pixels[0], *straight.views[0].pixels[0]], atol=1e-4)
