"""No corner is given out where none is: small slanted boards, and boards of which something covers a part."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.quick import first_quick
from orthoscope.detection.chessboards.grid import lattice
from orthoscope.detection.saddles.contradicted import are_contradicted
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer
from orthoscope.targets.table import parse_target

CAMERA = Camera((640, 480), Intrinsics(560.0, 559.0, 323.0, 237.0), Brown(k1=-0.22, k2=0.06))


def off(target, pose: Pose, sight: Sight) -> np.ndarray:
    """How far each corner is from where its id is, px, in the best of the ways in which the board looks the
    same.
    """
    truth = CAMERA.project(pose.apply(target.points))
    ways = [np.arange(len(truth)), *target.symmetries()]
    return min((np.hypot(*(truth[way[sight.ids]] - sight.pixels).T) for way in ways), key=np.median)


@pytest.mark.parametrize(
    ("spec", "turn", "shift", "blur"),
    [
        ("chessboard:14x9:20mm", (-0.0522, 1.0792, -0.5352), (-0.1026, 0.0105, 1.143), 0.7),
        ("marked:9x6:25mm:DICT_4X4_50:18mm", (-0.0048, 1.0297, 0.9294), (0.0032, -0.1053, 1.5996), 0.3),
    ],
)
def test_links_that_leap_over_a_slanted_square_do_not_number_its_corners(spec, turn, shift, blur):
    target, pose = parse_target(spec), Pose(rotation_from_vector(np.array(turn)), np.array(shift))
    picture = Renderer(CAMERA, blur_px=blur, noise=0.5).photograph(target, pose, rng=np.random.default_rng(0))
    sight = see(picture, target)
    assert isinstance(sight, Sight)
    assert len(sight.ids) > 0.9 * len(target.points)
    assert off(target, pose, sight).max() < 0.5  # they were 40 to 80 px off


@pytest.mark.parametrize("seed", first_quick([233, 22, 111, 319]))
def test_an_edge_of_something_that_covers_a_part_is_not_taken_for_a_corner(seed):
    target, rng = parse_target("chessboard:8x6:25mm"), np.random.default_rng(seed)
    pose = Pose(rotation_from_vector(np.array([0.1, 0.2, 0.3])), np.array([-0.09, -0.08, 0.9]))
    plain = Renderer(CAMERA, blur_px=1.0, noise=0.0).photograph(target, pose, rng=np.random.default_rng(0))
    corner = CAMERA.project(pose.apply(target.points))[rng.integers(48)]
    away, axes, turn, grey = (
        rng.normal(0.0, 8.0, 2),
        rng.uniform(5.0, 20.0, 2),
        float(rng.uniform(0.0, 180.0)),
        float(rng.uniform(30.0, 200.0)),
    )
    middle, axes = ((16 * one).astype(int).tolist() for one in (corner + away, axes))
    mask = np.zeros(plain.shape, np.float32)
    cv2.ellipse(mask, middle, axes, turn, 0, 360, 1.0, -1, shift=4)
    mask = cv2.GaussianBlur(mask, (0, 0), 1.0)
    covered = plain * (1.0 - mask) + grey * mask + rng.normal(0.0, 3.0, plain.shape)
    sight = see(np.clip(covered, 0, 255).astype(np.uint8), target)
    assert isinstance(sight, Sight)
    assert len(sight.ids) > 36
    assert off(target, pose, sight).max() < 0.8  # one was 1.2 to 1.9 px off


def bent_board(noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a board 30 px a square, seen by a lens that bends its sides by 6 px, and their cells."""
    cells = lattice(9, 6).astype(int)
    pixels = 30.0 * cells + 40.0
    away = pixels - pixels.mean(0)
    bent = pixels - away * 3e-6 * (away**2).sum(1, keepdims=True)
    return bent + np.random.default_rng(0).normal(0.0, noise, bent.shape), cells


def told(pixels, cells, spread, *, doubtful=()):
    doubt = np.isin(np.arange(len(pixels)), doubtful)
    spreads = np.full(len(pixels), spread)
    off = are_contradicted(pixels, cells, (9, 6), (400, 300), spread=spreads, doubtful=doubt)
    return np.flatnonzero(off).tolist()


@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_a_corner_is_contradicted_where_its_window_or_what_is_beside_it_is_doubtful(noise):
    pixels, cells = bent_board(noise)
    assert told(pixels, cells, noise) == []
    moved = pixels.copy()
    moved[22] += (0.8, -0.8)
    assert told(moved, cells, noise, doubtful=[22]) == [22]
    beside = np.arange(len(pixels)) != 23
    assert told(moved[beside], cells[beside], noise) == [22]


def test_what_a_board_bends_at_its_corner_is_not_contradicted():
    pixels, cells = bent_board(0.01)
    pixels[0] += 0.6
    assert told(pixels, cells, 0.01) == []
    assert_allclose(told(pixels, cells, 0.01, doubtful=[0]), [0])


def test_of_a_few_corners_none_is_contradicted():
    pixels, cells = bent_board(0.01)
    few = cells.max(1) < 3
    assert told(pixels[few][:7], cells[few][:7], 0.01, doubtful=range(7)) == []
