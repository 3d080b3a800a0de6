"""Which candidate is taken: by differences from view to view, in standard errors of these; and what is told
of them.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orthoscope.methods.decoupled.model_selection import (
    Contender,
    first_as_good,
    judged,
    richest_unless_worse,
    simplest_as_good,
)

VIEWS = 20
CORNERS = np.full(VIEWS, 50.0)
for_either_rule = pytest.mark.parametrize("rule", [simplest_as_good, richest_unless_worse])


def contenders(*squares: np.ndarray | float) -> list[Contender]:
    """With these sums of squares, of all views or of each."""
    return [
        Contender(
            "brown", "flat", f"lens {i}", "joint", np.broadcast_to(np.asarray(of_views, dtype=float), VIEWS)
        )
        for i, of_views in enumerate(squares)
    ]


def losing(standard_errors: float) -> np.ndarray:
    """Squares that lose so many standard errors against squares of 10 in each view, by their logarithms."""
    scatter = np.random.default_rng(0).standard_normal(VIEWS)
    scatter = (scatter - scatter.mean()) / scatter.std(ddof=1)
    return 10.0 * np.exp(0.1 * (standard_errors / np.sqrt(VIEWS) + scatter))


def test_the_simplest_within_one_standard_error_of_the_best_is_taken():
    assert simplest_as_good(contenders(losing(0.9), 10.0), CORNERS) == 0
    assert simplest_as_good(contenders(losing(1.1), 10.0), CORNERS) == 1
    assert simplest_as_good(contenders(losing(3.0), losing(0.9), losing(0.5), 10.0), CORNERS) == 1


def test_the_richest_is_taken_unless_it_loses_more_than_two_standard_errors_against_the_best():
    assert richest_unless_worse(contenders(10.0, losing(1.9)), CORNERS) == 1
    assert richest_unless_worse(contenders(10.0, losing(2.1)), CORNERS) == 0
    assert richest_unless_worse(contenders(losing(3.0), 10.0, losing(2.1)), CORNERS) == 1
    assert richest_unless_worse(contenders(10.0, losing(0.5), losing(1.0)), CORNERS) == 2


def test_a_base_that_others_beat_by_next_to_nothing_is_taken_however_sure_that_is():
    steady = np.full(VIEWS, 10.0)  # the same in every view, so any difference is sure
    assert first_as_good(contenders(1.019 * steady, steady), CORNERS) == 0
    assert first_as_good(contenders(1.021 * steady, steady), CORNERS) == 1
    assert first_as_good(contenders(losing(1.9), steady), CORNERS) == 0


@for_either_rule
def test_scatter_that_all_share_does_not_count(rule):
    hard = np.random.default_rng(1).gamma(
        0.5, 100.0, VIEWS
    )  # views differ by far more than the candidates do
    assert rule(contenders(hard * losing(5.0), hard * 10.0), CORNERS) == 1
    assert rule(contenders(hard * 10.0, hard * losing(5.0)), CORNERS) == 0


@for_either_rule
def test_one_view_alone_does_not_decide(rule):
    spoilt, better = np.full(VIEWS, 9.0) * np.linspace(0.95, 1.05, VIEWS), np.full(VIEWS, 10.0)
    spoilt[3] = 150.0  # nearly as much as all the others together
    assert rule(contenders(better, spoilt), CORNERS) == (1 if rule is richest_unless_worse else 0)
    assert first_as_good(contenders(spoilt, better), CORNERS) == 0


@for_either_rule
def test_views_count_by_their_corners(rule):
    corners = np.where(np.arange(VIEWS) < VIEWS // 2, 10.0, 1000.0)
    better_in_large_views = np.where(corners > 100, 0.9, 1.5) * corners
    assert rule(contenders(corners * 1.0, better_in_large_views), corners) == 1


@for_either_rule
def test_one_that_fewer_views_could_judge_takes_no_part(rule):
    missing = np.full(VIEWS, 0.1)
    missing[3] = np.nan
    assert rule(contenders(missing, 10.0), CORNERS) == 1
    assert rule(contenders(10.0, missing), CORNERS) == 0


@for_either_rule
def test_where_no_contender_can_be_judged_by_a_view_the_others_decide(rule):
    worse, better = losing(5.0), np.full(VIEWS, 10.0)
    worse[3] = better[3] = np.nan
    assert rule(contenders(worse, better), CORNERS) == 1
    assert rule(contenders(better, worse), CORNERS) == 0


@for_either_rule
def test_where_nothing_could_be_judged_the_first_is_taken(rule):
    assert rule(contenders(np.nan, np.nan), CORNERS) == 0


def test_where_all_are_equal_each_rule_keeps_its_word():
    assert simplest_as_good(contenders(10.0, 10.0, 10.0), CORNERS) == 0
    assert richest_unless_worse(contenders(10.0, 10.0, 10.0), CORNERS) == 2
    assert simplest_as_good(contenders(0.0, 0.0), CORNERS) == 0


@for_either_rule
@given(st.lists(st.one_of(st.floats(0.0, 10.0), st.just(float("nan"))), min_size=1, max_size=5))
def test_an_index_comes_out_whatever_goes_in(rule, sizes):
    generator = np.random.default_rng(0)
    tried = contenders(*(size * generator.random(VIEWS) for size in sizes))
    taken = rule(tried, CORNERS)
    assert 0 <= taken < len(tried)
    assert np.isfinite(sizes[taken]) or not np.isfinite(sizes).any()


def test_what_is_told_is_the_error_per_point_and_how_much_it_loses():
    one, other, none = judged(contenders(losing(2.0) * 50.0, 500.0, np.nan), CORNERS, 1)
    assert (other.target, other.lens) == ("flat", "lens 1")
    assert other.held_out_px == pytest.approx(np.sqrt(10.0))
    assert other.loses_px == 0.0
    assert one.loses_px == pytest.approx(one.held_out_px - other.held_out_px)
    assert one.loses_px > 0.0
    assert (one.views, none.views) == (VIEWS, 0)
    assert other.standard_error_px == 0.0
    assert one.standard_error_px > 0.0
    assert np.isnan([none.held_out_px, none.standard_error_px, none.loses_px]).all()
