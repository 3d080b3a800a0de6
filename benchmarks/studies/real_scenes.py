"""Boards of every kind in front of real rooms, and what real cameras add: found, false, and how far off.

    python -m benchmarks.studies.real_scenes                     600 photographs
    python -m benchmarks.studies.real_scenes --count 3000 --seed 1
    python -m benchmarks.studies.real_scenes --only charuco --verbose
    python -m benchmarks.studies.real_scenes --opencv            OpenCV's finders beside ours
    python -m benchmarks.studies.real_scenes --nothing           rooms without the board that is asked for

A rendered board stands before a real photograph (`ORTHOSCOPE_DATASETS`), which often shows another
chessboard. Then a camera does one thing to it, each in turn (`DISTURBANCES`): nothing, motion, glare, hard
light and shadow, vignetting, a curve of its own, sharpening, JPEG of quality 30, a lens of 170 degrees.
A false corner is more than 1 px from where its id is, in the best of the ways in which the board looks the
same; under motion 2 px, since where a moving corner was is a matter of taste. OpenCV's corners are compared
with the nearest that is there, whichever id they have.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.real_sets import SETS, datasets
from benchmarks.studies.false_corners import BOARDS, Shown, errors_of
from benchmarks.studies.opencv_finders import FINDERS, apart
from benchmarks.studies.true_places import margin_of, true_places
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.simulation.render import Renderer
from orthoscope.simulation.scene import random_views
from orthoscope.targets.table import parse_target

SIZE = (960, 720)
USUAL = Camera(SIZE, Intrinsics(900.0, 898.0, 483.0, 355.0), Brown(k1=-0.22, k2=0.06))
WIDE = Camera(SIZE, Intrinsics(330.0, 330.0, 478.0, 362.0), KannalaBrandt(k1=-0.03, k2=0.004))
SMALLEST_CHESSBOARD = (8, 6)
FALSE_PX, FALSE_IN_MOTION_PX = 1.0, 2.0
FILLS = (0.25, 0.9)
STEEPEST = np.deg2rad(60.0)

Picture = Float[ndarray, "h w"]


class Disturbance(NamedTuple):
    """What is done to a photograph, float grey levels, knowing where the board is; and by which camera."""

    change: Callable[[Picture, Float[ndarray, "m 2"], np.random.Generator], Picture]
    camera: Camera = USUAL


def _nothing(picture: Picture, board: ndarray, rng: np.random.Generator) -> Picture:
    return picture


def _moved(picture: Picture, board: ndarray, rng: np.random.Generator) -> Picture:
    length, angle = rng.uniform(1.0, 6.0), rng.uniform(0.0, np.pi)
    steps = np.linspace(-0.5, 0.5, 15) * length
    shifted = [
        cv2.warpAffine(
            picture,
            np.array([[1.0, 0.0, step * np.cos(angle)], [0.0, 1.0, step * np.sin(angle)]]),
            SIZE,
            borderMode=cv2.BORDER_REPLICATE,
        )
        for step in steps
    ]
    return np.mean(shifted, axis=0)


def _spots(middles: ndarray, widths: ndarray) -> Picture:
    x, y = np.arange(SIZE[0])[None, :], np.arange(SIZE[1])[:, None]
    return sum(
        np.exp(-0.5 * (((x - cx) / wx) ** 2 + ((y - cy) / wy) ** 2))
        for (cx, cy), (wx, wy) in zip(middles, widths, strict=True)
    )


def _glared(picture: Picture, board: ndarray, rng: np.random.Generator) -> Picture:
    extent = np.ptp(board, axis=0)
    middles = board[rng.integers(len(board), size=2)]
    return picture + rng.uniform(150.0, 400.0) * _spots(middles, rng.uniform(0.04, 0.15, (2, 2)) * extent)


def _shaded(picture: Picture, board: ndarray, rng: np.random.Generator) -> Picture:
    x, y = np.arange(SIZE[0])[None, :], np.arange(SIZE[1])[:, None]
    (cx, cy), phi = board[rng.integers(len(board))], rng.uniform(-np.pi, np.pi)
    side = np.tanh(((x - cx) * np.cos(phi) + (y - cy) * np.sin(phi)) / rng.uniform(0.7, 6.0))
    dark = rng.uniform(0.25, 0.6)
    return picture * (dark + (1.0 - dark) * (0.5 + 0.5 * side))


def _vignetted(picture: Picture, board: ndarray, rng: np.random.Generator) -> Picture:
    return picture * (0.1 + 0.9 * _spots(np.array([[480.0, 360.0]]), np.array([[330.0, 330.0]])))


def _curved(picture: Picture, board: ndarray, rng: np.random.Generator) -> Picture:
    return 255.0 * np.clip(1.4 * picture / 255.0 - 0.1, 0.0, 1.0) ** rng.uniform(0.45, 2.2)


def _sharpened(picture: Picture, board: ndarray, rng: np.random.Generator) -> Picture:
    return picture + rng.uniform(0.8, 2.0) * (picture - cv2.GaussianBlur(picture, (0, 0), 1.2))


def _compressed(picture: Picture, board: ndarray, rng: np.random.Generator) -> Picture:
    whole = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    _, code = cv2.imencode(".jpg", whole, [cv2.IMWRITE_JPEG_QUALITY, 30])
    return cv2.imdecode(code, cv2.IMREAD_GRAYSCALE).astype(float)


DISTURBANCES = {
    "nothing": Disturbance(_nothing),
    "motion": Disturbance(_moved),
    "glare": Disturbance(_glared),
    "shadow": Disturbance(_shaded),
    "vignetting": Disturbance(_vignetted),
    "curve": Disturbance(_curved),
    "sharpened": Disturbance(_sharpened),
    "jpeg 30": Disturbance(_compressed),
    "170 degrees": Disturbance(_nothing, WIDE),
}


@cache
def _renderer(wide: bool, blur: float) -> Renderer:
    return Renderer(WIDE if wide else USUAL, blur_px=blur, noise=2.0)


@cache
def _rooms(plain: bool) -> list[str]:
    """Photographs of all sets; where a plain chessboard is asked for only of sets with smaller boards than
    any of those: a larger one that the rim cuts off may well show as many corners.
    """
    folder = datasets()
    if not folder:
        raise SystemExit("No photographs: name their folder in ORTHOSCOPE_DATASETS.")
    patterns = [one.photographs for one in SETS.values() if not plain or one.grid < SMALLEST_CHESSBOARD]
    paths = sorted({path for pattern in patterns for path in folder.glob(pattern)})
    return [str(path) for path in paths if path.suffix in (".jpg", ".png")]


def room(spec: str, rng: np.random.Generator) -> Picture:
    """A part of a real photograph without this board, as it is or mirrored, as large as the picture."""
    rooms = _rooms(spec.startswith(("chessboard", "marked")))
    grey = cv2.imread(rooms[rng.integers(len(rooms))], cv2.IMREAD_GRAYSCALE)
    if rng.integers(2):
        grey = grey[:, ::-1]
    share = rng.uniform(0.6, 1.0)
    height = int(share * min(grey.shape[0], grey.shape[1] * SIZE[1] / SIZE[0]))
    width = int(height * SIZE[0] / SIZE[1])
    top, left = (
        rng.integers(all_ - part + 1) for all_, part in zip(grey.shape, (height, width), strict=True)
    )
    part = grey[top : top + height, left : left + width]
    return cv2.resize(part, SIZE, interpolation=cv2.INTER_AREA).astype(float)


def photographs(count: int, *, seed: int = 0, first: int = 0, only: str = "") -> Iterator[Shown]:
    """So many photographs; a number's is the same whatever the count; `quality` is what was done to it."""
    for number in range(first, first + count):
        spec = BOARDS[number % len(BOARDS)]
        if spec.startswith(only):
            shown = _photograph(number, spec, np.random.default_rng([seed, number]))
            if shown:
                yield shown


def _photograph(number: int, spec: str, rng: np.random.Generator) -> Shown | None:
    target = parse_target(spec)
    name = list(DISTURBANCES)[(number // len(BOARDS)) % len(DISTURBANCES)]
    doing = DISTURBANCES[name]
    blur, tilt = float(rng.choice([0.5, 0.8, 1.1])), float(rng.uniform(0.0, STEEPEST))
    fill = float(np.exp(rng.uniform(*np.log(FILLS))))
    try:
        (pose,) = random_views(
            doing.camera, target, 1, rng=rng, tilt=(tilt, tilt), fill=(fill, fill), margin=margin_of(target)
        )
    except CalibrationError:  # a wide board, tilted so, does not fill so much
        return None
    plain = _renderer(doing.camera is WIDE, blur).photograph_of(
        [(target, pose)], rng=rng, behind=room(spec, rng)
    )
    truth = true_places(doing.camera, target, pose)
    picture = np.clip(np.rint(doing.change(plain.astype(float), truth, rng)), 0, 255).astype(np.uint8)
    told = f"blur {blur:g} fill {fill:.2f} tilt {np.rad2deg(tilt):.0f}"
    return Shown(number, target, name, told, picture, truth)


class _Tally:
    """What a finder saw in photographs of one board, or with one disturbance, or in all."""

    def __init__(self) -> None:
        self.photographs = self.found = self.shown = self.corners = self.false = self.with_false = 0
        self.square = self.seconds = 0.0

    def add(self, shown: Shown, errors: Float[ndarray, " n"], seconds: float) -> None:
        false = errors > (FALSE_IN_MOTION_PX if shown.quality == "motion" else FALSE_PX)
        inside = ((shown.truth > 2) & (shown.truth < np.array(SIZE) - 3)).all(1)
        self.photographs, self.found = self.photographs + 1, self.found + (len(errors) > 0)
        self.shown, self.corners = self.shown + int(inside.sum()), self.corners + len(errors)
        self.false, self.with_false = self.false + int(false.sum()), self.with_false + bool(false.any())
        self.square, self.seconds = self.square + float((errors[~false] ** 2).sum()), self.seconds + seconds

    def told(self) -> str:
        """Photographs in which it found the board, corners, their error, those that are false, time."""
        rms = np.sqrt(self.square / max(self.corners - self.false, 1))
        return (
            f" {self.found} | {self.corners / max(self.shown, 1):.3f} | {rms:.3f} | {self.false} in"
            f" {self.with_false} | {1e3 * self.seconds / max(self.photographs, 1):.0f} ms |"
        )


def _ours(picture: ndarray, shown: Shown) -> Float[ndarray, " n"]:
    sight = see(picture, shown.target)
    return errors_of(shown, sight) if isinstance(sight, Sight) else np.zeros(0)


def _theirs(picture: ndarray, shown: Shown) -> Float[ndarray, " n"]:
    return apart(FINDERS[shown.target.kind](picture, shown.target), shown.truth)


def main() -> None:
    """What the module's docstring says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--first", type=int, default=0, help="the number of the first")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="boards whose description begins so")
    parser.add_argument("--nothing", action="store_true", help="rooms alone: how many boards are seen there")
    parser.add_argument("--opencv", action="store_true", help="OpenCV's finders beside ours")
    parser.add_argument(
        "--verbose", action="store_true", help="a line for each photograph with false corners"
    )
    given = parser.parse_args()
    cv2.setNumThreads(1)
    finders = (_ours, _theirs) if given.opencv else (_ours,)
    tallies: dict[str, list[_Tally]] = {}
    for shown in photographs(given.count, seed=given.seed, first=given.first, only=given.only):
        picture = shown.picture
        if given.nothing:
            around = room(shown.target.name, np.random.default_rng([given.seed, shown.number]))
            picture = around.astype(np.uint8)
        for which, finder in enumerate(finders):
            before = time.process_time()
            errors = finder(picture, shown)
            seconds = time.process_time() - before
            for name in (f"`{shown.target.name}`", shown.quality, "all"):
                tallies.setdefault(name, [_Tally() for _ in finders])[which].add(shown, errors, seconds)
            if given.verbose and finder is _ours and (errors > FALSE_PX).any():
                print(
                    f"  {shown.number}: {int((errors > FALSE_PX).sum())} of {len(errors)}"
                    f" ({errors.max():.1f} px) {shown.target.name} {shown.quality} {shown.told}",
                    flush=True,
                )
    columns = " found | corners of those in the picture | rms, px | false | time |" * len(finders)
    print(f"| | photographs |{columns}\n|{'---|' * (2 + 5 * len(finders))}")
    for name, each in sorted(tallies.items(), key=lambda one: (one[0][0] != "`", one[0] == "all")):
        print(f"| {name} | {each[0].photographs} |{''.join(tally.told() for tally in each)}")


if __name__ == "__main__":
    main()
