"""Evaluations and comparisons as files: whole, exact, and of the very calibration that they judge."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orthoscope.evaluation.comparison.compare import Comparison, Standing, compare
from orthoscope.evaluation.evaluate import Evaluation, evaluate
from orthoscope.formats.own.json import load, load_evaluation, save, text_of
from orthoscope.geometry.arrays import InputError
from orthoscope.methods.fccm import fccm
from orthoscope.simulation.scene import paper_scene, simulate_detections
from orthoscope.targets.detections import Detections


@pytest.fixture(scope="module")
def detections() -> Detections:
    rng = np.random.default_rng(0)
    return simulate_detections(paper_scene("low", count=6, rng=rng), noise_px=0.1, rng=rng)


@pytest.fixture(scope="module")
def evaluation(detections: Detections) -> Evaluation:
    """With a view that was not held out, a suspect and a number that does not exist."""
    found = evaluate(fccm(detections, lens="brown:k1,k2"))
    unseen = (np.full_like(found.held_out_residuals[0], np.nan), *found.held_out_residuals[1:])
    views = (replace(found.views[0], held_out_rms_px=np.nan), *found.views[1:])
    suspects = ((found.views[2].image, "0.90 px rms where a typical view has 0.12"),)
    return replace(found, held_out_residuals=unseen, views=views, suspects=suspects, nce=float("nan"))


@pytest.fixture(scope="module")
def comparison(detections: Detections) -> Comparison:
    found = compare(detections, ["fccm:brown:k1", "fccm:brown:k1,k2"], folds=3)
    unable = Standing(found.standings[0].entry, np.full(6, np.nan), failure="three views are parallel")
    return replace(found, standings=(*found.standings, unable))


def assert_same(a: Any, b: Any) -> None:
    """Equal to the last bit, NaN equal to NaN, field by field."""
    assert type(a) is type(b)
    if is_dataclass(a):
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name))
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            assert_same(one, other)
    elif isinstance(a, np.ndarray | float):
        np.testing.assert_array_equal(a, b)
    else:
        assert a == b


def test_an_evaluation_comes_back_to_the_last_bit_with_the_calibration_beside_it(evaluation, tmp_path):
    save(evaluation.calibration, tmp_path / "calibration.json")
    save(evaluation, tmp_path / "evaluation.json")
    found = load_evaluation(tmp_path / "evaluation.json")
    assert_same(replace(found, calibration=evaluation.calibration), evaluation)
    assert_same(found.calibration.camera.intrinsics, evaluation.calibration.camera.intrinsics)


def test_every_field_of_an_evaluation_is_in_its_file(evaluation):
    told = json.loads(text_of(evaluation))
    spread = {"calibration": "camera", "misfit": "target_misfit"}  # what is written in another way
    assert {spread.get(field.name, field.name) for field in fields(Evaluation)} <= set(told)


def test_it_is_written_without_the_calibration_and_read_with_one_that_is_handed_in(evaluation, tmp_path):
    save(evaluation, tmp_path / "apart.json")
    assert_same(load_evaluation(tmp_path / "apart.json", evaluation.calibration), evaluation)
    with pytest.raises(InputError, match=r"calibration\.json does not exist"):
        load(tmp_path / "apart.json")


def test_an_evaluation_of_another_calibration_is_refused(evaluation, detections, tmp_path):
    save(evaluation, tmp_path / "evaluation.json")
    save(fccm(detections, lens="brown:k1"), tmp_path / "calibration.json")
    with pytest.raises(InputError, match="judges another camera"):
        load_evaluation(tmp_path / "evaluation.json")
    fewer = replace(
        evaluation.calibration,
        detections=evaluation.calibration.detections.only(range(5)),
        camera_from_target=evaluation.calibration.camera_from_target[:5],
    )
    with pytest.raises(InputError, match="judges another camera"):
        load_evaluation(tmp_path / "evaluation.json", fewer)


def test_a_calibration_is_no_evaluation(evaluation, tmp_path):
    save(evaluation.calibration, tmp_path / "calibration.json")
    with pytest.raises(InputError, match="holds a calibration; expected an evaluation"):
        load_evaluation(tmp_path / "calibration.json")


def test_a_comparison_comes_back_to_the_last_bit(comparison, tmp_path):
    save(comparison, tmp_path / "comparison.json")
    found = load(tmp_path / "comparison.json")
    assert_same(found.standings[-1], comparison.standings[-1])
    assert text_of(found) == text_of(comparison)
    for a, b in zip(found.standings, comparison.standings, strict=True):
        assert_same(replace(a, camera=None), replace(b, camera=None))
        assert (a.camera is None) == (b.camera is None)


@pytest.mark.parametrize("change", [{"held_out_residuals": [[[0.0]]]}, {"rms_px": "small"}, {"odd": 1}])
def test_what_cannot_be_is_refused_with_the_files_name(evaluation, tmp_path: Path, change):
    save(evaluation.calibration, tmp_path / "calibration.json")
    told = {**json.loads(text_of(evaluation)), **change}
    (tmp_path / "evaluation.json").write_text(json.dumps(told))
    with pytest.raises(InputError, match=r"evaluation\.json does not hold proper evaluation data"):
        load(tmp_path / "evaluation.json")
