"""A corner that is off where all others foresee it is told from noise and from what a lens bends."""

from __future__ import annotations

import numpy as np
import pytest

from orthoscope.detection.markers.foreseen import are_off
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt

ROW, COLUMN = np.mgrid[:7, :9].reshape(2, -1).astype(float)
PLACES = np.stack([COLUMN, ROW], axis=1)
LENSES = {"brown": (560.0, Brown(k1=-0.3, k2=0.1)), "fisheye": (200.0, KannalaBrandt(k1=-0.03))}
DISTANCES = {"brown": 0.7, "fisheye": 0.5}  # the fisheye sees the board over 80 degrees


def board_by(lens: str, noise: float) -> np.ndarray:
    """The corners of a tilted board."""
    focal, bends = LENSES[lens]
    camera = Camera((640, 480), Intrinsics(focal, focal, 320.0, 240.0), bends)
    x, y = 0.1 * (PLACES - [4.0, 3.0]).T
    points = np.stack([x, y, DISTANCES[lens] + 0.2 * x], axis=1)
    return camera.project(points) + np.random.default_rng(0).normal(0.0, noise, PLACES.shape)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_no_corner_is_off_because_a_lens_bends_the_board(lens, noise):
    assert not are_off(board_by(lens, noise), PLACES, (480, 640)).any()


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("corner", [30, 4, 62], ids=["inside", "side", "corner"])
def test_a_corner_that_was_mistaken_is_off_and_no_other(lens, corner):
    pixels = board_by(lens, 0.05)
    pixels[corner] += [8.0, -5.0]
    np.testing.assert_array_equal(np.flatnonzero(are_off(pixels, PLACES, (480, 640))), [corner])


def test_a_doubtful_corner_beside_one_row_and_one_column_is_not_foreseen_and_goes():
    seen = (COLUMN == 8) | (ROW == 6) | ((COLUMN == 7) & (ROW == 5))
    pixels, alone = board_by("brown", 0.05), 7 + 9 * 5
    pixels[alone] += [4.0, 3.0]
    for doubtful in (False, True):
        off = are_off(pixels[seen], PLACES[seen], (480, 640), doubtful=np.full(int(seen.sum()), doubtful))
        assert off[np.flatnonzero(seen) == alone] == doubtful
        assert off.sum() == doubtful


def test_too_few_corners_tell_nothing():
    for few in (0, 1, 3):
        assert not are_off(np.zeros((few, 2)), PLACES[:few], (480, 640)).any()
