"""Full calibration to the same minimum: time, growth, memory, and what the covariance costs."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.corner_files import write_corners
from benchmarks.peers import Peers
from benchmarks.race import Result, race
from benchmarks.rows import Part, Row
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

__all__ = ["COUNTS", "ROUNDS", "scene_file", "solving"]

COUNTS = (15, 50, 200, 1000)
ROUNDS = {15: 15, 50: 9, 200: 5, 1000: 3}
NOISE = 0.1  # px
SAME = 1.0 + 1e-9  # of two costs
USUAL = Camera(
    (640, 480),
    Intrinsics(750.0, 751.0, 321.0, 243.0),
    Brown(k1=-0.25, k2=0.08, p1=0.0008, p2=-0.0006, k3=0.02),
)
WIDE = Camera(
    (1280, 960), Intrinsics(620.0, 621.0, 642.0, 477.0), KannalaBrandt(k1=-0.02, k2=0.003, k3=-0.001)
)
ABOUT = (
    "Simulated views of 14x20 corners, noise 0.1 px, every corner in every view. Process CPU time of one"
    " call, initialisation included, one thread, the best of several rounds in which all take turns. OpenCV"
    " has 100 iterations and 1e-10; mrcal and lensboy estimate no warp and reject no outliers here. Square"
    " and pixels are chosen so that OpenCV's single precision holds them exactly."
)


def solving(peers: Peers, folder: Path) -> Part:
    """Formula lenses, 15 to 1000 views, against OpenCV, mrcal and lensboy."""
    part = Part("Solving", ABOUT)
    files = {count: scene_file(folder, count) for count in COUNTS}
    for lens, flat, budget in (("brown", "flat 5", 0.25), ("rational", "flat 8", 0.5)):
        times = {
            count: _against_opencv(part, peers, files[count], count, (lens, flat, budget)) for count in COUNTS
        }
        _growth(part, lens, times)
    for count in COUNTS[:3]:
        for peer, kind, budget in (("mrcal", "OPENCV5 plain", 0.20), ("lensboy", "5 plain", 0.05)):
            _row(part, peers, files[count], count, ("brown", peer, kind, budget))
    wide = scene_file(folder, 200, camera=WIDE, name="wide")
    _row(part, peers, wide, 200, ("kannala_brandt", "OpenCV", "fisheye", 0.05))
    _memory(part, peers, files[1000])
    _covariance(part, peers, files)
    return part


def scene_file(folder: Path, count: int, *, camera: Camera = USUAL, name: str = "usual") -> str:
    """So many simulated views in a file; the same for the same count."""
    rng = np.random.default_rng(count)
    target = chessboard(14, 20, 1 / 64)
    scene = Scene(camera, target, random_views(camera, target, count, rng=rng))
    detections = _single_precision(simulate_detections(scene, noise_px=NOISE, rng=rng))
    return write_corners(folder / f"{name}-{count}.npz", detections, camera, scene.camera_from_target)


def solver(peers: Peers, peer: str, path: str, kind: str) -> Callable[[], dict[str, Any]]:
    """A contender of a race."""
    return lambda: peers.ask(peer, "solve", path=path, kind=kind)


def _single_precision(detections: Detections) -> Detections:
    views = tuple(View(view.image, view.ids, view.pixels.astype(np.float32)) for view in detections.views)
    return Detections(detections.target, detections.image_size, views)


def _against_opencv(part: Part, peers: Peers, path: str, count: int, what: tuple[str, str, float]) -> Result:
    lens, flat, budget = what
    ours, theirs = _row(part, peers, path, count, (lens, "OpenCV", flat, budget))
    if not (ours.failed or theirs.failed):
        costs = ours.answer["rms"] ** 2, theirs.answer["rms"] ** 2
        note = f"{costs[0] / costs[1] - 1.0:+.1e}"
        part.rows.append(Row(f"{lens}, {count} views: cost", costs[0], "OpenCV", costs[1], "px²", SAME, note))
    return ours


def _row(
    part: Part, peers: Peers, path: str, count: int, what: tuple[str, str, str, float | None]
) -> tuple[Result, Result]:
    """One race of ours against a peer; its row, or why there is none."""
    lens, peer, kind, budget = what
    contenders = {"ours": solver(peers, "orthoscope", path, lens), "theirs": solver(peers, peer, path, kind)}
    results = race(contenders, rounds=ROUNDS[count])
    ours, theirs = results["ours"], results["theirs"]
    quantity, name = f"{lens}, {count} views", f"{peer} {kind}"
    if ours.failed or theirs.failed:
        part.remarks.append(f"{quantity}, against {name}: {ours.failed or theirs.failed}.")
    else:
        note = (
            f"wall {ours.wall / theirs.wall:.2f}; rms {ours.answer['rms']:.5f} and {theirs.answer['rms']:.5f}"
        )
        part.rows.append(Row(quantity, ours.cpu, name, theirs.cpu, "ms", budget, note))
    return ours, theirs


def _growth(part: Part, lens: str, times: dict[int, Result]) -> None:
    """The exponent of time over views, from the fewest to the most."""
    first, last = min(times), max(times)
    if not (times[first].failed or times[last].failed):
        exponent = math.log(times[last].cpu / times[first].cpu) / math.log(last / first)
        part.rows.append(
            Row(f"{lens}: growth exponent, {first} to {last} views", exponent, unit="", at_most=1.05)
        )


def _memory(part: Part, peers: Peers, path: str) -> None:
    """The most memory that a fresh process held for the largest problem, everything that it had to import
    included.
    """
    held: dict[str, float] = {}
    for peer, kind in (("orthoscope", "brown"), ("OpenCV", "flat 5")):
        peers.stop(peer)
        peers.ask(peer, "solve", path=path, kind=kind)
        held[peer] = peers.ask(peer, "peak").get("megabytes", math.nan)
    part.rows.append(
        Row("peak memory, 1000 views", held["orthoscope"], "OpenCV flat 5", held["OpenCV"], "MB", 1.0)
    )


def _covariance(part: Part, peers: Peers, files: dict[int, str]) -> None:
    for count, path in files.items():
        answers = [
            peers.ask("orthoscope", "covariance", path=path, kind="brown") for _ in range(ROUNDS[count])
        ]
        if failed := next((answer["failed"] for answer in answers if "failed" in answer), None):
            part.remarks.append(f"covariance: {failed}.")
            return
        share = min(answer["covariance"] for answer in answers) / min(answer["cpu"] for answer in answers)
        part.rows.append(
            Row(f"covariance, {count} views: share of the whole", 100.0 * share, unit="%", at_most=5.0)
        )
