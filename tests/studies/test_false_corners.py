"""Rendered photographs of every kind of target, good and poor ones: no corner is where none is."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.studies.false_corners import BOARDS, FALSE_PX, OTHER_BOARDS, errors_of, photographs

from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see


def check(seed: int, number: int, *, least: float, off: float, boards: tuple[str, ...] = BOARDS) -> None:
    """In one of these photographs so many corners are found at least, and all of them off by less, px."""
    (shown,) = photographs(1, seed=seed, first=number, boards=boards)
    sight = see(shown.picture, shown.target)
    assert isinstance(sight, Sight)
    assert np.isfinite(sight.pixels).all()
    assert len(sight.ids) >= (least if least > 1 else least * len(shown.truth))
    assert errors_of(shown, sight).max() < off


@pytest.mark.slow  # rare faults need many photographs
def test_no_corner_is_a_pixel_from_where_its_id_is():
    count, found = 120, 0
    for shown in photographs(count, seed=20):
        sight = see(shown.picture, shown.target)
        if isinstance(sight, Sight):
            found += 1
            assert errors_of(shown, sight).max() < FALSE_PX, (shown.number, shown.target.name, shown.told)
    assert found > 0.6 * count  # poor photographs of small markers show nothing


def test_a_hidden_corner_is_not_leapt_over():
    """A steep board whose marker hides corners of its square was numbered as if they were not there."""
    check(0, 112, least=54 - 4, off=0.1)  # those beside the marker are not sure


@pytest.mark.parametrize("number", [1064, 3633], ids=["blur", "covered"])
def test_a_corner_that_blur_or_a_cover_moves_is_not_given_out(number):
    """A tag's corner in a window no wider than the blur; one cut off by something nearly white."""
    check(9, number, least=26, off=0.5)


@pytest.mark.parametrize(("seed", "number"), [(9, 8963), (10, 5939)])
def test_a_disc_whose_fit_failed_is_not_given_out(seed, number):
    """Small discs that fell out of the last of several fits were given out without a place."""
    check(seed, number, least=0.6, off=FALSE_PX)


def test_lines_that_leap_by_a_knight_s_move_are_parted():
    """A small slanted board's lattice leapt by two squares and one to the side, as wide as the board."""
    check(11, 1262, least=30, off=0.5)


def test_lines_that_kink_are_parted_where_blur_hides_what_is_between_them():
    """All ids were a column on: squares as wide as the blur did not tell that the first was none."""
    check(37, 313, least=6, off=0.5)


@pytest.mark.parametrize(("seed", "number"), [(47, 1813), (53, 3673), (47, 2985)])
def test_a_corner_beside_what_covers_others_is_not_believed_as_they_are(seed, number):
    """Its neighbours, or its marker's other corners, were seen to be covered; it was 1 to 1.6 px off."""
    check(seed, number, least=28, off=0.7)


def test_lines_too_many_do_not_make_a_wrong_way_the_only_one_on_the_board():
    """A lattice that went on for two lines beyond a ChArUco board lay on it only a column on."""
    check(43, 954, least=50, off=FALSE_PX)


def test_a_marker_s_bend_arrives_where_a_fisheye_bends_most():
    """A bend that was begun anew with each step arrived nowhere, and a corner was 1.1 px off."""
    check(17, 1869, least=73, off=0.5)


@pytest.mark.parametrize(
    ("boards", "seed", "number", "least"),
    [(OTHER_BOARDS, 1, 1160, 13), (OTHER_BOARDS, 1, 7088, 50), (BOARDS, 59, 2108, 48)],
    ids=["beside a cover", "small", "at the rim"],
)
def test_a_tag_s_corner_is_not_taken_for_the_one_across_the_gap(boards, seed, number, least):
    """Gaps of 4 px: up to three corners next to each other were the next tags'."""
    check(seed, number, least=least, off=0.5, boards=boards)


def test_marks_that_blur_hides_do_not_turn_a_board_into_its_negative():
    """Discs of two pixels counted as missing, and the negative, whose discs were outside, was taken."""
    check(14, 1155, least=60, off=0.5)
