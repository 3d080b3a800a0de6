"""Bad input: a message that says what was got, what was expected and what to do; the right exit code; nothing
half-written.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest

from orthoscope.formats.own.json import load_detections, save
from orthoscope.geometry.pose import Pose
from orthoscope.simulation.scene import Scene, simulate_detections

TARGET = "chessboard:9x6:25mm"


@pytest.fixture
def folder(photos, tmp_path):
    """A copy of the photographs that a test may spoil."""
    spoilt = tmp_path / "photos"
    spoilt.mkdir()
    for path in sorted(photos.iterdir()):
        (spoilt / path.name).write_bytes(path.read_bytes())
    return spoilt


def calibrate(run, *arguments, out):
    return run("calibrate", *arguments, "--no-report", "-o", out)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("calibrate",), ("PHOTOS",)),
        (("calibrate", "nowhere", "--target", TARGET), ("nowhere",)),
        (("calibrate", "nothing*.png", "--target", TARGET), ("nothing*.png",)),
        (("calibrate", ".", "--target", TARGET), ("photograph",)),
        (("calibrate", ".", "--target", "chess:9x6"), ("chess:9x6", "chessboard:9x6:25mm")),
        (("calibrate", ".", "--target", "chessboard:9x6:25"), ("'25'", "25mm")),
        (("calibrate", "."), ("target",)),
        (("calibrate", "corners.vnl", "--target", TARGET), ("--image-size",)),
        (("calibrate", "corners.vnl", "--target", TARGET, "--image-size", "640"), ("640x480",)),
        (("evaluate", "missing.json"), ("missing.json",)),
        (("frobnicate",), ("frobnicate",)),
    ],
)
def test_a_wrong_command_says_so_and_leaves_with_2(run, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "corners.vnl").write_text("# filename x y level\n")
    told = run(*arguments)
    assert told.code == 2
    assert all(word in told.err for word in words), told.err
    assert told.out == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["corners.vnl"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        "--lens fisheye",
        "--lens brown:k9",
        "--method magic",
        "--method fccm --loss soft",
        "--shape wavy",
        "--export nothing",
    ],
)
def test_an_unknown_name_lists_the_known_ones(run, calibrated, tmp_path, options):
    told = calibrate(run, calibrated / "detections.json", *options.split(), out=tmp_path / "out")
    assert told.code == 2
    assert re.split("[ :]", options)[-1] in told.err
    assert "expected one of" in told.err or "it has" in told.err
    assert not (tmp_path / "out/calibration.json").exists()


@pytest.mark.slow
def test_spoilt_photographs_are_set_aside_and_named(run, folder, tmp_path):
    (folder / "view02.png").write_bytes(b"")
    (folder / "view03.png").write_bytes(b"this is no image at all")
    whole = (folder / "view04.png").read_bytes()
    (folder / "view04.png").write_bytes(whole[: len(whole) // 2])
    (folder / "view05.png").write_bytes((folder / "view06.png").read_bytes())
    calibrate(run, folder, "--target", TARGET, out=tmp_path / "out")
    detections = load_detections(tmp_path / "out/detections.json")
    reasons = dict(detections.set_aside)
    assert set(reasons) == {"view02.png", "view03.png", "view04.png", "view06.png"}
    assert "view05.png" in reasons["view06.png"]
    assert len(detections.views) == 6


@pytest.mark.slow
def test_the_minority_of_image_sizes_is_set_aside_and_named(run, folder, tmp_path):
    small = cv2.resize(cv2.imread(str(folder / "view01.png")), (320, 240))
    cv2.imwrite(str(folder / "view01.png"), small)
    calibrate(run, folder, "--target", TARGET, out=tmp_path / "out")
    (aside,) = load_detections(tmp_path / "out/detections.json").set_aside
    assert aside.image == "view01.png"
    assert "320x240" in aside.reason


@pytest.mark.slow
def test_a_target_that_does_not_match_is_told_which_size_seems_to_be_there(run, photos, tmp_path):
    told = calibrate(run, photos, "--target", "chessboard:10x7:25mm", out=tmp_path / "out")
    assert told.code == 1
    assert "9x6" in told.err
    assert not (tmp_path / "out").exists()


def test_a_size_that_the_photographs_do_not_have_is_refused(run, scene, tmp_path):
    found = simulate_detections(scene, noise_px=0.1, rng=np.random.default_rng(0))
    save(found, tmp_path / "found.json")
    told = calibrate(run, tmp_path / "found.json", "--image-size", "64x48", out=tmp_path / "camera")
    assert told.code == 2
    assert "--image-size says 64x48" in told.err


def test_photographs_without_a_board_leave_with_1(run, tmp_path):
    grey = np.random.default_rng(0).integers(90, 110, (240, 320), dtype=np.uint8)
    (tmp_path / "photos").mkdir()
    cv2.imwrite(str(tmp_path / "photos/a.png"), grey)
    told = calibrate(run, tmp_path / "photos", "--target", TARGET, out=tmp_path / "out")
    assert told.code == 1
    assert told.out == ""


def test_views_all_parallel_leave_with_1_and_print_no_camera(run, scene, tmp_path):
    facing = tuple(
        Pose(np.eye(3), np.array([0.05 * i - 0.2, 0.03 * i - 0.15, 0.35 + 0.02 * i])) for i in range(8)
    )
    parallel = simulate_detections(
        Scene(scene.camera, scene.target, facing), noise_px=0.1, rng=np.random.default_rng(0)
    )
    save(parallel, tmp_path / "detections.json")
    told = calibrate(run, tmp_path / "detections.json", out=tmp_path / "out")
    assert told.code == 1
    assert "parallel" in told.err
    assert "tilted" in told.err
    assert "fx" not in told.out
    assert not (tmp_path / "out/calibration.json").exists()


@pytest.mark.parametrize(
    ("views", "told_so"),
    [(1, "One photograph cannot tell how far off it is"), (2, "2 photographs are too few to rely on that")],
)
def test_one_and_two_views_say_what_they_assume(run, calibrated, tmp_path, views, told_so):
    save(load_detections(calibrated / "detections.json").only(range(views)), tmp_path / "few.json")
    told = calibrate(run, tmp_path / "few.json", "--lens", "brown:k1", out=tmp_path / "out")
    assert told.code == 0, told.err
    assert "Do not use this camera: " in told.out
    assert f"{told_so}. Take" in told.out


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda text: text[: len(text) // 2], "JSON"),
        (lambda text: text.replace('"orthoscope": "detections"', '"made_by": "another"'), "orthoscope"),
        (lambda text: text.replace('"format": 1', '"format": 99'), "newer"),
        (lambda text: re.sub(r"\[0, (\d+\.)", r"[1, \1", text, count=1), "more than once"),
        (lambda text: re.sub(r"\[0, \d+\.", "[0, NaN, 1.", text, count=1), "NaN"),
    ],
    ids=["cut off", "another program's", "newer version", "repeated corner", "NaN"],
)
def test_a_spoilt_detections_file_says_what_is_wrong(run, calibrated, tmp_path, spoil, word):
    text = (calibrated / "detections.json").read_text()
    (tmp_path / "spoilt.json").write_text(spoil(text))
    assert spoil(text) != text
    told = calibrate(run, tmp_path / "spoilt.json", out=tmp_path / "out")
    assert told.code == 2
    assert "spoilt.json" in told.err
    assert word in told.err, told.err
    assert not (tmp_path / "out").exists()


def test_an_output_folder_that_is_a_file_is_refused_before_any_work(run, photos, tmp_path):
    (tmp_path / "out").write_text("mine")
    told = calibrate(run, photos, "--target", TARGET, out=tmp_path / "out")
    assert told.code == 2
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not bind this user")
def test_an_output_folder_that_cannot_be_written_is_refused(run, photos, tmp_path):
    tmp_path.chmod(0o500)
    assert calibrate(run, photos, "--target", TARGET, out=tmp_path / "out").code == 2


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="interrupts are sent the POSIX way")
def test_an_interrupt_leaves_whole_files_or_none(photos, calibrated, tmp_path):
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-c",
        "from orthoscope.cli import main; main()",
        "calibrate",
        str(photos),
        "--target",
        TARGET,
        "-o",
        str(out),
    ]
    for delay in (0.3, 0.8, 1.3, 2.0):
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert process.returncode in (0, 130, -signal.SIGINT), err
        for path in out.rglob("*") if out.exists() else ():
            assert not path.name.endswith(".part")
            if path.suffix == ".json":
                json.loads(path.read_text())
