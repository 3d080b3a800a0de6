"""`--target auto`: photographs say which kind and size of board they show, up to lengths."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from helpers.quick import first_quick
from helpers.scenes import side_by_side
from orthoscope.detection.recognition.recognise import recognise
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer
from orthoscope.simulation.scene import random_views
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

CAMERA = Camera((640, 480), Intrinsics(560.0, 560.0, 320.0, 240.0), Brown(k1=-0.2, k2=0.05))
RENDERER = Renderer(CAMERA)
# Boards with the lengths that recognition takes, so that descriptions are the same.
QUICK = (
    "chessboard:8x6:25mm",
    "marked:9x6:25mm",
    "charuco:7x6:30mm:21mm:DICT_6X6_50:legacy",
    "circles:4x11:20mm:asymmetric",
)
SLOW = (  # some 4 s each: every dictionary is tried on every quadrangle
    "chessboard:9x6:25mm",
    "charuco:7x5:30mm:22mm:DICT_5X5_50",
    "charuco:6x8:30mm:24mm:DICT_4X4_50",
    "charuco:6x8:30mm:24mm:DICT_4X4_50:legacy",
    "aprilgrid:5x4:30mm:0.3",
    "aruco:5x4:30mm:9mm:DICT_4X4_50",
    "circles:9x7:20mm:symmetric:10mm",
)


def photographs(spec: str, count: int) -> dict[str, np.ndarray]:
    target, rng = parse_target(spec), np.random.default_rng(5)
    views = random_views(CAMERA, target, count, rng=rng, tilt=(0.1, 0.6), fill=(0.65, 0.85), margin=0.03)
    return {f"{i}": RENDERER.photograph(target, pose, rng=rng) for i, pose in enumerate(views)}


@pytest.mark.slow  # every dictionary is tried on every square
def test_a_board_without_a_white_margin_is_known_by_the_size_that_comes_again():
    """Its sides are not seen: the squares at the rim meet black as well as white."""
    squares = np.kron(np.indices((7, 10)).sum(0) % 2, np.ones((40, 40))).astype(np.uint8) * 200 + 20
    rng, sheet = np.random.default_rng(3), np.float32([[0, 0], [400, 0], [400, 280], [0, 280]])
    views = {}
    for i in range(4):
        place = np.float32([[120, 100], [520, 110], [510, 390], [130, 380]]) + rng.uniform(-40, 40, (4, 2))
        plane = cv2.getPerspectiveTransform(sheet, place.astype(np.float32))
        inside = cv2.warpPerspective(np.ones_like(squares), plane, (640, 480))
        drawn = np.where(inside, cv2.warpPerspective(squares, plane, (640, 480)), 20)
        views[str(i)] = cv2.GaussianBlur(drawn.astype(np.uint8), (0, 0), 0.8)
    found = recognise(views)
    assert [target.name for target in found.targets] == ["chessboard:9x6:25mm"]
    assert found.seen == (4,)


def check_same(found: Target, said: Target) -> None:
    """Checks that two descriptions are of one board, lengths as well as they can be seen."""
    ours, theirs = (target.name.split(":") for target in (found, said))
    for a, b in zip(ours, theirs, strict=False):
        if a.removesuffix("mm").replace(".", "").isdecimal():
            assert float(a.removesuffix("mm")) == pytest.approx(float(b.removesuffix("mm")), rel=0.08)
        else:
            assert a == b
    rest = [{field for field in fields if not field[0].isdecimal()} for fields in (ours, theirs)]
    assert rest[0] == rest[1]


@pytest.mark.parametrize("spec", [*QUICK, *(pytest.param(spec, marks=pytest.mark.slow) for spec in SLOW)])
def test_photographs_say_which_board_they_show(spec):
    found = recognise(photographs(spec, 1))
    (target,) = found.targets
    assert found.seen == (found.looked_at,) == (1,)
    check_same(target, parse_target(spec))


SEVERAL = {  # with the lengths that recognition takes
    "squares and discs": "chessboard:6x5:25mm + chessboard:5x4:25mm + circles:3x7:20mm:asymmetric",
    "two of one dictionary": "aprilgrid:4x3:30mm:0.3 + aprilgrid:4x3:30mm:0.3:first=12",
    "two of one dictionary, chequered": (
        "charuco:6x5:30mm:22mm:DICT_4X4_50 + charuco:6x5:30mm:22mm:DICT_4X4_50:first=15"
    ),
    "two dictionaries": "charuco:7x5:30mm:21mm:DICT_5X5_50 + aprilgrid:4x3:30mm:0.3",
}


@pytest.mark.parametrize("specs", first_quick(SEVERAL))
def test_boards_in_one_photograph_are_told_each(specs):
    target = parse_target(specs)
    found = recognise(RENDERER.photograph_of(side_by_side(CAMERA, target, 0.2), rng=np.random.default_rng(0)))
    ours, theirs = (sorted(some, key=lambda one: one.name) for some in (found.targets, target.members))
    assert found.seen == (1,) * len(theirs)
    for one, said in zip(ours, theirs, strict=True):
        check_same(one, said)
        assert f"--target {one.name}" in found.sentence


def test_a_part_of_a_room_is_no_board():
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.normal(128.0, 400.0, (480, 640)), (0, 0), 4.0)
    with pytest.raises(CalibrationError, match="none of 1 photographs shows"):
        recognise(np.clip(texture, 0, 255).astype(np.uint8))
