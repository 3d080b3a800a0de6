"""Undistorting points: a million of them, how exactly they come back, and what happens where the lens has no
image.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.peers import Peers
from benchmarks.race import race
from benchmarks.rows import Part, Row

__all__ = ["points"]

COUNT = 1_000_000
ROUNDS = 5
SIZE = (1920, 1080)
MATRIX = np.array([[1360.0, 0.0, 965.0], [0.0, 1357.0, 535.0], [0.0, 0.0, 1.0]])
LENS = np.array([-0.28, 0.09, 0.0008, -0.0006, 0.0])
FOLDS = np.array([-0.31, 0.02, 0.0, 0.0, 0.0])  # no pixel farther out than about 960 px has a ray
ABOUT = (
    "A million pixels, evenly over a 1920x1080 image, to rays and back by the tool's own projection; k1 ="
    " -0.28, k2 = 0.09 and decentering. Process CPU time, one thread, the best of several rounds; OpenCV with"
    " 20 iterations, as many as its own documentation suggests for exactness. The fold: k1 = -0.31, k2 ="
    " 0.02, whose image ends inside the frame's corners."
)


def points(peers: Peers, folder: Path) -> Part:
    """Time, round trip and fold."""
    part = Part("Undistorting points", ABOUT)
    results = _race(peers, _file(folder, "points", LENS))
    ours, theirs = results["ours"], results["theirs"]
    if ours.failed or theirs.failed:
        part.remarks.append(f"points: {ours.failed or theirs.failed}.")
        return part
    part.rows.append(
        Row(
            "1e6 points",
            ours.cpu,
            "OpenCV, 20 iterations",
            theirs.cpu,
            "ms",
            0.3,
            f"wall {ours.wall / theirs.wall:.2f}",
        )
    )
    note = f"OpenCV {theirs.answer['largest']:.1e} px"
    part.rows.append(
        Row("largest error of the round trip", ours.answer["largest"], "", None, "px", 1e-9, note)
    )
    _fold(part, peers, folder)
    return part


def _fold(part: Part, peers: Peers, folder: Path) -> None:
    """Pixels without a ray that are said to have one; the truth is where the radial curve turns."""
    results = _race(peers, _file(folder, "fold", FOLDS), rounds=1)
    ours, theirs = results["ours"], results["theirs"]
    if ours.failed or theirs.failed:
        part.remarks.append(f"fold: {ours.failed or theirs.failed}.")
        return
    beyond = 100.0 * _share_beyond(FOLDS)
    wrong = [beyond - 100.0 * result.answer["nan"] for result in (ours, theirs)]
    note = (
        f"{beyond:.3f} % of the pixels have no ray; OpenCV's worst round trip"
        f" {theirs.answer['largest']:.2g} px"
    )
    quantity = "pixels past the fold that are given a ray"
    part.rows.append(
        Row(quantity, abs(wrong[0]), "", None, "%", 1e-3, f"{note}; OpenCV gives one to {wrong[1]:.3f} %")
    )


def _race(peers: Peers, path: str, rounds: int = ROUNDS):
    return race(
        {
            "ours": lambda: peers.ask("orthoscope", "undistort_points", path=path),
            "theirs": lambda: peers.ask("OpenCV", "undistort_points", path=path),
        },
        rounds=rounds,
    )


def _pixels() -> np.ndarray:
    """Evenly over the image, in random order (as detections come), the same every time."""
    return np.random.default_rng(0).uniform((0.0, 0.0), (SIZE[0] - 1.0, SIZE[1] - 1.0), (COUNT, 2))


def _file(folder: Path, name: str, lens: np.ndarray) -> str:
    path = folder / f"{name}.npz"
    np.savez(path, pixels=_pixels(), matrix=MATRIX, lens=lens, image_size=np.array(SIZE))
    return str(path)


def _share_beyond(lens: np.ndarray) -> float:
    """Share of the pixels farther from the centre than the largest image radius of a purely radial lens, r +
    k1 r^3 + k2 r^5.
    """
    roots = np.roots([5.0 * lens[1], 0.0, 3.0 * lens[0], 0.0, 1.0])
    turn = min(root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0)
    largest = turn + lens[0] * turn**3 + lens[1] * turn**5
    plane = (_pixels() - MATRIX[:2, 2]) / np.diag(MATRIX)[:2]
    return float((np.hypot(*plane.T) > largest).mean())
