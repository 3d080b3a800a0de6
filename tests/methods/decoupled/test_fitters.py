"""Fits that are compared and fits that are kept, and the views that stand for many."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.bent_boards import bowed, photographed_with
from helpers.scenes import NARROW
from orthoscope.methods.decoupled import fitters
from orthoscope.methods.decoupled.candidates import Candidates, Model
from orthoscope.methods.decoupled.fitters import Compared, Kept
from orthoscope.methods.decoupled.representative import representative
from orthoscope.targets.detections import Detections

RICHEST, PLAIN = Model("brown", "free", "free"), Model("brown", "smooth", "formula")


@pytest.fixture(scope="module")
def photographs() -> Detections:
    return photographed_with(bowed(0.5e-3), NARROW, 12, noise_px=0.1, seed=3)


def test_what_is_compared_foresees_as_what_is_kept(photographs: Detections):
    compared = Candidates(photographs, skew=False, fitter=Compared(photographs, skew=False))
    kept = Candidates(photographs, skew=False)
    for model in (RICHEST, PLAIN):
        ours, theirs = (np.sqrt(one.contender(model).squares) for one in (compared, kept))
        assert_allclose(ours, theirs, rtol=5e-3)  # weights that were found from another start


def test_what_is_kept_is_the_same_whatever_it_was_compared_with(photographs: Detections):
    compared = Compared(photographs, skew=False)
    for model in (RICHEST, PLAIN):
        compared.step_one(model)
    for model in (RICHEST, PLAIN):
        ours = Kept(photographs, skew=False, compared=compared).step_one(model)
        alone = Kept(photographs, skew=False).step_one(model)
        assert ours.estimate.camera.intrinsics.as_tuple() == alone.estimate.camera.intrinsics.as_tuple()


def test_many_views_are_fitted_by_way_of_some(photographs: Detections, monkeypatch: pytest.MonkeyPatch):
    straight = Kept(photographs, skew=False).step_one(RICHEST)
    monkeypatch.setattr(fitters, "CHOICE_VIEWS", 8)
    monkeypatch.setattr(fitters, "CHOICE_CORNERS", 0)
    some_first = Kept(photographs, skew=False).step_one(RICHEST)
    assert some_first.views == 12
    deviations = np.sqrt(np.diag(straight.covariance))
    apart = np.abs(
        np.array(some_first.estimate.camera.intrinsics.as_tuple()[:4])
        - straight.estimate.camera.intrinsics.as_tuple()[:4]
    )
    # Weights are found in a few rounds, and these had those of the eight views before them.
    assert (apart < 0.1 * deviations[:4]).all()


def test_views_that_stand_for_all_do_not_depend_on_their_order(photographs: Detections):
    shuffled = photographs.only(np.random.default_rng(0).permutation(12))
    ours, theirs = (
        {view.image for view in representative(some, 5).views} for some in (photographs, shuffled)
    )
    assert len(ours) == 5
    assert ours == theirs


def test_a_view_unlike_all_others_is_among_those_that_stand_for_all():
    many = photographed_with(bowed(0.0), NARROW, 30, noise_px=0.1, seed=1)
    middles = np.array([view.pixels.mean(0) for view in many.views])
    apart = np.hypot(*(middles - middles.mean(0)).T)
    taken = {view.image for view in representative(many, 12).views}
    assert many.views[int(apart.argmax())].image in taken
    assert representative(many, 30) is many
    assert_array_equal([len(view.ids) for view in many.views], len(many.target.points))
