"""A saddle is found where it is, on straight edges and on bent ones; a grid of corners says how its lines
run.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.detection.chessboards.grid import grid_shape, lattice, nearest_neighbour, one_line_more
from orthoscope.detection.saddles.linked import are_linked
from orthoscope.detection.saddles.refine import refined
from orthoscope.detection.saddles.saddle import fit_saddles
from orthoscope.detection.saddles.saddle_arms import saddle_arms

PLACE = np.array([[20.3, 19.6]])


def picture(
    *, angle: float = 0.1, bend: float = 0.0, blur: float = 1.2, light: float = 0.0, contrast: float = 80.0
) -> np.ndarray:
    """41x41 pixels of two edges that cross at PLACE at a right angle, the first bent."""
    y, x = np.mgrid[:41, :41].astype(float)
    dx, dy = x - PLACE[0, 0], y - PLACE[0, 1]
    a, b = dx * np.cos(angle) + dy * np.sin(angle), dy * np.cos(angle) - dx * np.sin(angle)
    saddle = np.tanh((b - bend * a * a / 2) / blur) * np.tanh(a / blur)
    return np.rint((128 + contrast * saddle) * (1 + light * dx)).astype(
        np.uint8
    )  # light falls on black and on white


def fitted(grey: np.ndarray, *, bends=(0.0, 0.0), off=(0.6, -0.8)):
    return fit_saddles(
        grey, PLACE + off, np.array([[12.0, 1.0]]), np.array([[-1.0, 12.0]]), bends=np.array([bends])
    )


@pytest.mark.parametrize(
    "look",
    [
        {},
        {"angle": -0.3},
        {"blur": 3.0},
        {"blur": 0.8},
        {"light": 0.006},
        {"contrast": -60.0},
        {"contrast": 4.0},
    ],
    ids=str,
)
def test_a_saddle_is_found_to_a_hundredth_of_a_pixel_whatever_its_look(look):
    saddles = fitted(picture(**look))
    assert_allclose(
        saddles.places, PLACE, atol=0.01 if abs(look.get("contrast", 80.0)) > 10 else 0.05
    )  # whole grey levels are what is left
    assert_allclose(saddles.contrast, look.get("contrast", 80.0), rtol=0.05)
    assert saddles.explained > 0.97


@pytest.mark.parametrize("half", [1.2, 2.0, 4.0, 10.0])
def test_corners_spread_as_they_say_and_by_less_than_a_pixel_in_windows_of_a_few_pixels(half):
    rng, count, deviation = np.random.default_rng(0), 8, 3.0
    plain = np.tile(picture(blur=1.0, contrast=40.0), (count, count)).astype(float)
    noisy = np.rint(plain + rng.normal(0.0, deviation, plain.shape)).astype(np.uint8)
    truth = PLACE + 41.0 * lattice(count, count)
    along, down = (np.tile([[half * x, half * y]], (len(truth), 1)) for x, y in ((1.0, 0.1), (-0.1, 1.0)))
    bends = np.zeros_like(truth)
    start = truth + rng.uniform(-0.3, 0.3, truth.shape)
    saddles = fit_saddles(noisy, start, along, down, bends=bends, noise=deviation**2)
    error = np.hypot(*(saddles.places - truth).T)
    assert np.sqrt(0.5 * ((error / saddles.spread) ** 2).mean()) < 1.2
    assert error[saddles.spread < 0.19].max(initial=0.0) < 0.8
    assert_allclose(np.abs(saddles.contrast), 40.0, rtol=0.4)


@pytest.mark.parametrize("bend", [0.02, -0.02])
def test_a_bent_edge_moves_the_corner_unless_the_bend_is_known(bend):
    grey = picture(bend=bend)
    assert np.abs(fitted(grey).places - PLACE).max() > 0.1
    assert_allclose(fitted(grey, bends=(bend, 0.0)).places, PLACE, atol=0.02)


def test_what_is_no_saddle_is_hardly_explained():
    edge = np.repeat(np.where(np.arange(41) < 20, 40, 200).astype(np.uint8)[None], 41, axis=0)
    stripes = np.where(np.arange(41) % 8 < 4, 40, 200).astype(np.uint8)[:, None] * np.ones((1, 41), np.uint8)
    noise = np.random.default_rng(0).integers(0, 256, (41, 41), dtype=np.uint8)
    flat = np.full((41, 41), 90, np.uint8)
    assert fitted(stripes).explained < 0.5
    assert fitted(noise).explained < 0.5
    for grey in (edge, flat):
        assert np.isfinite(fitted(grey).places).all()


WINDOW = {"along": np.array([[12.0, 1.0]]), "down": np.array([[-1.0, 12.0]]), "bends": np.zeros((1, 2))}


def arms_of(grey: np.ndarray):
    """The fitted saddle and what its arms say."""
    saddles = fitted(grey)
    return saddles, saddle_arms(grey, saddles, **WINDOW, arms=np.ones(1), noise=0.0)


def test_glare_in_a_square_moves_no_arm_and_the_corner_less_where_squares_need_not_be_alike():
    y, x = np.mgrid[:41, :41] - PLACE[0, ::-1, None, None]
    plain = picture(angle=0.0, contrast=50.0)
    middle = 6.0 if plain[30, 30] > 128 else -6.0  # of the bright square at the right
    glare = 1.0 + 0.8 * np.exp(-((x - 6.0) ** 2 + (y - middle) ** 2) / (2.0 * 4.0**2))
    saddles, told = arms_of(np.clip(np.rint(plain * glare), 0, 255).astype(np.uint8))
    assert saddles.explained < 0.95  # of a plain one all is
    assert np.abs(told.shifts).max() < 1.0
    off, off_before = np.hypot(*(told.places - PLACE).T), np.hypot(*(saddles.places - PLACE).T)
    assert off < 0.5 * off_before


def test_a_finger_over_an_arm_moves_that_arm():
    y, x = np.mgrid[:41, :41] - PLACE[0, ::-1, None, None]
    grey = np.where((x - 9) ** 2 + (y - 1) ** 2 < 6**2, 150, picture(angle=0.0)).astype(np.uint8)
    _, told = arms_of(grey)
    differ = (np.abs(told.shifts) > np.maximum(1.0, 4.0 * told.spread)).any()
    assert differ or told.steps.min() < 0.25


def test_a_corner_beyond_a_gap_that_is_numbered_as_the_one_beside_it_does_not_hang_together():
    cells = lattice(9, 6).astype(int)
    pixels = 30.0 * cells
    seen = (cells[:, 0] < 5) | ((cells == (6, 2)).all(1))
    assert are_linked(pixels[seen], cells[seen], cells[seen].astype(float)).all()  # foreseen, and there
    pixels[(cells == (6, 2)).all(1)] += (0.0, 30.0)
    kept = are_linked(pixels[seen], cells[seen], cells[seen].astype(float))
    assert (kept == (cells[seen][:, 0] < 5)).all()


def circles(columns: int = 9, rows: int = 6, radius: float = 400.0):
    """A grid whose rows are arcs about a point far below, 30 px a square."""
    row, column = np.mgrid[:rows, :columns]
    r, angle = radius - 30.0 * row, (column - columns // 2) * 30.0 / radius
    return np.stack([300 + r * np.sin(angle), 500 - r * np.cos(angle)], axis=-1).reshape(-1, 2), r.ravel()


def test_a_grid_of_arcs_has_their_curvature_and_straight_columns():
    corners, radius = circles()
    shape = grid_shape(corners, lattice(9, 6))
    assert_allclose(
        shape.bend_along, 1.0 / radius, rtol=0.01
    )  # towards +90 degrees of x, which is down, where the centre is
    assert_allclose(shape.bend_down, 0.0, atol=1e-12)
    assert shape.stray.max() < 5e-3  # what a parabola differs from an arc over five squares


def test_a_corner_that_was_mistaken_strays():
    corners, _ = circles()
    corners[22] += 12.0
    assert grid_shape(corners, lattice(9, 6)).stray.argmax() == 22


def test_the_nearest_neighbour_is_along_the_shorter_side():
    corners = np.stack(np.meshgrid(np.arange(4) * 10.0, np.arange(3) * 7.0), axis=-1).reshape(-1, 2)
    assert_allclose(nearest_neighbour(corners, lattice(4, 3)), 7.0)


def test_a_line_more_goes_on_as_the_last_ones_do():
    corners, _ = circles(rows=7)
    grid = corners.reshape(7, 9, 2)
    assert_allclose(one_line_more(grid[:6]), grid, atol=1e-9)  # the columns are straight and even


def test_a_picture_that_is_no_board_leaves_every_corner_near_where_it_was():
    corners, _ = circles()
    noise = np.random.default_rng(0).integers(0, 256, (480, 640), dtype=np.uint8)
    moved = refined(noise, corners, lattice(9, 6)).pixels - corners
    assert np.isfinite(moved).all()
    assert np.hypot(*moved.T).max() < 0.5 * 30  # half a square
