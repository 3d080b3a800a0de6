"""Straight pictures: a folder of photographs, a video, one photograph; whole processes, as a user
runs them.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.peers import HERE, PEERS, Peers
from benchmarks.race import ORTHOSCOPE, race, whole_process
from benchmarks.rows import Part, Row
from orthoscope.files.images import read_image
from orthoscope.fitting.calibration import Calibration
from orthoscope.formats.own.json import save
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import rendered_photographs
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.target import chessboard

__all__ = ["undistorting"]

COUNT, FRAMES, PICTURES = 200, 120, 4
ROUNDS = 3
MAP_ROUNDS = 9
SIZE = (1920, 1080)
DISCORPY_TIMES = 3
ABOUT = (
    f"{COUNT} colour JPEG photographs of 1920x1080 ({PICTURES} rendered ones, copied), and a video of"
    f" {FRAMES} such frames. Wall time of the whole process, starting included, the best of several rounds;"
    " files in the page cache. OpenCV: a plain loop of imread, remap (fixed maps, made once, as many threads"
    " as it likes) and imwrite in one process. discorpy: one grey photograph in memory, its polynomial"
    " model, no file; ours with its map made anew each time."
)


def undistorting(peers: Peers, folder: Path) -> Part:
    """Photographs and frames a second."""
    part = Part("Undistorting photographs", ABOUT)
    calibration = _calibration()
    saved, told = folder / "calibration.json", folder / "camera.npz"
    save(calibration, saved)
    _tell_opencv(calibration.camera, told)
    files = _photographs(folder / "photographs", calibration)
    _race(part, folder, ("all cores, folder", saved, told, files, COUNT), [], 0.55)
    _race(part, folder, ("one job, folder", saved, told, files, COUNT), ["--jobs", "1"], None)
    _race(
        part, folder, ("all cores, video", saved, told, _video(folder / "clip.mp4", files), FRAMES), [], None
    )
    _against_discorpy(part, peers, str(next(files.iterdir())), saved)
    _map_alone(part, calibration.camera)
    return part


def _calibration() -> Calibration:
    camera = Camera(
        SIZE,
        Intrinsics(1360.0, 1357.0, 965.0, 535.0),
        Brown(k1=-0.31, k2=0.13, p1=0.0011, p2=-0.0007, k3=-0.025),
    )
    target, rng = chessboard(14, 9, 0.02), np.random.default_rng(0)
    scene = Scene(camera, target, random_views(camera, target, 15, rng=rng))
    return fccm(simulate_detections(scene, noise_px=0.1, rng=rng), lens="brown")


def _tell_opencv(camera: Camera, path: Path) -> None:
    matrix, straight = camera.intrinsics.matrix, camera.straight_intrinsics("all").matrix
    np.savez(
        path,
        matrix=matrix,
        lens=camera.lens.coefficients[:5],
        straight=straight,
        image_size=np.array(camera.image_size),
    )


def _photographs(folder: Path, calibration: Calibration) -> Path:
    """A folder of photographs, by the camera of the calibration."""
    folder.mkdir()
    scene = Scene(calibration.camera, chessboard(14, 9, 0.02), calibration.camera_from_target[:PICTURES])
    pictures = [
        cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
        for _, grey in rendered_photographs(scene, rng=np.random.default_rng(0))
    ]
    for i in range(COUNT):
        if i < PICTURES:
            cv2.imwrite(str(folder / f"{i:03d}.jpg"), pictures[i])
        else:
            shutil.copyfile(folder / f"{i % PICTURES:03d}.jpg", folder / f"{i:03d}.jpg")
    return folder


def _video(path: Path, files: Path) -> Path:
    frames = [read_image(files / f"{i:03d}.jpg") for i in range(PICTURES)]
    clip = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, SIZE)
    for i in range(FRAMES):
        clip.write(frames[i % PICTURES])
    clip.release()
    return path


def _race(
    part: Part,
    folder: Path,
    what: tuple[str, Path, Path, Path, int],
    options: list[str],
    budget: float | None,
) -> None:
    """One race of our verb against the loop; its row, or why there is none."""
    quantity, saved, told, source, count = what
    loop = HERE / "workers/opencv_folder.py"

    def ours() -> dict[str, Any]:
        return _cleaned(
            folder / "ours", [ORTHOSCOPE, "undistort", saved, source, "-o", folder / "ours", *options]
        )

    def theirs() -> dict[str, Any]:
        return _cleaned(folder / "theirs", [PEERS["OpenCV"].python, loop, told, source, folder / "theirs"])

    results = race({"ours": ours, "theirs": theirs}, rounds=ROUNDS)
    mine, others = results["ours"], results["theirs"]
    if mine.failed or others.failed:
        part.remarks.append(f"{quantity}: {mine.failed or others.failed}.")
        return
    rates = [1e3 * count / wall for wall in (mine.wall, others.wall)]
    note = f"{rates[0]:.3g} and {rates[1]:.3g} a second; process CPU {mine.cpu:.0f} and {others.cpu:.0f} ms"
    part.rows.append(Row(quantity, mine.wall, "OpenCV loop", others.wall, "ms", budget, note))


def _cleaned(out: Path, command: list[str | Path]) -> dict[str, Any]:
    shutil.rmtree(out, ignore_errors=True)
    return whole_process(command)


def _map_alone(part: Part, camera: Camera) -> None:
    """The map of one size of photograph, nothing read, looked up or written; one thread for each."""
    straight, threads = camera.straight_intrinsics("all"), cv2.getNumThreads()

    def timed(make: Callable[[], object]) -> dict[str, Any]:
        wall, cpu = time.perf_counter(), time.process_time()
        make()
        return {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}

    def theirs() -> object:
        return cv2.initUndistortRectifyMap(
            camera.intrinsics.matrix,
            camera.lens.coefficients[:5],
            np.eye(3),
            straight.matrix,
            SIZE,
            cv2.CV_32FC1,
        )

    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):  # of BLAS: threads that wait are CPU time too
            results = race(
                {
                    "ours": lambda: timed(lambda: camera.undistort_map(straight, SIZE)),
                    "theirs": lambda: timed(theirs),
                },
                rounds=MAP_ROUNDS,
            )
    finally:
        cv2.setNumThreads(threads)
    ours, theirs_ = results["ours"], results["theirs"]
    part.rows.append(
        Row(
            "map alone, 1920x1080",
            ours.cpu,
            "initUndistortRectifyMap",
            theirs_.cpu,
            "ms",
            1.2,
            "process CPU, one thread",
        )
    )


def _against_discorpy(part: Part, peers: Peers, path: str, saved: Path) -> None:
    """One photograph through a polynomial of the same strength."""
    request = {"path": path, "times": DISCORPY_TIMES}
    results = race(
        {
            "ours": lambda: peers.ask("orthoscope", "straighten", calibration=str(saved), **request),
            "theirs": lambda: peers.ask(
                "discorpy", "straighten", centre=[965.0, 535.0], factors=[1.0, 0.0, -1.6e-7], **request
            ),
        },
        rounds=ROUNDS,
    )
    ours, theirs = results["ours"], results["theirs"]
    if ours.failed or theirs.failed:
        part.remarks.append(f"one photograph, against discorpy: {ours.failed or theirs.failed}.")
    else:
        per_photograph = (ours.cpu / DISCORPY_TIMES, theirs.cpu / DISCORPY_TIMES)
        part.rows.append(
            Row(
                "one grey photograph, map and all",
                per_photograph[0],
                "discorpy",
                per_photograph[1],
                "ms",
                None,
                "process CPU",
            )
        )
