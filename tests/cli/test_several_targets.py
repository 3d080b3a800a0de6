"""`--target` more than once: several boards in the same photographs."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from orthoscope.files.images import write_image
from orthoscope.formats.own.json import load
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer
from orthoscope.targets.table import parse_target

CAMERA = Camera((640, 480), Intrinsics(600.0, 600.0, 320.0, 240.0), Brown())
SPECS = "chessboard:6x5:25mm", "charuco:6x6:25mm:18mm:DICT_5X5_100"


@pytest.mark.slow
def test_each_target_that_is_named_has_a_view_of_each_photograph_and_a_part_in_the_camera(run, tmp_path):
    boards, renderer = [parse_target(spec) for spec in SPECS], Renderer(CAMERA)
    for number in range(4):
        stands = []
        for board, x in zip(boards, (-0.18, 0.02), strict=True):
            rotation = rotation_from_vector(np.array([0.3 - 0.2 * number, 0.2 * number - 0.4, 0.0]))
            stands.append((board, Pose(rotation, np.array([x, -0.06, 0.5]))))
        picture = renderer.photograph_of(stands, rng=np.random.default_rng(number))
        write_image(tmp_path / f"{number}.png", picture)
    targets = [word for spec in SPECS for word in ("--target", spec)]
    done = run(
        "calibrate",
        tmp_path,
        *targets,
        "-o",
        tmp_path / "camera",
        "--method",
        "fccm",
        "--lens",
        "brown:k1",
        "--undistort",
    )
    assert done.code == 0, done.err
    calibration = load(tmp_path / "camera" / "calibration.json")
    names = [view.image for view in calibration.detections.views]
    assert names == [f"{number}.png:board{board}" for number in range(4) for board in (1, 2)]
    assert abs(calibration.camera.intrinsics.fx - 600.0) < 2.0
    assert "0.png:board2" in (tmp_path / "camera" / "report.html").read_text()


def test_auto_says_which_target_is_seen_and_calibrate_what_to_say(run, tmp_path):
    board = parse_target("chessboard:7x5:25mm")
    rotation = rotation_from_vector(np.array([0.3, 0.1, 0.0]))
    pose = Pose(rotation, np.array([-0.07, -0.05, 0.3]))
    write_image(tmp_path / "a.png", Renderer(CAMERA).photograph(board, pose, rng=np.random.default_rng(0)))
    done = run("detect", tmp_path / "a.png", "--target", "auto")
    assert done.code == 0
    assert "target     chessboard:7x5:25mm\n" in done.out
    refused = run("calibrate", tmp_path / "a.png", "--target", "auto", "-o", tmp_path / "camera")
    assert refused.code == 2
    assert "chessboard:7x5:25mm" in refused.err


def test_a_target_that_no_photograph_shows_is_told_of(run, tmp_path):
    pose = Pose(np.eye(3), np.array([-0.07, -0.05, 0.4]))
    picture = Renderer(CAMERA).photograph(parse_target(SPECS[0]), pose, rng=np.random.default_rng(0))
    write_image(tmp_path / "a.png", picture)
    targets = [word for spec in SPECS for word in ("--target", spec)]
    done = run("detect", tmp_path / "a.png", *targets, "-o", tmp_path / "d.json")
    assert done.code == 0, done.err
    assert f"remark     {SPECS[1]}: was found in none of 1 photographs; expected in some of them." in done.out


def test_views_of_several_targets_are_not_simulated_and_that_is_said(run, tmp_path):
    targets = [word for spec in SPECS for word in ("--target", spec)]
    refused = run("simulate", *targets, "-o", tmp_path)
    assert refused.code == 2
    assert f"simulate was given 2 targets ({' + '.join(SPECS)}); expected one" in refused.err


def test_auto_names_every_board_to_copy_and_frames_of_a_film_share_a_line(run, tmp_path):
    boards = [parse_target(spec) for spec in ("chessboard:6x5:25mm", "circles:3x7:20mm:asymmetric")]
    stands = [
        (board, Pose(rotation_from_vector(np.array([0.2, turn, 0.0])), np.array([x, -0.06, 0.5])))
        for board, x, turn in zip(boards, (-0.18, 0.02), (0.3, -0.2), strict=True)
    ]
    picture = Renderer(CAMERA).photograph_of(stands, rng=np.random.default_rng(0))
    write_image(tmp_path / "a.png", picture)
    told = run("detect", tmp_path / "a.png", "--target", "auto").out
    assert "--target chessboard:6x5:25mm --target circles:3x7:20mm:asymmetric" in told
    pages = [picture, *(np.roll(np.full_like(picture, 90), step) + np.uint8(40 * step) for step in (1, 2, 3))]
    cv2.imwritemulti(str(tmp_path / "walk.tif"), pages)
    told = run("detect", tmp_path / "walk.tif", "--target", "chessboard:6x5:25mm", "-o", tmp_path / "d.json")
    assert "walk.tif#2 and 2 more of it: chessboard:6x5:25mm was not found in it\n" in told.out
