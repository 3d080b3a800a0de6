"""Absurd targets, names that command a terminal, a full disk, files that never answer: one sentence each."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from orthoscope.cli.shared.executors import threads
from orthoscope.formats.export import export
from orthoscope.formats.own.json import load, save
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.simulation.scene import simulate_detections
from orthoscope.targets.detections import Detections, SetAside

MAIN = "from orthoscope.cli import main; main()"
LIMIT = 60.0  # seconds that a busy machine may take


@pytest.mark.parametrize(
    "spec",
    [
        "chessboard:99999x99999:25mm",
        "chessboard:9999x9999:25mm",
        "chessboard:9x6:1e308mm",
        "chessboard:9x6:-3mm",
        "chessboard:9x6:1e-320mm",
        "charuco:9999x9999:25mm:1mm:DICT_4X4_50",
        "charuco:9x6:1e308mm:1mm:DICT_4X4_50",
        "aprilgrid:99999x99999:1mm:0.3",
        "aprilgrid:6x6:1e308mm:0.3",
    ],
)
def test_a_target_that_nobody_prints_is_refused_in_a_sentence(run, tmp_path, spec):
    told = run("target", spec, "-o", tmp_path / "board.svg")
    assert told.code == 2
    assert told.err.startswith("orthoscope: ")
    assert "cannot be used; expected" in told.err
    assert told.err.count("\n") == 1


def test_names_out_of_files_command_no_terminal(run, scene, tmp_path):
    whole = simulate_detections(scene, noise_px=0.1, rng=np.random.default_rng(0))
    aside = (SetAside("\x1b[2Jgone\nwrote      all.png", "no board"),)
    save(Detections(whole.target, whole.image_size, whole.views, aside), tmp_path / "detections.json")
    for how in ((), ("--json",)):
        told = run("detect", tmp_path / "detections.json", *how, "-o", tmp_path / "out.json")
        assert told.code == 0, told.err
        assert "\x1b" not in told.out
        assert "\nwrote      all" not in told.out
        assert r"[2Jgone\nwrote" in told.out


@pytest.mark.parametrize("arguments", [("tools",), ("evaluate", "\x1b[2J\nmissing.json"), ("\x1b[2Jdance",)])
def test_a_message_has_no_command_to_a_terminal(run, arguments):
    told = run(*arguments)
    assert "\x1b" not in told.out + told.err


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no full device")
@pytest.mark.parametrize("arguments", [["tools"], ["--help"]])
def test_a_full_disk_under_what_is_printed_is_one_sentence(arguments):
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-c", MAIN, *arguments]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=LIMIT)
    assert done.returncode == 2
    assert done.stderr == (
        "orthoscope: what is printed or written finds no place (No space left on device); free some.\n"
    )


@pytest.mark.skipif(os.name != "posix", reason="pipes are named the POSIX way")
def test_sigterm_ends_a_verb_whose_file_never_answers(tmp_path):
    os.mkfifo(tmp_path / "camera.json")
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, "evaluate", str(tmp_path / "camera.json")],
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(1.0)  # it then waits; before, it is stopped as well
    process.send_signal(signal.SIGTERM)
    _, told = process.communicate(timeout=LIMIT)
    assert (process.returncode, told.strip()) in (
        (130, "stopped; files already written are whole"),
        (-signal.SIGTERM, ""),  # on a machine so busy that nothing of ours was loaded yet
    )


def test_a_thread_that_never_answers_is_not_waited_for(monkeypatch):
    monkeypatch.setattr("orthoscope.cli.shared.executors.PATIENCE", 0.1)
    hold, begun = threading.Event(), time.monotonic()

    def stopped() -> None:
        with threads(1) as executor:
            executor.submit(hold.wait, LIMIT)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert time.monotonic() - begun < LIMIT / 2
    hold.set()


@pytest.mark.parametrize(
    ("error", "words"), [(BrokenProcessPool(), "--jobs 1"), (MemoryError(), "not enough memory")]
)
def test_a_killed_worker_and_want_of_memory_leave_with_1(run, monkeypatch, error, words):
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(sys.modules["orthoscope.cli.export"], "tool_lines", fail)
    told = run("tools")
    assert told.code == 1
    assert words in told.err
    assert told.err.count("\n") == 1


def test_a_file_that_is_not_there_is_no_camera_to_compare(run, tmp_path):
    told = run("compare", tmp_path, "--with", "camera_info.yaml", "-o", tmp_path / "out")
    assert told.code == 2
    assert "'camera_info.yaml' is neither a method nor a file that is there" in told.err


@pytest.fixture
def corners(scene, tmp_path):
    path = tmp_path / "corners.json"
    save(simulate_detections(scene, noise_px=0.1, rng=np.random.default_rng(0)), path)
    return path


@pytest.mark.slow
def test_another_programs_camera_has_a_verdict_on_photographs(run, scene, corners, tmp_path):
    for focal, verdict in (
        (1.0, "Good: the camera that these photographs give by themselves"),
        (1.05, "Do not use this camera: "),
    ):
        camera = replace(scene.camera, intrinsics=Intrinsics(520.0 * focal, 518.0 * focal, 324.0, 236.0))
        export(camera, tmp_path / "camera.yaml", "opencv")
        told = run(
            *("evaluate", tmp_path / "camera.yaml", "--on", corners, "--target", "chessboard:9x6:25mm")
        )
        assert told.code == 0, told.err
        assert told.out.startswith(f"verdict    {verdict}")
        assert ("the focal length is 4.8 % shorter" in told.out) == (focal > 1.0)


def test_another_programs_camera_is_compared_as_it_is(run, scene, corners, tmp_path):
    """The true camera foresees all views by their noise alone; one of another focal length does not."""
    for name, focal in (("true.yaml", 1.0), ("old.yaml", 1.05)):
        camera = replace(scene.camera, intrinsics=Intrinsics(520.0 * focal, 518.0 * focal, 324.0, 236.0))
        export(camera, tmp_path / name, "opencv")
    told = run(
        *("compare", corners, "-o", tmp_path / "out", "--with", "fccm:brown"),
        *("--with", tmp_path / "true.yaml", "--with", tmp_path / "old.yaml"),
    )
    assert told.code == 0, told.err
    standings = load(tmp_path / "out" / "comparison.json").standings
    assert [Path(one.entry.name).name for one in standings] == ["true.yaml", "fccm:brown", "old.yaml"]
    assert standings[0].entry.camera is not None
    assert standings[0].held_out_px == pytest.approx(0.1 * np.sqrt(2.0), rel=0.1)


def test_without_opencv_one_is_told_what_to_install(run, monkeypatch):
    def fail() -> None:
        raise ModuleNotFoundError("No module named 'cv2'", name="cv2")

    monkeypatch.setattr(sys.modules["orthoscope.cli.export"], "tool_lines", fail)
    told = run("tools")
    assert told.code == 2
    assert "pip install 'orthoscope[opencv]'" in told.err


def test_reasons_stand_one_below_the_other_and_names_stay_on_their_line(run, tmp_path):
    for name in ("one.png", "two\x1b[2J.png"):
        cv2.imwrite(str(tmp_path / name), np.full((60, 80), 90, np.uint8))
    told = run("detect", tmp_path, "--target", "chessboard:9x6:25mm", "-o", tmp_path / "corners.json")
    first, *listed = told.err.splitlines()[-3:]
    assert told.code == 1
    assert first.startswith("orthoscope: chessboard:9x6:25mm was found in none of 2 photographs")
    assert [line.split(":")[0] for line in listed] == ["  one.png", "  two\\x1b[2J.png"]
