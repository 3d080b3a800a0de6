"""Boards that look alike both ways up, their corners listed from either end."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.bent_boards import bowed, drawn, photographed_with
from helpers.scenes import NARROW
from orthoscope.fitting import board_order
from orthoscope.fitting.board_order import in_one_order, listed_as_known
from orthoscope.fitting.board_turns import turns_of
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.methods.fccm import fccm, fit_flat
from orthoscope.models.target_shape import TargetShape, without_similarity
from orthoscope.targets.detections import Detections, View, view_name
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target, chessboard, several

ALIKE = {"half a turn": chessboard(8, 6, 0.025), "a quarter": chessboard(7, 7, 0.025)}
for_every_alike = pytest.mark.parametrize("target", ALIKE.values(), ids=ALIKE.keys())


def shape_of(target: Target) -> np.ndarray:
    """Bent to one side more than to the other, and each corner a little off."""
    x = target.points[:, 0] / np.ptp(target.points[:, 0])
    return bowed(1e-3, target) * (1.0 + x)[:, None] + drawn((1e-4, 1e-4, 1e-4), target)


def listed_from_elsewhere(detections: Detections, turns: dict[int, int]) -> Detections:
    """The corners of these views listed by a detector that began at another corner: turns by view."""
    known, views = turns_of(detections.target), list(detections.views)
    for view, turn in turns.items():
        back = np.argsort(known[turn].corners)
        ids = back[views[view].ids]
        order = np.argsort(ids)
        views[view] = View(views[view].image, ids[order], views[view].pixels[order])
    return replace(detections, views=tuple(views))


@for_every_alike
def test_a_turn_brings_every_corner_to_where_another_was(target: Target):
    middle = target.points.mean(0)
    for turn in turns_of(target):
        assert_allclose(
            (target.points - middle) @ turn.rotation.T, target.points[turn.corners] - middle, atol=1e-12
        )


def test_a_board_whose_colours_tell_its_ends_has_no_turns():
    assert len(turns_of(chessboard(9, 6, 0.025))) == 1
    assert len(turns_of(chessboard(9, 7, 0.025))) == 2
    assert len(turns_of(chessboard(7, 7, 0.025))) == 4


@for_every_alike
def test_views_that_were_listed_from_another_end_are_found_and_turned_back(target: Target):
    right = photographed_with(shape_of(target), NARROW, 10, target=target, noise_px=0.1)
    last = len(turns_of(target)) - 1
    wrong = listed_from_elsewhere(right, {1: 1, 4: last, 6: 1, 7: last})
    found, expected = fccm(wrong), fccm(right)
    for view, as_it_was in zip(found.detections.views, right.views, strict=True):
        assert_array_equal(view.ids, as_it_was.ids)
        assert_array_equal(view.pixels, as_it_was.pixels)
    assert found.rms_px == pytest.approx(expected.rms_px, rel=1e-6)  # the poses turned with them
    assert_allclose(found.camera.intrinsics.as_tuple(), expected.camera.intrinsics.as_tuple(), rtol=1e-6)


def test_what_turned_views_give_is_what_consistent_ones_give():
    target = ALIKE["half a turn"]
    right = photographed_with(shape_of(target), NARROW, 8, target=target, noise_px=0.1, seed=2)
    settings: dict[str, Any] = {"shape": "free", "first_lens": "formula", "base": "brown"}
    found = decoupled(listed_from_elsewhere(right, {0: 1, 2: 1, 3: 1}), **settings)
    expected = decoupled(right, **settings)
    assert found.rms_px == pytest.approx(expected.rms_px, rel=1e-4)
    assert found.target_shape.rms == pytest.approx(expected.target_shape.rms, rel=1e-3)


def test_a_view_that_is_foreseen_is_listed_as_the_known_shape_is():
    target = ALIKE["half a turn"]
    right = photographed_with(shape_of(target), NARROW, 6, target=target, noise_px=0.1, seed=2)
    known = TargetShape("free", without_similarity(target.points, shape_of(target), np.ones(48, dtype=bool)))
    wrong = listed_from_elsewhere(right, {1: 1, 4: 1})
    for view, as_it_was, as_it_came in zip(
        listed_as_known(NARROW, wrong, known).views, right.views, wrong.views, strict=True
    ):
        assert_array_equal(view.pixels, as_it_came.pixels)  # row by row
        order = np.argsort(view.ids)
        assert_array_equal(view.pixels[order], as_it_was.pixels)
    assert listed_as_known(NARROW, wrong, TargetShape.flat(48)) is wrong


@for_every_alike
@pytest.mark.parametrize("seed", range(4))
def test_a_perfect_board_has_no_end_that_anyone_could_tell_and_is_left_as_it_is(target: Target, seed: int):
    flat = fit_flat(
        photographed_with(0.0 * shape_of(target), NARROW, 8, target=target, noise_px=0.2, seed=seed)
    )
    assert in_one_order(flat) is flat


@for_every_alike
@pytest.mark.parametrize("views", [10, 16])
def test_a_quick_look_never_hides_a_gain_that_is_sure(
    target: Target, views: int, monkeypatch: pytest.MonkeyPatch
):
    for seed in range(3):
        seen = photographed_with(
            0.3 * shape_of(target), NARROW, views, target=target, noise_px=0.1, seed=seed
        )
        flat = fit_flat(listed_from_elsewhere(seen, {1: 1, 4: 1, 7: 1}), lens="brown")
        looked = in_one_order(flat)
        with monkeypatch.context() as without:
            without.setattr(board_order, "QUICK_LOOK_VIEWS", 100)
            asked = in_one_order(flat)
        assert (looked is flat) == (asked is flat)
        for one, other in zip(looked.detections.views, asked.detections.views, strict=True):
            assert_array_equal(one.ids, other.ids)


def test_many_views_of_which_few_are_turned_are_put_in_order():
    target = ALIKE["half a turn"]
    right = photographed_with(shape_of(target), NARROW, 70, target=target, noise_px=0.1, seed=5)
    found = in_one_order(fit_flat(listed_from_elsewhere(right, {3: 1, 40: 1}), lens="brown"))
    for view, as_it_was in zip(found.detections.views, right.views, strict=True):
        assert_array_equal(view.ids, as_it_was.ids)


def together(*parts: Detections) -> Detections:
    """Views of several targets in the same photographs."""
    target = several([part.target for part in parts])
    views = [
        View(view_name(f"{photograph}", number), parts[number].views[photograph].ids + first, view.pixels)
        for photograph in range(len(parts[0].views))
        for number, (first, view) in enumerate(
            zip((part.start for part in target.parts), (one.views[photograph] for one in parts), strict=True)
        )
    ]
    return Detections(target, parts[0].image_size, tuple(views))


def test_each_of_several_boards_is_listed_from_one_end_of_its_own():
    boards = chessboard(8, 6, 0.025), parse_target("circles:4x8:20mm:asymmetric"), chessboard(9, 6, 0.02)
    right = [
        photographed_with(shape_of(board), NARROW, 8, target=board, noise_px=0.1, seed=seed)
        for seed, board in enumerate(boards)
    ]
    wrong = [
        listed_from_elsewhere(right[0], {1: 1, 4: 1, 6: 1}),
        listed_from_elsewhere(right[1], {0: 1, 4: 1}),
        right[2],
    ]
    flat, expected = (fit_flat(together(*parts), lens="brown") for parts in (wrong, right))
    found = in_one_order(flat)
    for view, as_it_was in zip(found.detections.views, expected.detections.views, strict=True):
        assert_array_equal(view.ids, as_it_was.ids)
    points, camera = found.detections.target.points, found.camera
    for view, pose in zip(found.detections.views, found.camera_from_target, strict=True):
        misses = camera.project(pose.apply(points))[view.ids] - view.pixels
        assert np.sqrt((misses**2).sum(1).mean()) < 3.0 * flat.rms_px  # each pose has turned with its view

    shape = np.concatenate([shape_of(board) for board in boards])
    seen = np.ones(len(shape), dtype=bool)
    parts = found.detections.target.parts
    known = TargetShape("free", without_similarity(points, shape, seen, parts=parts))
    again = listed_as_known(NARROW, together(*wrong), known)
    for view, as_it_was in zip(again.views, together(*right).views, strict=True):
        assert_array_equal(np.sort(view.ids), as_it_was.ids)
        assert_array_equal(view.pixels[np.argsort(view.ids)], as_it_was.pixels)
