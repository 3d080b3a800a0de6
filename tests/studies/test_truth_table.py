"""The studies' worlds are what they say, and the lines of docs/measured/verdict.md hold."""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.studied import ROOT, Recipe, made

from benchmarks.studies.boards import grid, shaped, size_of  # isort: skip
from benchmarks.studies.projectors import Projector  # isort: skip
from benchmarks.studies.scenarios import SCENARIOS  # isort: skip
from benchmarks.studies.truth_table import judged  # isort: skip
from benchmarks.studies.worlds import true_error  # isort: skip

LINE = re.compile(r"\| (?P<name>.+?) \| (?P<right>\d+) of (?P<of>\d+) \|")
PAGE = (ROOT / "docs/measured/verdict.md").read_text()


def points() -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(-1, 1, (40, 2)), rng.uniform(0.8, 2.0, 40)])


def test_the_fisheye_is_opencvs_in_front_of_the_camera():
    camera = Projector(fisheye=True, focal=(240.0, 238.0), coefficients=(0.03, -0.005, 0.001, -1e-4))
    K = np.array([[240.0, 0, camera.centre[0]], [0, 238.0, camera.centre[1]], [0, 0, 1.0]])
    expected = cv2.fisheye.projectPoints(
        points()[None], np.zeros(3), np.zeros(3), K, np.array(camera.coefficients)
    )[0][0]
    assert_allclose(camera.pixels(points()), expected, atol=1e-9)


def test_a_window_that_touches_the_lens_bends_rays_by_snells_law():
    camera = Projector(port=1e-12, coefficients=(0.0, 0.0, 0.0, 0.0))
    ahead = points() + np.array([0.0, 0.0, 1.2])  # nothing is seen beyond 48 degrees
    seen = (camera.pixels(ahead) - camera.centre) / camera.focal
    in_water = np.arctan(np.hypot(*ahead[:, :2].T) / ahead[:, 2])
    assert_allclose(np.sin(np.arctan(np.hypot(*seen.T))), 1.333 * np.sin(in_water), rtol=1e-6)


def test_a_picture_that_was_turned_over_is_the_same_picture():
    camera = Projector()
    turned = replace(camera, turned=True)
    assert_allclose(turned.pixels(points()), np.array(camera.size) - 1.0 - camera.pixels(points()))


def test_the_same_seed_gives_the_same_world_and_another_one_another():
    one, again, other = made(Recipe(), 3), made(Recipe(), 3), made(Recipe(), 4)
    assert_array_equal(one.photographs[5].pixels, again.photographs[5].pixels)
    assert np.abs(one.photographs[5].pixels - other.photographs[5].pixels).max() > 1.0


def test_a_board_is_bent_by_its_share_of_its_size():
    flat = grid(9, 6, 0.025)
    bent = shaped(flat, {"bend": 0.01}, np.random.default_rng(0))
    assert_allclose(
        np.ptp(bent[:, 2]), 0.5 * 0.01 * size_of(flat), rtol=0.05
    )  # no corner is in the very middle


def test_the_true_camera_is_off_by_nothing_and_a_zoomed_one_by_what_it_moves():
    world = made(Recipe(), 0)
    towards = points()
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    pixels = world.cameras[0].pixels(towards)
    known = np.isfinite(pixels).all(1)
    assert true_error(world, pixels[known], towards[known]) < 1e-6
    zoomed = 0.01 * (pixels - world.cameras[0].centre)
    apart = true_error(world, (pixels + zoomed)[known], towards[known])
    assert 0.2 < apart / np.sqrt((zoomed[known] ** 2).sum(1).mean()) < 1.0  # a rotation takes a part of it


def test_every_scenario_has_its_line():
    assert {found["name"] for found in LINE.finditer(PAGE)} == {scenario.name for scenario in SCENARIOS}
    assert len(SCENARIOS) >= 40


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.name)
def test_the_line_of_each_scenario_holds(scenario):
    """What is right with every seed of the page is right with the first."""
    (line,) = (found for found in LINE.finditer(PAGE) if found["name"] == scenario.name)
    row = judged(scenario, 0)
    assert row.breach == ""
    assert row.right or line["right"] != line["of"]
