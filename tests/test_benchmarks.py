"""The benchmarks' page and peers: what is measured is another matter, and takes minutes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # benchmarks/ stands beside src/ and is no part of the package

from benchmarks.corner_files import write_corners  # noqa: E402
from benchmarks.page import Results, page, read_results, write_results  # noqa: E402
from benchmarks.peers import Peer, Peers  # noqa: E402
from benchmarks.race import race  # noqa: E402
from benchmarks.rows import Part, Row  # noqa: E402
from benchmarks.workers.pose_refit import refit_pose, rotation_of  # noqa: E402

from orthoscope import Camera, Detections, Intrinsics, Pose, View, chessboard  # noqa: E402
from orthoscope.models.lenses.table import Brown  # noqa: E402

CAMERA = Camera((640, 480), Intrinsics(750.0, 751.0, 321.0, 243.0), Brown(k1=-0.2, p1=0.001))
POSE = Pose(rotation_of(np.array([0.4, -0.3, 0.2])), np.array([-0.05, -0.04, 0.6]))


def results_of(*rows: Row, peers: Peers | None = None) -> Results:
    part = Part("Solving", "How it was done.", list(rows), ["A remark."])
    return Results().with_part("solving", part, machine="a machine", peers=peers or Peers({}), seconds=1.0)


def test_a_ratio_is_ours_over_theirs_and_is_what_a_budget_is_about():
    assert Row("time", 2.0, "OpenCV", 8.0, at_most=0.25).met
    assert not Row("time", 2.1, "OpenCV", 8.0, at_most=0.25).met
    assert Row("time", 2.0, "OpenCV", 8.0).met is None


def test_a_figure_without_a_peer_is_judged_by_itself():
    assert Row("help", 149.0, at_most=150.0).met
    assert not Row("help", 151.0, at_most=150.0).met


def test_the_page_is_written_from_the_file_of_results(tmp_path: Path):
    results = results_of(Row("15 views", 2.0, "OpenCV", 8.0, "ms", 0.2, "a note"))
    write_results(tmp_path / "results.json", results)
    text = page(read_results(tmp_path / "results.json"))
    assert text == page(results)
    assert "| 15 views | 0.25 | 0.2 | **no** | 2 | 8 | ms | OpenCV | a note |" in text
    assert "Budgets: 0 of 1 met" in text
    assert "a machine" in text


def test_a_part_that_is_measured_again_replaces_itself_and_leaves_the_others():
    before = results_of(Row("old", 1.0)).with_part(
        "points", Part("Points", ""), machine="", peers=Peers({}), seconds=0.0
    )
    after = before.with_part(
        "solving", Part("Solving", "", [Row("new", 1.0)]), machine="", peers=Peers({}), seconds=0.0
    )
    assert list(after.parts) == ["solving", "points"]
    assert [row.quantity for row in after.parts["solving"].part.rows] == ["new"]


def test_costs_that_differ_in_the_tenth_digit_can_be_told_apart():
    assert "1+2.0e-10" in page(results_of(Row("cost", 1.0 + 2e-10, "OpenCV", 1.0, "px²", 1.0 + 1e-9)))


def test_a_missing_peer_is_named_and_not_failed(tmp_path: Path):
    with Peers({"nobody": Peer(tmp_path / "python", "opencv_worker.py")}) as peers:
        assert "failed" in peers.ask("nobody", "solve")
        text = page(results_of(peers=peers))
    assert f"Missing: nobody (there is no {tmp_path / 'python'})" in text


def test_a_peer_that_cannot_be_imported_is_named_and_not_failed(tmp_path: Path):
    with Peers({"broken": Peer(Path(sys.executable), "no_such_worker.py")}) as peers:
        assert not peers.has("broken")
    assert "ended" in peers.missing["broken"]


def test_a_contender_that_fails_leaves_the_times_of_the_others():
    results = race({"good": lambda: {"cpu": 1e-3, "wall": 2e-3}, "bad": lambda: {"failed": "why"}}, rounds=2)
    assert (results["good"].cpu, results["good"].wall) == (1.0, 2.0)
    assert results["bad"].failed == "why"


def test_a_refitted_pose_is_the_one_of_least_squares():
    points = chessboard(6, 4, 0.03).points
    pixels = CAMERA.project(POSE.apply(points))
    start = rotation_of(np.array([0.05, 0.03, -0.04])) @ POSE.rotation, POSE.translation + 0.02
    error = refit_pose(CAMERA.project, points, pixels, start)
    assert (
        np.abs(error).max() < 1e-6
    )  # differences of 1e-6 are good to 1e-9 of the slopes, which only slows the last steps


@pytest.mark.slow
def test_this_project_answers_as_a_worker_does(tmp_path: Path):
    target = chessboard(6, 4, 0.03)
    tilts = [np.array([a, b, 0.1]) for a in (-0.5, 0.1, 0.5) for b in (-0.4, 0.3)]
    poses = tuple(Pose(rotation_of(tilt), np.array([-0.07, -0.05, 0.5])) for tilt in tilts)
    views = tuple(
        View(f"{i}", np.arange(24), CAMERA.project(pose.apply(target.points))) for i, pose in enumerate(poses)
    )
    path = write_corners(
        tmp_path / "corners.npz", Detections(target, CAMERA.image_size, views), CAMERA, poses
    )
    with Peers() as peers:
        solved = peers.ask("orthoscope", "solve", path=path, kind="brown")
        unseen = peers.ask("orthoscope", "held_out", path=path, kind="brown", folds=[[0, 1], [2]])
        opencv = peers.ask("OpenCV", "solve", path=path, kind="flat 5")
    assert solved["rms"] < 1e-6  # without noise a solver stops when the cost is rounding
    assert opencv["rms"] < 1e-3  # OpenCV keeps corners in single precision, which is 3e-5 px here
    assert max(max(lengths) for lengths in unseen["lengths"]) < 1e-5
