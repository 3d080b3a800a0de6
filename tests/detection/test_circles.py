"""Grids of discs: traps that other finders fall into, and how exactly outlines are seen."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from orthoscope.detection.detect import detect
from orthoscope.detection.discs.circles import see_circles
from orthoscope.detection.discs.disc_fit import fit_discs
from orthoscope.detection.discs.disc_outlines import fitted_whole, outlines_near, smoothed
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.fitting.disc_centres import disc_offsets
from orthoscope.geometry.ellipses import Ellipses
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer
from orthoscope.targets.circles import Circles
from orthoscope.targets.target import target_of

CAMERA = Camera((640, 480), Intrinsics(600.0, 600.0, 322.0, 241.0), Brown(k1=-0.2, k2=0.05))
RENDERER = Renderer(CAMERA)
MOST_OFF = 0.05  # px rms of an outline's centre


def photographed(board: Circles, turn: tuple[float, float, float], distance: float):
    """A photograph of a board whose middle is on the axis, and where the centres of outlines are."""
    target, rotation = target_of(board), rotation_from_vector(np.array(turn))
    middle = 0.5 * (target.points.min(0) + target.points.max(0))
    pose = Pose(rotation, np.array([0.0, 0.0, distance]) - rotation @ middle)
    truth = CAMERA.project(pose.apply(target.points))
    truth += disc_offsets(CAMERA, pose, target.points, target.disc_radii)
    return RENDERER.photograph(target, pose, rng=np.random.default_rng(0)), truth


def rms_off(sight: Sight | Unseen, truth: np.ndarray) -> float:
    assert isinstance(sight, Sight)
    assert len(sight.ids) == len(truth)
    return float(np.sqrt(((sight.pixels - truth[sight.ids]) ** 2).sum(1).mean()))


def test_a_smaller_grid_is_not_seen_inside_a_larger_one():
    picture, _ = photographed(Circles(10, 8, 0.02, "symmetric", 0.01), (0.2, 0.3, 0.0), 0.3)
    for columns, rows in ((4, 3), (9, 8), (10, 7)):
        sight = see_circles(picture, Circles(columns, rows, 0.02, "symmetric", 0.01))
        assert isinstance(sight, Unseen)


@pytest.mark.parametrize(
    ("board", "turn", "distance"),
    [
        pytest.param(Circles(4, 11, 0.02, "asymmetric", 0.008), (0.3, 0.2, 0.1), 0.3, id="usual"),
        pytest.param(Circles(3, 5, 0.04, "asymmetric", 0.04), (0.1, 0.3, 0.0), 0.3, id="large"),
        pytest.param(Circles(4, 11, 0.02, "asymmetric", 0.012), (0.0, 1.2, 0.0), 0.36, id="grazing"),
        pytest.param(Circles(4, 11, 0.02, "asymmetric", 0.008), (0.3, 0.2, 0.1), 0.9, id="small"),
    ],
)
def test_outlines_are_seen_where_they_are(board, turn, distance):
    picture, truth = photographed(board, turn, distance)
    assert rms_off(see_circles(picture, board), truth) < MOST_OFF
    assert rms_off(see_circles(255 - picture, board), truth) < MOST_OFF  # white on black


def test_a_part_that_may_be_several_parts_of_the_board_is_not_given_ids():
    board = Circles(10, 8, 0.02, "symmetric", 0.01)
    picture, _ = photographed(board, (0.1, 0.1, 0.0), 0.12)  # no side is in the picture
    sight = see_circles(picture, board)
    assert isinstance(sight, Unseen)
    assert "in part only" in sight.reason


def test_an_outline_that_is_not_whole_is_no_disc():
    picture, truth = photographed(Circles(4, 11, 0.02, "asymmetric", 0.008), (0.0, 0.0, 0.0), 0.3)
    covered = picture.copy()
    x, y = np.rint(truth[20]).astype(int)
    covered[y : y + 20, x - 20 : x + 20] = 200
    rough = Ellipses(truth[19:21], np.tile(np.eye(2) * 8.0, (2, 1, 1)))
    whole, part = (fitted_whole(one, outlines_near(smoothed(one), rough)) for one in (picture, covered))
    assert np.isfinite(whole.ellipses.centres).all()
    assert np.isfinite(part.ellipses.centres[:, 0]).tolist() == [True, False]


def test_discs_that_are_not_as_wide_as_described_are_told_of():
    printed, said = Circles(4, 7, 0.02, "asymmetric", 0.012), Circles(4, 7, 0.02, "asymmetric", 0.008)
    picture, _ = photographed(printed, (0.3, 0.2, 0.1), 0.3)
    (remark,) = detect(picture, target_of(said)).remarks
    assert remark.image == said.description
    assert remark.words.startswith("its discs are seen 12.")
    assert (
        "expected 8.0 mm as described. If that is so, say --target circles:4x7:20mm:asymmetric:12"
        in remark.words
    )
    assert not detect(picture, target_of(printed)).remarks


def test_a_disc_that_is_partly_covered_is_left_out():
    board = Circles(4, 7, 0.02, "asymmetric", 0.012)
    picture, truth = photographed(board, (0.1, 0.2, 0.1), 0.3)
    x, y = np.rint(truth[12]).astype(int)
    picture[y : y + 40, x - 40 : x + 40] = 190  # the lower half, by something as bright as the paper
    sight = see_circles(picture, board)
    assert isinstance(sight, Sight)
    assert 12 not in sight.ids
    assert np.linalg.norm(sight.pixels - truth[sight.ids], axis=1).max() < 0.3


def test_the_edge_of_a_shadow_moves_no_disc():
    board = Circles(4, 7, 0.02, "asymmetric", 0.012)
    picture, truth = photographed(board, (0.1, 0.2, 0.1), 0.3)
    x = np.arange(picture.shape[1])
    for middle in (truth[12, 0] - 6.0, truth[12, 0], truth[12, 0] + 8.0):
        share = 0.65 + 0.35 * np.tanh((x - middle) / 2.0)
        sight = see_circles(np.rint(share * picture).astype(np.uint8), board)
        assert isinstance(sight, Sight)
        assert len(sight.ids) >= len(truth) - 8  # those in the shadow's edge cannot be known
        assert np.linalg.norm(sight.pixels - truth[sight.ids], axis=1).max() < 0.1


def blurred_discs(rng: np.random.Generator, *, radius: float, blur: float, noise: float, count: int = 36):
    """A picture of discs in rows of six, their centres and the half step from inside to outside."""
    apart, step = 4.0 * radius, 75.0
    centres = np.stack(np.divmod(np.arange(count), 6)[::-1], axis=1) * apart + 0.7 * apart
    centres = centres + rng.uniform(-0.5, 0.5, centres.shape)
    side = int(6 * apart + 0.5 * apart)
    y, x = np.mgrid[:side, :side].astype(float)
    nearest = np.full(x.shape, np.inf)
    for column, row in centres:
        np.minimum(nearest, np.hypot(x - column, y - row), out=nearest)
    grey = 110.0 + step * np.tanh((nearest - radius) / blur) * (1.0 + 0.1 * x / side)
    grey += rng.normal(0.0, noise, grey.shape)
    return np.rint(grey).astype(np.uint8), centres, step


@pytest.mark.parametrize(("radius", "blur", "noise"), [(11.0, 0.9, 2.0), (18.0, 1.5, 6.0), (30.0, 2.0, 4.0)])
def test_a_disc_is_found_as_well_as_noise_allows(radius, blur, noise):
    grey, centres, step = blurred_discs(np.random.default_rng(3), radius=radius, blur=blur, noise=noise)
    rough = Ellipses(centres + 0.4, np.tile(1.03 * radius * np.eye(2), (len(centres), 1, 1)))
    fit = fit_discs(grey, rough)
    # a rim of 2 pi R pixels, each of which tells the edge by step^2 / blur^2 times the sum of sech^4
    told = np.pi * radius * (step / blur) ** 2 * (4.0 / 3.0) * blur / noise**2
    rms = np.sqrt(((fit.ellipses.centres - centres) ** 2).mean())
    assert rms < 1.35 / np.sqrt(told)  # of 72 coordinates the rms is known to 8 %
    assert (np.abs(fit.off) < 4.5 * fit.spread + 0.02).all()


def test_what_covers_a_disc_moves_a_sector_of_its_outline():
    grey, centres, _ = blurred_discs(np.random.default_rng(4), radius=11.0, blur=1.2, noise=3.0)
    cv2.circle(grey, tuple(np.rint(centres[14] + (12, 3)).astype(int).tolist()), 6, 180, -1)
    fit = fit_discs(grey, Ellipses(centres, np.tile(11.0 * np.eye(2), (len(centres), 1, 1))))
    moved = (np.abs(fit.off) > 4.5 * fit.spread + 0.02).any(1)
    assert np.flatnonzero(moved).tolist() == [14]


@pytest.mark.parametrize("white", [False, True], ids=["black", "white"])
def test_a_shadow_over_half_of_a_board_leaves_no_disc_beside_its_edge_out(white):
    board = Circles(9, 7, 0.02, "symmetric", 0.01)
    picture, truth = photographed(board, (0.2, 0.3, 0.0), 0.3)
    shade = 0.35 + 0.65 / (1.0 + np.exp((np.arange(640) - 330.0) / 8.0))
    shaded = np.rint((255.0 - picture if white else picture) * shade).astype(np.uint8)
    sight = see_circles(shaded, board)
    assert isinstance(sight, Sight)
    beside = np.flatnonzero(np.abs(truth[:, 0] - 330.0) > 45.0)
    assert np.isin(beside, sight.ids).all()
    assert np.linalg.norm(sight.pixels - truth[sight.ids], axis=1).max() < 0.3


def test_discs_that_are_all_ragged_are_whole():
    """As a rough print or a sharpened picture has them: a fifth of a pixel to and fro along the outline."""
    board = Circles(4, 7, 0.02, "asymmetric", 0.012)
    picture, truth = photographed(board, (0.3, 0.2, 0.1), 0.3)
    rng = np.random.default_rng(1)
    jitter = [cv2.GaussianBlur(rng.normal(0.0, 1.0, picture.shape), (0, 0), 3.0) for _ in "xy"]
    y, x = np.mgrid[:480, :640].astype(np.float32)
    dx, dy = (0.2 * part / part.std() for part in jitter)
    ragged = cv2.remap(
        picture,
        (x + dx).astype(np.float32),
        (y + dy).astype(np.float32),
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    # an outline has some seven parts that differ: a centre moves by 0.2 px times the root of 2 over 7
    assert rms_off(see_circles(ragged, board), truth) < 1.5 * 0.2 * np.sqrt(2.0 * 2.0 / 7.0)
