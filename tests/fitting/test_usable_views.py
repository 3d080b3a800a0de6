"""Screening: views that tell nothing, or tell it twice, are set aside and say why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.scenes import BOARD, NARROW, photographed, some_corners
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.targets.detections import Detections, SetAside, View

GOOD = photographed(NARROW, 3)
ROW = np.arange(9)  # the first row of the board


def with_first(ids: np.ndarray, pixels: np.ndarray | None = None) -> Detections:
    """GOOD, its first view with these corners only (or elsewhere)."""
    view = GOOD.views[0]
    first = View("odd.jpg", ids, view.pixels[ids] if pixels is None else pixels)
    return replace(GOOD, views=(first, *GOOD.views[1:]))


@pytest.mark.parametrize(
    ("detections", "reason"),
    [
        (with_first(np.array([], dtype=np.int64), np.empty((0, 2))), "0 corners; a view needs 4"),
        (with_first(np.array([0, 8, 45])), "3 corners; a view needs 4"),
        (with_first(ROW), "all its corners are on one line of the target"),
        (with_first(np.arange(0, 54, 10)), "all its corners are on one line of the target"),
        (with_first(np.append(ROW, 9)), "all its corners but one are on one line of the target"),
        (with_first(np.array([20, 0, 1, 2])), "all its corners but one are on one line of the target"),
        (
            with_first(np.arange(54), np.tile([100.0, 200.0], (54, 1))),
            "all its corners are on one line in the image",
        ),
        (
            with_first(np.arange(54), np.outer(np.arange(54), [3.0, 7.0])),
            "all its corners are on one line in the image",
        ),
        (
            replace(GOOD, views=(*GOOD.views, replace(GOOD.views[1], image="odd.jpg"))),
            "the same corners as view02",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_view_that_tells_nothing_is_set_aside_with_the_reason(detections: Detections, reason: str):
    used = with_usable_views(detections)
    assert [entry.image for entry in used.set_aside] == ["odd.jpg"]
    assert used.set_aside[0].reason.startswith(reason)
    assert "odd.jpg" not in [view.image for view in used.views]


def test_four_corners_no_three_on_a_line_are_enough():
    assert len(with_usable_views(with_first(np.array([0, 8, 45, 53]))).views) == 3


def test_good_views_stay_as_they_are_and_earlier_reasons_are_kept():
    used = with_usable_views(replace(GOOD, set_aside=(SetAside("dark.jpg", "no board"),)))
    assert used.views == GOOD.views
    assert used.set_aside == (SetAside("dark.jpg", "no board"),)


@given(st.lists(st.integers(0, 53), min_size=4, max_size=8, unique=True))
def test_a_view_stays_exactly_if_four_of_its_corners_have_no_three_on_a_line(ids: list[int]):
    points = BOARD.points[ids, :2]
    triples = [(i, j, k) for i in range(len(ids)) for j in range(i) for k in range(j)]
    on_a_line = {
        frozenset(t)
        for t in triples
        if abs(np.linalg.det(np.column_stack([points[list(t)], np.ones(3)]))) < 1e-12
    }
    quads = [(i, j, k, m) for i, j, k in triples for m in range(k)]
    wanted = any(not any(on <= set(quad) for on in on_a_line) for quad in quads)
    kept = len(with_usable_views(with_first(np.array(ids))).views) == 3
    assert kept == wanted


def test_partial_boards_stay():
    assert len(with_usable_views(some_corners(photographed(NARROW, 10), (0.3, 0.6))).views) == 10


def test_where_no_view_is_left_it_says_so_and_why():
    with pytest.raises(
        CalibrationError,
        match=r"no view of chessboard:9x6:25mm can be used.*\n  odd.jpg: 3 corners; a view needs 4",
    ):
        with_usable_views(with_first(np.array([0, 8, 45])).only([0]))
