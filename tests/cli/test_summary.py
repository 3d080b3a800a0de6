"""What the verbs print about a calibration."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from orthoscope.cli.shared.summary import evaluation_lines
from orthoscope.evaluation.evaluate import Evaluation, evaluate
from orthoscope.fitting.calibration import Uncertainty
from orthoscope.formats.own.json import text_of
from orthoscope.methods.fccm import fccm
from orthoscope.simulation.scene import paper_scene, simulate_detections
from orthoscope.targets.detections import Outlier

OUTLIERS = tuple(
    Outlier(f"{i:02d}.jpg", corner, (1.0, 2.0), "9.0 px off") for i in range(8) for corner in range(i + 1)
)


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    rng = np.random.default_rng(0)
    return evaluate(fccm(simulate_detections(paper_scene("low", count=6, rng=rng), noise_px=0.1, rng=rng)))


def with_outliers(evaluation: Evaluation, outliers: tuple[Outlier, ...]) -> Evaluation:
    calibration = evaluation.calibration
    return replace(
        evaluation,
        calibration=replace(calibration, detections=replace(calibration.detections, outliers=outliers)),
    )


def test_corners_left_out_are_counted_and_their_photographs_named(evaluation: Evaluation):
    lines = evaluation_lines(with_outliers(evaluation, OUTLIERS), verbose=True)
    told = (
        "outliers   36 corners left out: 00.jpg (1), 01.jpg (2), 02.jpg (3), 03.jpg (4), 04.jpg (5), 05.jpg"
        " (6) and 2 more"
    )
    assert told in lines
    assert "outliers   1 corner left out: 00.jpg (1)" in evaluation_lines(
        with_outliers(evaluation, OUTLIERS[:1]), verbose=True
    )


def test_where_no_corner_is_left_out_nothing_is_said(evaluation: Evaluation):
    lines = evaluation_lines(evaluation, verbose=True)
    assert not [line for line in lines if line.startswith("outliers")]


def test_three_lines_say_what_matters_and_the_verdict_is_the_first(evaluation: Evaluation):
    lines = evaluation_lines(with_outliers(evaluation, OUTLIERS))
    assert [line.split()[0] for line in lines] == ["verdict", "camera", "photos"]
    assert lines[2].endswith("36 corners left out; " + lines[2].split("; ")[-1])
    assert not any(word in line for line in lines for word in ("NCE", "F ", "held out"))


def test_who_wants_every_figure_gets_it(evaluation: Evaluation):
    words = {line.split()[0] for line in evaluation_lines(evaluation, verbose=True)}
    assert {"off", "rms", "held", "NCE", "misfit", "agreement", "lens"} <= words


def test_json_has_the_deviations_that_the_lines_show(evaluation: Evaluation):
    written = json.loads(text_of(evaluation))
    assert written["deviations"] == pytest.approx(evaluation.calibration.uncertainty.deviations)


def test_one_photograph_that_makes_the_held_out_error_is_named(evaluation: Evaluation):
    first, *others = evaluation.views
    views = (
        replace(first, held_out_rms_px=20.0),
        *(replace(view, held_out_rms_px=0.15) for view in others),
    )
    lines = evaluation_lines(replace(evaluation, views=views, held_out_rms_px=8.2))
    assert f"8.2 px where a photograph was not used (0.15 px but for {first.image}" in lines[2]
    assert "but for" not in evaluation_lines(evaluation)[2]


def test_a_method_that_tells_no_deviations_says_so(evaluation: Evaluation):
    silent = replace(evaluation.calibration, uncertainty=Uncertainty((), np.zeros((0, 0))))
    assert "fccm does not tell" in evaluation_lines(replace(evaluation, calibration=silent))[1]
    assert "does not tell" not in evaluation_lines(evaluation)[1]
