"""Of many photographs some stand for all where a calibration is compared with the richest fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.studied import Recipe, found_in, made, photographs_by
from orthoscope.evaluation.evaluate import evaluate
from orthoscope.methods.decoupled import fitters
from orthoscope.methods.decoupled.fits import fits_of
from orthoscope.methods.fccm import fccm

USUAL = Recipe()
MANY = replace(USUAL, standing=replace(USUAL.standing, count=24))
BENT = replace(MANY, shape={"bend": 0.01})
TWO_CAMERAS = replace(MANY, cameras=("other", 0.015))


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitters, "CHOICE_VIEWS", 14)
    monkeypatch.setattr(fitters, "CHOICE_CORNERS", 0)


def test_a_bent_target_taken_for_flat_costs_as_much_by_some_views(monkeypatch: pytest.MonkeyPatch):
    calibration = fccm(photographs_by(BENT, seed=3), lens="brown")
    by_all = evaluate(calibration)
    monkeypatch.setattr(fitters, "CHOICE_VIEWS", 14)
    monkeypatch.setattr(fitters, "CHOICE_CORNERS", 0)
    by_some = evaluate(calibration)
    richest = fits_of(calibration).richest
    assert richest is not None
    assert len(richest.detections.views) == 14
    assert by_all.error is not None
    assert by_some.error is not None
    assert by_all.error.bias_px > 0.1
    # the bias is that of other photographs of the same bent board
    assert_allclose(by_some.error.seen_px, by_all.error.seen_px, rtol=0.3)
    # what views tell of the scatter is told by all of them
    assert_allclose(by_some.error.without_px, by_all.error.without_px)


@pytest.mark.usefixtures("few")
def test_photographs_of_two_cameras_are_all_named():
    world = made(TWO_CAMERAS, 0)
    found = evaluate(fccm(found_in(world), lens="brown"))
    assert found.disagreement.certain
    assert found.groups is not None
    named = np.concatenate([np.array(part, dtype=int) for part in found.groups])
    assert sorted(named) == list(range(24))
