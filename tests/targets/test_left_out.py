"""Photographs that are left out by name."""

from __future__ import annotations

import numpy as np
import pytest

from orthoscope.geometry.arrays import InputError
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.left_out import LEFT_OUT_REASON, left_out
from orthoscope.targets.target import chessboard

CORNERS = np.arange(4), np.arange(8.0).reshape(4, 2)
FOUND = Detections(
    chessboard(4, 3, 0.025),
    (640, 480),
    tuple(View(name, *CORNERS) for name in ("a/1.png", "b/1.png", "2.png")),
)


def test_what_is_left_out_is_set_aside_and_the_others_keep_their_order():
    kept = left_out(FOUND, ["a/1.png"])
    assert [view.image for view in kept.views] == ["b/1.png", "2.png"]
    assert kept.set_aside == (("a/1.png", LEFT_OUT_REASON),)


def test_a_files_name_is_enough_where_it_is_the_only_such_one():
    assert [view.image for view in left_out(FOUND, ["photos/2.png", "2.png"]).views] == ["a/1.png", "b/1.png"]
    with pytest.raises(InputError, match=r"no single photograph; expected one such as a/1\.png, b/1\.png"):
        left_out(FOUND, ["1.png"])


def test_a_photograph_that_is_not_there_is_an_error_that_names_some_that_are():
    with pytest.raises(
        InputError, match=r"'3\.png' names no single photograph; expected one such as a/1\.png"
    ):
        left_out(FOUND, ["3.png"])


def test_what_was_set_aside_already_may_be_named():
    assert len(left_out(left_out(FOUND, ["2.png"]), ["2.png"]).views) == 2


def test_something_must_be_left():
    with pytest.raises(InputError, match="leaves no photograph"):
        left_out(FOUND, [view.image for view in FOUND.views])
