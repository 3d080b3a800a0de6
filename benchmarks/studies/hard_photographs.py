"""Poor photographs of chessboards, and pictures without one: what is found, how far off, and in what time.

    python -m benchmarks.studies.hard_photographs                  40 photographs
    python -m benchmarks.studies.hard_photographs --count 300      more of them
    python -m benchmarks.studies.hard_photographs --times          only no boards, and easy ones

Photographs are 640x480, of a 9x6 board with squares of 7 to 40 px, contrast of 15 to 150 grey levels, blur of
.5 to 3 px, noise of up to 8 grey levels and tilts of up to 70 degrees, each drawn by itself. A photograph is
whole, in part or missed; a false corner is more than 1 px from where its id is, whichever end of the board
is listed first. Beside it stands OpenCV's classic finder with cornerSubPix on the same pictures. Times are
of the process, the least of three turns, a thread.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.chessboards.chessboard import see_chessboard
from orthoscope.detection.sight import Sight
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import BLACK_LEVEL, WHITE_LEVEL, Renderer
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.target import Target, target_of

__all__ = ["Hard", "easy_photograph", "found", "hard_photographs", "smooth_texture"]

BOARD = Chessboard(9, 6, 0.025)
CAMERA = Camera((640, 480), Intrinsics(620.0, 620.0, 322.0, 238.0), Brown(k1=-0.2, k2=0.05))
SQUARES_PX, CONTRASTS, BLURS_PX, NOISES, TILTS = (
    (7.0, 40.0),
    (15.0, 150.0),
    (0.5, 3.0),
    (0.0, 8.0),
    (0.0, 70.0),
)
FALSE_PX = 1.0
SIZES = ((640, 480), (1920, 1080), (4000, 3000))
TURNS = 3


class Hard(NamedTuple):
    """A photograph, where the corners are, and how it was taken."""

    picture: ndarray
    corners: Float[ndarray, "m 2"]
    square_px: float
    contrast: float
    blur_px: float
    noise: float
    tilt_deg: float


def hard_photographs(count: int, *, seed: int = 0) -> Iterator[Hard]:
    """So many photographs; the first ones are the same whatever the count."""
    target = target_of(BOARD)
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        square = float(np.exp(rng.uniform(*np.log(SQUARES_PX))))
        contrast, blur = (float(rng.uniform(*between)) for between in (CONTRASTS, BLURS_PX))
        noise, tilt = (float(rng.uniform(*between)) for between in (NOISES, TILTS))
        pose = _pose(target, square, np.deg2rad(tilt), rng)
        plain = Renderer(CAMERA, blur_px=blur, noise=0.0).photograph(target, pose, rng=rng).astype(float)
        dull = 110.0 + (plain - 110.0) * contrast / (WHITE_LEVEL - BLACK_LEVEL)
        picture = np.clip(np.rint(dull + rng.normal(0.0, noise, plain.shape)), 0, 255).astype(np.uint8)
        corners = CAMERA.project(pose.apply(target.points))
        yield Hard(picture, corners, square, contrast, blur, noise, tilt)


def _pose(target: Target, square_px: float, tilt: float, rng: np.random.Generator) -> Pose:
    """A board whose middle square is about so large, all of it in the picture."""
    middle = target.points.mean(0)
    width, height = CAMERA.image_size
    for _ in range(1000):
        axis = rng.uniform(0.0, 2.0 * np.pi)
        turned = rotation_from_vector(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))
        rotation = turned @ rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        depth = CAMERA.intrinsics.fx * BOARD.square / square_px
        away = rng.uniform(-0.4, 0.4, 2) * depth * np.array([width, height]) / CAMERA.intrinsics.fx
        pose = Pose(rotation, np.array([*away, depth]) - rotation @ middle)
        outline = CAMERA.project(
            pose.apply(np.array([[x, y, 0.0] for x in (-0.05, 0.25) for y in (-0.05, 0.175)]))
        )
        if np.isfinite(outline).all() and ((outline > 0) & (outline < [width - 1, height - 1])).all():
            return pose
        square_px *= 0.99  # a board that does not fit into the picture is farther away
    raise AssertionError("no such board fits into the picture")


def found(hard: Hard) -> tuple[int, float]:
    """How many corners our detector finds, and how far the worst is off, px."""
    sight = see_chessboard(hard.picture, BOARD)
    if not isinstance(sight, Sight):
        return 0, 0.0
    ends = (hard.corners, hard.corners[::-1])
    return len(sight.ids), min(float(np.hypot(*(end[sight.ids] - sight.pixels).T).max()) for end in ends)


def smooth_texture(size: tuple[int, int], *, seed: int = 0) -> ndarray:
    """A picture of hills and valleys some pixels wide, all over, and of nothing else."""
    width, height = size
    hills = cv2.GaussianBlur(
        np.random.default_rng(seed).normal(size=(height, width)).astype(np.float32), (0, 0), 3.0
    )
    return np.clip(128 + 60 * hills / hills.std(), 0, 255).astype(np.uint8)


def easy_photograph(size: tuple[int, int], *, seed: int = 0) -> ndarray:
    """A sharp photograph of the board, large in the picture."""
    width, height = size
    camera = Camera(size, Intrinsics(width, width, 0.5 * width, 0.5 * height), Brown(k1=-0.1))
    target, rng = target_of(BOARD), np.random.default_rng(seed)
    rotation = rotation_from_vector(rng.uniform(-0.3, 0.3, 3))
    pose = Pose(rotation, np.array([0.0, 0.0, 0.4]) - rotation @ target.points.mean(0))
    return Renderer(camera).photograph(target, pose, rng=rng)


def _classic(picture: ndarray) -> ndarray | None:
    is_there, corners = cv2.findChessboardCorners(picture, BOARD.grid)
    if not is_there:
        return None
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    return cv2.cornerSubPix(picture, corners, (5, 5), (-1, -1), criteria).reshape(-1, 2)


def _seconds(do, picture: ndarray) -> float:
    took = []
    for _ in range(TURNS):
        before = time.process_time()
        do(picture)
        took.append(time.process_time() - before)
    return min(took)


def _tell_times() -> None:
    for size in SIZES:
        easy, texture = easy_photograph(size), smooth_texture(size)
        ours, classic = (_seconds(do, easy) for do in (lambda p: see_chessboard(p, BOARD), _classic))
        nothing = max(
            _seconds(lambda p: see_chessboard(p, BOARD), smooth_texture(size, seed=s)) for s in range(3)
        )
        print(
            f"{size[0]}x{size[1]}: no board on texture {nothing:.3f} s;"
            f" easy board {ours:.3f} s, classic finder and cornerSubPix {classic:.3f} s"
        )
        del texture


def main() -> None:
    """What the module's docstring says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--times", action="store_true", help="only times")
    parser.add_argument("--verbose", action="store_true", help="a line for each photograph that is not whole")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    if not given.times:
        _tell_hard(given.count, given.seed, verbose=given.verbose)
    _tell_times()


def _tell_hard(count: int, seed: int, *, verbose: bool) -> None:
    whole = part = false_photographs = classic = 0
    corners, spent = len(BOARD.points()), 0.0
    for number, hard in enumerate(hard_photographs(count, seed=seed)):
        before = time.process_time()
        seen, off = found(hard)
        spent += time.process_time() - before
        whole, part = whole + (seen == corners), part + (0 < seen < corners)
        false_photographs += off > FALSE_PX
        classic += _classic(hard.picture) is not None
        if verbose and (seen < corners or off > FALSE_PX):
            told = ", ".join(f"{name} {value:.3g}" for name, value in list(hard._asdict().items())[2:])
            print(f"  {number}: {seen} corners, worst {off:.2f} px ({told})")
    print(
        f"{count} hard photographs: {whole} whole, {part} in part, {count - whole - part} missed;"
        f" a false corner in {false_photographs}; classic finder {classic}; {1e3 * spent / count:.0f} ms each"
    )


if __name__ == "__main__":
    main()
