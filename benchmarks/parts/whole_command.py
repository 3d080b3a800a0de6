"""The whole command as a user waits for it: photographs or corners in, camera, verdict and page out; whole
processes, by their CPU time and their memory at its peak.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.parts.solving import USUAL
from benchmarks.peers import HERE, ONE_THREAD, PEERS, Peers
from benchmarks.race import ORTHOSCOPE, Result, race, whole_process
from benchmarks.real_sets import datasets
from benchmarks.rows import Part, Row
from orthoscope.formats.corners_vnl import write_vnl
from orthoscope.formats.own.json import save
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

__all__ = ["whole_command"]

SETS = {  # real photographs, and what they show
    "opencv-left": "chessboard:9x6:25mm",
    "udacity": "chessboard:9x6:25mm",
    "calibrel": "chessboard:16x10:20mm",
    "fisheye-180": "chessboard:4x6:30mm",
}
DEFAULT = {15: 1.5, 200: 1.0, 1000: 1.0}  # views: budget over mrcal-calibrate-cameras
PLAIN = {15: 0.3, 200: 0.15, 1000: 0.15}  # the same for fccm alone
MEMORY_MB = 700.0  # of 1000 views of 280 corners
EMPTY = {(640, 480): 100.0, (1920, 1080): 400.0, (4000, 3000): 800.0}  # width, height: budget, ms
MRCAL = "mrcal-calibrate-cameras"
FINDING = """
import sys, time
from orthoscope.detection.detect import detect
from orthoscope.geometry.arrays import CalibrationError
def find():
    start = time.process_time()
    try:
        detect(sys.argv[1:], "chessboard:9x6:25mm", jobs=1)
    except CalibrationError:
        pass
    return time.process_time() - start
find()
print(min(find() for _ in range(3)))
"""
ABOUT = (
    "Whole processes from cold, process CPU time with one thread of BLAS, the best of a few rounds. calibrate"
    " as it is by default: the choice of target shape and lens, the evaluation and the page; from photographs"
    " against a script of findChessboardCorners, cornerSubPix and calibrateCamera, which gives a camera and"
    " no more; from 14x20 corners a view in a table against mrcal-calibrate-cameras with LENSMODEL_OPENCV5."
    " Without a board: photographs of noise and of rectangles, by themselves, in a process that has started."
)


def whole_command(peers: Peers, folder: Path) -> Part:
    """Calibrating from photographs and from corners, and looking at photographs without a board."""
    part = Part("The whole command", ABOUT)
    _from_photographs(part, folder)
    for count in DEFAULT:
        _from_corners(part, folder, count)
    _many_corners(part, folder)
    _without_board(part, folder)
    return part


def _from_photographs(part: Part, folder: Path) -> None:
    data = datasets()
    if data is None:
        part.remarks.append("The photographs are not there; ORTHOSCOPE_DATASETS names their folder.")
        return
    for name, target in SETS.items():
        files = sorted(path for path in (data / name).iterdir() if path.suffix in (".jpg", ".png"))
        ours = [ORTHOSCOPE, "calibrate", *files, "--target", target, "-o", folder / name]
        if name != "opencv-left":
            _row(part, f"calibrate, {name}", {"ours": ours}, None, rounds=1)
            continue
        script = [PEERS["OpenCV"].python, HERE / "workers/opencv_tutorial.py", data / name]
        _row(
            part,
            f"calibrate, {len(files)} photographs",
            {"ours": ours, "theirs": script},
            ("OpenCV script", 6.0),
        )
        _threads(part, ours, folder / name)


def _threads(part: Part, ours: list[Any], out: Path) -> None:
    """The same with nothing set in the environment, over one thread set in it; the files must be the same."""
    free = {name: value for name, value in os.environ.items() if name not in ONE_THREAD}
    seen: dict[str, bytes] = {}

    def run(who: str, env: Mapping[str, str]) -> dict[str, Any]:
        answer = whole_process(ours, env=env)
        seen[who] = b"".join(path.read_bytes() for path in sorted(out.glob("*.json")))
        return answer

    results = race(
        {"free": lambda: run("free", free), "pinned": lambda: run("pinned", free | ONE_THREAD)}, rounds=3
    )
    same = "the files are the same" if seen["free"] == seen["pinned"] else "the files differ"
    quantity = "the same, no variable set in the environment"
    part.rows.append(
        Row(quantity, results["free"].cpu, "one thread set", results["pinned"].cpu, "ms", 1.05, same)
    )


def _from_corners(part: Part, folder: Path, count: int) -> None:
    table = folder / f"corners-{count}.vnl"
    _write_table(table, count)
    width, height = USUAL.image_size
    out = [folder / f"{who}-{count}" for who in ("ours", "theirs")]
    for each in out:
        each.mkdir(exist_ok=True)
    ours = [ORTHOSCOPE, "calibrate", table, "--target", "chessboard:14x20:15.625mm"]
    ours += ["--image-size", f"{width}x{height}", "-o", out[0]]
    theirs = [MRCAL, "--corners-cache", table, "--lensmodel", "LENSMODEL_OPENCV5", "--focal", "750"]
    theirs += ["--object-spacing", "0.015625", "--object-width-n", "14", "--object-height-n", "20"]
    theirs += ["--imagersize", str(width), str(height), "--outdir", out[1], "view*"]
    plain = "calibrate --method fccm --no-report"
    commands = {"calibrate": ours, plain: [*ours, *plain.split()[1:]], MRCAL: theirs}
    results = _raced(commands, rounds=2 if count < 500 else 1)
    for words, budgets in (("calibrate", DEFAULT), (plain, PLAIN)):
        quantity, against = f"{words}, {count} views", (MRCAL, budgets[count])
        found = _told(part, quantity, results[words], results[MRCAL], against)
        if found and words != plain:
            budget = MEMORY_MB if count == 1000 else None
            memory = found.answer["memory"]
            part.rows.append(Row(f"the same, memory, {count} views", memory, unit="MB", at_most=budget))


def _many_corners(part: Part, folder: Path) -> None:
    """40 x 30 corners in 30 views, target and lens free."""
    rng, target = np.random.default_rng(40), chessboard(40, 30, 0.01)
    camera = Camera((1920, 1440), Intrinsics(1500.0, 1500.0, 959.5, 719.5), Brown(k1=-0.2, k2=0.05))
    scene = Scene(camera, target, random_views(camera, target, 30, rng=rng))
    save(simulate_detections(scene, noise_px=0.1, rng=rng), folder / "many.json")
    command = [ORTHOSCOPE, "calibrate", folder / "many.json", "--shape", "free", "--lens", "free"]
    quantity = "calibrate, 40x30 corners, 30 views, target and lens free"
    found = _row(
        part, quantity, {"ours": [*command, "-o", folder / "many"]}, None, rounds=1, at_most=10_000.0
    )
    if found:
        part.rows.append(Row("the same, memory", found.answer["memory"], unit="MB", at_most=1000.0))


def _without_board(part: Part, folder: Path) -> None:
    for (width, height), budget in EMPTY.items():
        path = folder / f"empty-{width}.png"
        cv2.imwrite(str(path), _clutter(width, height))
        answer = whole_process([sys.executable, "-c", FINDING, path])
        if "failed" in answer:
            part.remarks.append(f"a photograph without a board: {answer['failed']}.")
            continue
        quantity = f"a photograph without a board, {width}x{height}"
        part.rows.append(Row(quantity, 1e3 * float(answer["out"].split()[-1]), unit="ms", at_most=budget))


def _clutter(width: int, height: int) -> np.ndarray:
    """Rectangles of all sizes in all directions, and noise: corners everywhere, a board nowhere."""
    rng = np.random.default_rng(width)
    image = np.full((height, width), 127, dtype=np.uint8)
    for _ in range(120):
        box = (
            (rng.uniform(0, width), rng.uniform(0, height)),
            rng.uniform(8, width / 5, 2).tolist(),
            rng.uniform(0, 180),
        )
        cv2.fillPoly(image, [cv2.boxPoints(box).astype(np.int32)], int(rng.integers(0, 256)), cv2.LINE_AA)
    return np.clip(image + rng.normal(0.0, 6.0, image.shape), 0, 255).astype(np.uint8)


def _write_table(path: Path, count: int) -> None:
    rng, target = np.random.default_rng(count), chessboard(14, 20, 1 / 64)
    scene = Scene(USUAL, target, random_views(USUAL, target, count, rng=rng))
    detections = simulate_detections(scene, noise_px=0.1, rng=rng)
    views = tuple(View(f"{view.image}.png", view.ids, view.pixels) for view in detections.views)
    write_vnl(Detections(target, USUAL.image_size, views), path)


def _row(
    part: Part,
    quantity: str,
    commands: dict[str, list[Any]],
    against: tuple[str, float] | None,
    *,
    rounds: int = 3,
    at_most: float | None = None,
) -> Result | None:
    """Adds a row of CPU time; returns our result where there is one."""
    results = _raced(commands, rounds=rounds)
    return _told(part, quantity, results["ours"], results.get("theirs"), against, at_most=at_most)


def _raced(commands: dict[str, list[Any]], *, rounds: int) -> dict[str, Result]:
    """Whole processes that take turns, BLAS with one thread."""
    env = os.environ | ONE_THREAD
    return race(
        {who: lambda command=command: whole_process(command, env=env) for who, command in commands.items()},
        rounds=rounds,
    )


def _told(
    part: Part,
    quantity: str,
    ours: Result,
    theirs: Result | None,
    against: tuple[str, float] | None,
    *,
    at_most: float | None = None,
) -> Result | None:
    """Adds a row of what has been raced; returns our result where there is one."""
    for each in (ours, theirs):
        if each and each.failed:
            part.remarks.append(f"{quantity}: {each.failed}.")
    if ours.failed:
        return None
    note = f"{ours.wall:.0f} ms by the clock"
    if against and theirs and not theirs.failed:
        note = f"{ours.wall:.0f} and {theirs.wall:.0f} ms by the clock"
        part.rows.append(Row(quantity, ours.cpu, against[0], theirs.cpu, "ms", against[1], note))
    else:
        part.rows.append(Row(quantity, ours.cpu, unit="ms", at_most=at_most, note=note))
    return ours
