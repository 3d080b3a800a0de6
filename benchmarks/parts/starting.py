"""From cold: help, import, a calibration from photographs, a calibration from a file of corners; whole
processes.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.parts.solving import USUAL
from benchmarks.peers import HERE, PEERS, Peers
from benchmarks.race import ORTHOSCOPE, Result, race, whole_process
from benchmarks.real_sets import datasets
from benchmarks.rows import Part, Row
from orthoscope.formats.corners_vnl import write_vnl
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

__all__ = ["starting"]

HEAVY = ("numpy", "cv2", "scipy", "matplotlib")
LOADED = (
    "import sys; from orthoscope.cli import verbs; verbs(['--help'], standalone_mode=False); print('LOADED',"
    " *sys.modules)"
)
BUDGETS = {15: 0.2, 200: 0.05}
ABOUT = (
    "Wall time of whole processes, the best of several rounds, files in the page cache, as many threads as"
    " each tool likes. calibrate from photographs: the 14 of opencv-left, with the held-out evaluation and"
    " report page that belong to it, against a script of findChessboardCorners, cornerSubPix and"
    " calibrateCamera, which gives a camera and no more. calibrate from corners: 14x20 of them a view in a"
    " corners.vnl table, against mrcal-calibrate-cameras with LENSMODEL_OPENCV5; once as it is by default,"
    " once without the report page."
)


def starting(peers: Peers, folder: Path) -> Part:
    """Help, import, calibrating."""
    part = Part("Starting", ABOUT)
    _help(part)
    _from_photographs(part, folder)
    for count, budget in BUDGETS.items():
        _from_corners(part, folder, count, budget)
    return part


def _help(part: Part) -> None:
    python = sys.executable
    results = race(
        {
            "orthoscope --help": lambda: whole_process([ORTHOSCOPE, "--help"]),
            "import orthoscope": lambda: whole_process([python, "-c", "import orthoscope"]),
            "import cv2": lambda: whole_process([python, "-c", "import cv2"]),
            "Python by itself": lambda: whole_process([python, "-c", "pass"]),
        },
        rounds=9,
    )
    loaded = whole_process([python, "-c", LOADED]).get("out", "").partition("LOADED")[2].split()
    heavy = [name for name in HEAVY if name in loaded]
    part.rows.append(Row("orthoscope --help", results["orthoscope --help"].wall, unit="ms", at_most=150.0))
    part.rows.append(
        Row("heavy modules that it imports", float(len(heavy)), unit="", at_most=0.0, note=", ".join(heavy))
    )
    for name in ("import orthoscope", "import cv2", "Python by itself"):
        part.rows.append(Row(name, results[name].wall, unit="ms"))


def _from_photographs(part: Part, folder: Path) -> None:
    data = datasets()
    if data is None:
        part.remarks.append("The photographs are not there; ORTHOSCOPE_DATASETS names their folder.")
        return
    photographs, out = data / "opencv-left", folder / "from-photographs"
    ours = [ORTHOSCOPE, "calibrate", photographs, "--target", "chessboard:9x6:25mm", "-o", out]
    script = [PEERS["OpenCV"].python, HERE / "workers/opencv_tutorial.py", photographs]
    _row(part, "calibrate, 14 photographs", {"ours": ours, "theirs": script}, ("OpenCV script", None))
    plainly = [*ours, "--method", "fccm", "--no-report"]
    _row(
        part,
        "calibrate --method fccm --no-report, 14 photographs",
        {"ours": plainly, "theirs": script},
        ("OpenCV script", None),
    )


def _from_corners(part: Part, folder: Path, count: int, budget: float) -> None:
    table = folder / f"corners-{count}.vnl"
    _write_table(table, count)
    width, height = USUAL.image_size
    size, square = (
        f"{width}x{height}",
        ["--object-spacing", "0.015625", "--object-width-n", "14", "--object-height-n", "20"],
    )
    out = [folder / f"{who}-{count}" for who in ("ours", "theirs")]
    for each in out:
        each.mkdir(exist_ok=True)
    ours = [
        ORTHOSCOPE,
        "calibrate",
        table,
        "--target",
        "chessboard:14x20:15.625mm",
        "--image-size",
        size,
        "--lens",
        "brown",
        "-o",
        out[0],
    ]
    theirs = [
        "mrcal-calibrate-cameras",
        "--corners-cache",
        table,
        "--lensmodel",
        "LENSMODEL_OPENCV5",
        "--focal",
        "750",
        *square,
    ]
    theirs += ["--imagersize", str(width), str(height), "--outdir", out[1], "view*"]
    for name, extra, at_most in (
        ("calibrate", [], budget),
        ("calibrate --method fccm --no-report", ["--method", "fccm", "--no-report"], None),
    ):
        quantity = f"{name}, {count} views in a file"
        _row(
            part, quantity, {"ours": [*ours, *extra], "theirs": theirs}, ("mrcal-calibrate-cameras", at_most)
        )


def _write_table(path: Path, count: int) -> None:
    rng, target = np.random.default_rng(count), chessboard(14, 20, 1 / 64)
    scene = Scene(USUAL, target, random_views(USUAL, target, count, rng=rng))
    detections = simulate_detections(scene, noise_px=0.1, rng=rng)
    views = tuple(View(f"{view.image}.png", view.ids, view.pixels) for view in detections.views)
    write_vnl(Detections(target, USUAL.image_size, views), path)


def _row(
    part: Part, quantity: str, commands: dict[str, list[Any]], against: tuple[str, float | None]
) -> None:
    peer, budget = against
    results: dict[str, Result] = race(
        {who: lambda command=command: whole_process(command) for who, command in commands.items()}, rounds=3
    )
    ours, theirs = results["ours"], results["theirs"]
    if ours.failed or theirs.failed:
        part.remarks.append(f"{quantity}: {ours.failed or theirs.failed}.")
        return
    note = f"process CPU {ours.cpu:.0f} and {theirs.cpu:.0f} ms"
    part.rows.append(Row(quantity, ours.wall, peer, theirs.wall, "ms", budget, note))
