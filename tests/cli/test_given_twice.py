"""What a command is told twice must agree: corners know their target."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from orthoscope.formats.export import export
from orthoscope.formats.own.json import load_calibration, save
from orthoscope.simulation.scene import simulate_detections


@pytest.fixture
def corners(scene, tmp_path):
    path = tmp_path / "corners.json"
    save(simulate_detections(scene, noise_px=0.1, rng=np.random.default_rng(0)), path)
    return path


@pytest.mark.parametrize("spec", ["chessboard:9x6:30mm", "charuco:7x5:30mm:22mm:DICT_5X5_100"])
def test_corners_found_before_are_of_no_other_target(run, corners, tmp_path, spec):
    told = run("calibrate", corners, "--target", spec, "-o", tmp_path / "camera")
    assert told.code == 2
    assert f"corners.json holds corners of chessboard:9x6:25mm; --target says {spec}" in told.err
    assert not (tmp_path / "camera").exists() or not list((tmp_path / "camera").iterdir())


@pytest.mark.slow
def test_a_camera_is_judged_on_corners_that_know_their_target(run, scene, corners, tmp_path):
    export(scene.camera, tmp_path / "camera.yaml", "opencv")
    told = run("evaluate", tmp_path / "camera.yaml", "--on", corners)
    assert told.code == 0, told.err
    assert told.out.startswith("verdict    Good")


@pytest.mark.slow
def test_a_film_is_calibrated_from_and_straightened_in_one_command(run, photos, tmp_path):
    pictures = [cv2.imread(str(path)) for path in sorted(photos.glob("*.png"))]
    height, width = pictures[0].shape[:2]
    film = cv2.VideoWriter(str(tmp_path / "walk.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 5.0, (width, height))
    for picture in pictures:
        for _ in range(4):
            film.write(picture)
    film.release()
    told = run(
        *("calibrate", tmp_path / "walk.avi", "--target", "chessboard:9x6:25mm", "-o", tmp_path / "out"),
        *("--undistort", "--no-report", "--method", "fccm"),
    )
    assert told.code == 0, told.err
    assert (tmp_path / "out" / "undistorted" / "walk.avi").stat().st_size > 0
    assert all(
        v.image.startswith("walk.avi@")
        for v in load_calibration(tmp_path / "out/calibration.json").detections.views
    )


def test_a_free_lens_is_no_formula_that_another_method_fits(run, corners, tmp_path):
    told = run("calibrate", corners, "--method", "fccm", "--lens", "free", "-o", tmp_path / "camera")
    assert told.code == 2
    assert "only the method decoupled fits it" in told.err


def test_a_folder_of_films_is_straightened(run, scene, tmp_path):
    export(scene.camera, tmp_path / "camera.yaml", "opencv")
    (tmp_path / "films").mkdir()
    film = cv2.VideoWriter(str(tmp_path / "films/a.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 5.0, (640, 480))
    for level in (50, 100, 150):
        film.write(np.full((480, 640, 3), level, np.uint8))
    film.release()
    told = run("undistort", tmp_path / "camera.yaml", tmp_path / "films", "-o", tmp_path / "straight")
    assert told.code == 0, told.err
    assert "a.avi, 3 frames, and " in told.out
    assert told.out.rstrip().endswith("camera.json, its camera")
