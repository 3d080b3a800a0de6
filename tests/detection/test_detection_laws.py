"""What holds for every kind of target in photographs: it is found with the right ids, also turned and in
part.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from helpers.quick import first_quick
from helpers.target_laws import every_board
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import DETECTORS, see
from orthoscope.fitting.disc_centres import disc_offsets
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.simulation.render import Renderer
from orthoscope.simulation.scene import random_views
from orthoscope.targets.table import TARGETS
from orthoscope.targets.target import target_of

BROWN = Camera((800, 600), Intrinsics(700.0, 698.0, 404.0, 296.0), Brown(k1=-0.25, k2=0.08))
FISHEYE = Camera((800, 600), Intrinsics(330.0, 330.0, 400.0, 300.0), KannalaBrandt(k1=-0.02))
BROWNS, FISHEYES = Renderer(BROWN), Renderer(FISHEYE)  # a renderer keeps its camera's rays
LOOKS = {"once": (BROWNS, 1), "brown": (BROWNS, 3), "fisheye": (FISHEYES, 3)}
MOST_OFF = 1.0  # px: a corner farther from the truth is another corner
FOUND = (
    0.95  # of the corners around which a whole step is in the picture; all but a few at the rim of a fisheye
)


def margin(target) -> float:
    """What belongs to the board beyond its corners, metres."""
    drawing = target.drawing()
    return float(
        np.max(np.abs([drawing.low - target.points.min(0)[:2], drawing.high - target.points.max(0)[:2]]))
    )


def seen(renderer: Renderer, target, pose: Pose, seed: int = 0):
    """What the detector sees in a photograph, and where corners, or the centres of outlines, truly are."""
    picture = renderer.photograph(target, pose, rng=np.random.default_rng(seed))
    truth = renderer.camera.project(pose.apply(target.points))
    if target.disc_radii.any():
        truth += disc_offsets(renderer.camera, pose, target.points, target.disc_radii)
    return see(picture, target), truth


def check_ids(target, sight, truth: np.ndarray) -> None:
    """Every corner is where its id says, up to one of the ways in which the board looks the same."""
    assert isinstance(sight, Sight)
    assert_array_equal(sight.ids, np.unique(sight.ids))
    ways = [np.arange(len(truth)), *target.symmetries()]
    assert min(np.linalg.norm(truth[way[sight.ids]] - sight.pixels, axis=1).max() for way in ways) < MOST_OFF


def test_every_kind_has_a_detector():
    assert set(DETECTORS) == set(TARGETS)


@every_board
@pytest.mark.parametrize(("renderer", "photographs"), first_quick(LOOKS))
def test_a_board_is_found_whole_with_its_ids_at_any_roll_and_tilt(board, renderer, photographs):
    target, rng = target_of(board), np.random.default_rng(3)
    views = random_views(
        renderer.camera, target, photographs, rng=rng, tilt=(0.0, 0.9), fill=(0.6, 0.9), margin=margin(target)
    )
    for i, pose in enumerate(views):
        sight, truth = seen(renderer, target, pose, i)
        check_ids(target, sight, truth)
        assert len(sight.ids) >= FOUND * len(truth)


@every_board
@pytest.mark.parametrize(
    "side", ["left", *(pytest.param(side, marks=pytest.mark.slow) for side in ("right", "top", "bottom"))]
)
def test_a_board_with_a_side_out_of_the_picture_is_found_as_far_as_it_is_in_it(board, side):
    target = target_of(board)
    low, high = target.points.min(0)[:2], target.points.max(0)[:2]
    axis, sign = {"left": (0, -1), "right": (0, 1), "top": (1, -1), "bottom": (1, 1)}[side]
    middle = 0.5 * (low + high)
    distance = 700.0 * np.max((high - low + 2 * margin(target)) / [760.0, 560.0])
    rotation = rotation_from_vector(np.array([0.15, -0.2, 0.05]))
    aim = np.zeros(3)
    aim[axis] = (
        sign
        * distance
        * (0.5 * BROWN.image_size[axis] - 0.27 * 700.0 * (high - low)[axis] / distance)
        / 700.0
    )
    pose = Pose(rotation, np.array([aim[0], aim[1], distance]) - rotation @ np.array([*middle, 0.0]))
    sight, truth = seen(BROWNS, target, pose)
    check_ids(target, sight, truth)
    step = np.linalg.norm(np.diff(truth[target.lines[0][:2]], axis=0))
    inside = ((truth > step) & (truth < np.array(BROWN.image_size) - 1 - step)).all(1)
    assert 0.2 * len(truth) < inside.sum() < 0.9 * len(truth)  # the side is out
    assert len(sight.ids) >= FOUND * inside.sum()


@every_board
def test_nothing_is_found_where_nothing_is(board):
    target, rng = target_of(board), np.random.default_rng(1)
    for picture in (
        np.full((480, 640), 128, np.uint8),
        rng.integers(0, 256, (480, 640), dtype=np.uint8),
        np.zeros((3, 5), np.uint8),
    ):
        assert not isinstance(see(picture, target), Sight)
