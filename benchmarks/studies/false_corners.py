"""Rendered photographs of every kind of target, good and poor ones: is a corner ever where none is?

    python -m benchmarks.studies.false_corners                           400 photographs
    python -m benchmarks.studies.false_corners --count 10000 --seed 1    others, and more of them
    python -m benchmarks.studies.false_corners --verbose                 a line for each false corner
    python -m benchmarks.studies.false_corners --only circles            those of some boards
    python -m benchmarks.studies.false_corners --other-boards            boards of other sizes and kinds
    python -m benchmarks.studies.false_corners --log seen.jsonl          what was seen is kept

Photographs are 640x480, by a lens `brown` and a fisheye in turn; sharp, usual and poor ones (`QUALITIES`);
tilts to 65 degrees; boards fill a quarter of the picture to all of it, one in four stands over its rim, one
in eight has something grey over a part of it. A false corner is more than 1 px from where its id is, in the
best of the ways in which the board looks the same; for discs, from the middle of the outline. Ids are wrong
where most corners of a photograph are false.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.studies.true_places import errors_of_sight, margin_of, true_ids, true_places
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.simulation.render import BLACK_LEVEL, WHITE_LEVEL, Renderer
from orthoscope.simulation.scene import random_views
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

__all__ = ["BOARDS", "Outcome", "Shown", "errors_of", "outcome_of", "photographs"]

BOARDS = (
    "chessboard:9x6:25mm",
    "chessboard:8x6:25mm",
    "chessboard:14x9:20mm",
    "marked:14x9:20mm",
    "marked:9x6:25mm:DICT_4X4_50:18mm",
    "charuco:7x5:30mm:22mm:DICT_5X5_100",
    "charuco:10x8:25mm:18mm:DICT_4X4_50:legacy",
    "aprilgrid:6x6:88mm:0.3",
    "aprilgrid:4x3:50mm:0.25",
    "aruco:5x4:40mm:10mm:DICT_4X4_50",
    "circles:4x11:20mm:asymmetric",
    "circles:9x7:20mm:symmetric:10mm",
)
OTHER_BOARDS = (
    "chessboard:10x7:25mm",
    "chessboard:7x7:30mm",
    "chessboard:5x4:40mm",
    "marked:11x8:20mm:DICT_5X5_100:14mm",
    "charuco:9x6:30mm:22mm:DICT_6X6_250",
    "charuco:5x8:40mm:30mm:DICT_ARUCO_ORIGINAL:legacy",
    "charuco:12x9:20mm:15mm:DICT_5X5_250",
    "aprilgrid:8x5:40mm:0.3",
    "aprilgrid:5x7:60mm:0.2",
    "aruco:4x6:50mm:15mm:DICT_6X6_50",
    "circles:5x9:20mm:asymmetric",
    "circles:7x6:25mm:symmetric:9mm",
)
CAMERAS = (
    Camera((640, 480), Intrinsics(560.0, 559.0, 323.0, 237.0), Brown(k1=-0.22, k2=0.06)),
    Camera((640, 480), Intrinsics(260.0, 260.0, 319.0, 241.0), KannalaBrandt(k1=-0.02)),
)


class Quality(NamedTuple):
    """Ranges of what makes a photograph good or poor: blur, px; noise and contrast, grey levels."""

    blurs: tuple[float, ...]
    noise: tuple[float, float]
    contrast: tuple[float, float]


QUALITIES = {
    "sharp": Quality((0.3, 0.5, 0.7), (0.0, 1.5), (150.0, 185.0)),
    "usual": Quality((0.6, 0.8, 1.0, 1.2), (1.5, 3.5), (90.0, 185.0)),
    "poor": Quality((0.5, 1.0, 1.5, 2.0, 2.5, 3.0), (2.0, 8.0), (15.0, 150.0)),
}
STEEPEST = np.deg2rad(65.0)
FILLS = (0.25, 0.95)
OVER_RIM, COVERED = 4, 8
FALSE_PX = 1.0


class Shown(NamedTuple):
    """A photograph: its number, target and quality, how it was taken, and where corners truly are."""

    number: int
    target: Target
    quality: str
    told: str
    picture: ndarray
    truth: Float[ndarray, "m 2"]


@cache
def _renderer(camera: int, blur: float) -> Renderer:
    return Renderer(CAMERAS[camera], blur_px=blur, noise=0.0)


@cache
def _target(spec: str) -> Target:
    return parse_target(spec)


def photographs(
    count: int, *, seed: int = 0, first: int = 0, boards: tuple[str, ...] = BOARDS
) -> Iterator[Shown]:
    """So many photographs of these boards in turn; a number's is the same whatever the count."""
    for number in range(first, first + count):
        target = _target(boards[number % len(boards)])
        shown = _photograph(number, target, np.random.default_rng([seed, number]))
        if shown:
            yield shown


def _photograph(number: int, target: Target, rng: np.random.Generator) -> Shown | None:
    which, name = int(rng.integers(2)), list(QUALITIES)[int(rng.integers(len(QUALITIES)))]
    quality, camera = QUALITIES[name], CAMERAS[which]
    blur, noise = float(rng.choice(quality.blurs)), float(rng.uniform(*quality.noise))
    contrast = float(rng.uniform(*quality.contrast))
    fill = float(np.exp(rng.uniform(*np.log(FILLS))))
    tilt, whole = float(rng.uniform(0.0, STEEPEST)), bool(rng.integers(OVER_RIM))
    try:
        (pose,) = random_views(
            camera,
            target,
            1,
            rng=rng,
            tilt=(tilt, tilt),
            fill=(fill, fill),
            whole=whole,
            margin=margin_of(target),
        )
    except CalibrationError:  # a wide board, tilted so, does not fill so much
        return None
    plain = _renderer(which, blur).photograph(target, pose, rng=rng).astype(float)
    dull = 110.0 + (plain - 110.0) * contrast / (WHITE_LEVEL - BLACK_LEVEL)
    truth = true_places(camera, target, pose)
    covered = not rng.integers(COVERED)
    if covered:
        dull = _covered(dull, truth, blur, rng)
    picture = np.clip(np.rint(dull + rng.normal(0.0, noise, dull.shape)), 0, 255).astype(np.uint8)
    told = (
        f"{'fisheye' if which else 'brown'} blur {blur:g} noise {noise:.1f} contrast {contrast:.0f}"
        f" fill {fill:.2f} tilt {np.rad2deg(tilt):.0f}{'' if whole else ' over the rim'}"
        f"{' covered' if covered else ''}"
    )
    return Shown(number, target, name, told, picture, truth)


def _covered(
    picture: Float[ndarray, "h w"], truth: Float[ndarray, "m 2"], blur: float, rng: np.random.Generator
) -> Float[ndarray, "h w"]:
    """The picture with an even ellipse over a part of the board."""
    inside = truth[np.isfinite(truth).all(1)]
    size = np.ptp(inside, axis=0)
    middle = inside[rng.integers(len(inside))] + rng.normal(0.0, 0.1, 2) * size
    mask = np.zeros(picture.shape, np.float32)
    axes = np.maximum(rng.uniform(0.08, 0.3, 2) * size, 3.0)
    cv2.ellipse(
        mask,
        tuple(int(one) for one in middle),
        tuple(int(one) for one in axes),
        float(rng.uniform(0, 180)),
        0,
        360,
        1.0,
        -1,
    )
    mask = cv2.GaussianBlur(mask, (0, 0), blur)
    return picture * (1.0 - mask) + float(rng.uniform(30, 200)) * mask


def errors_of(shown: Shown, sight: Sight) -> Float[ndarray, " n"]:
    """How far each corner is from where its id is, px, in the best of the ways in which the board looks the
    same.
    """
    return errors_of_sight(true_ids(shown.target, shown.truth, sight), shown.truth, sight)


class Outcome(NamedTuple):
    """What came of one photograph.

    Attributes:
        number, target, quality, told: of the photograph.
        shown: corners that are in the picture.
        corners: that were found.
        square, worst: sum of their squared errors and the largest, px.
        false: how many are false.
        seconds: of process time.
    """

    number: int
    target: str
    quality: str
    told: str
    shown: int
    corners: int
    square: float
    worst: float
    false: int
    seconds: float


def outcome_of(shown: Shown) -> Outcome:
    """What comes of looking for its target in a photograph."""
    before = time.process_time()
    sight = see(shown.picture, shown.target)
    seconds = time.process_time() - before
    errors = errors_of(shown, sight) if isinstance(sight, Sight) else np.zeros(0)
    width, height = shown.picture.shape[::-1]
    inside = ((shown.truth > 2) & (shown.truth < [width - 3, height - 3])).all(1)
    finite = np.minimum(errors, 1e6)
    return Outcome(
        shown.number,
        shown.target.name,
        shown.quality,
        shown.told,
        int(inside.sum()),
        len(errors),
        round(float((finite**2).sum()), 6),
        round(float(finite.max(initial=0.0)), 4),
        int((errors > FALSE_PX).sum()),
        round(seconds, 4),
    )


class _Tally:
    """What photographs of one board, or of all, came to."""

    def __init__(self) -> None:
        self.photographs = self.found = self.corners = self.shown = 0
        self.false = self.with_false = self.wrong_ids = 0
        self.worst, self.square, self.seconds = 0.0, 0.0, 0.0

    def add(self, one: Outcome) -> None:
        self.photographs, self.found = self.photographs + 1, self.found + (one.corners > 0)
        self.corners, self.seconds = self.corners + one.corners, self.seconds + one.seconds
        self.shown += one.shown
        wrong = one.false > 0.5 * one.corners
        self.wrong_ids += wrong
        self.false, self.with_false = self.false + one.false, self.with_false + (one.false > 0)
        if not wrong:
            self.worst = max(self.worst, one.worst)
            self.square += one.square

    def row(self, name: str) -> str:
        """As a row of a table."""
        rms = np.sqrt(self.square / max(self.corners, 1))
        return (
            f"| {name} | {self.photographs} | {self.found} | {self.corners} of {self.shown} | {rms:.3f} |"
            f" {self.worst:.2f} | {self.false} in {self.with_false} | {self.wrong_ids} |"
            f" {1e3 * self.seconds / max(self.photographs, 1):.0f} ms |"
        )


def main() -> None:
    """What the module's docstring says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--first", type=int, default=0, help="the number of the first")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="of boards whose description begins so")
    parser.add_argument("--other-boards", action="store_true", help="boards of other sizes and kinds")
    parser.add_argument("--log", type=Path, help="a line of JSON for each photograph")
    parser.add_argument(
        "--verbose", action="store_true", help="a line for each photograph with false corners"
    )
    given = parser.parse_args()
    cv2.setNumThreads(1)
    tallies: dict[str, _Tally] = {}
    for one in _outcomes(given):
        for name in (f"`{one.target}`", one.quality, "all"):
            tallies.setdefault(name, _Tally()).add(one)
        if given.verbose and one.false:
            print(
                f"  {one.number}: {one.false} of {one.corners} ({one.worst:.1f} px)"
                f" {one.target} {one.quality} {one.told}",
                flush=True,
            )
    print(
        "| target | photographs | found | corners of those in the picture | rms, px | worst, px |"
        " false corners, in photographs | ids wrong | time |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in [*(f"`{_target(spec).name}`" for spec in _boards(given)), *QUALITIES, "all"]:
        if name in tallies:
            print(tallies[name].row(name))


def _boards(given: argparse.Namespace) -> tuple[str, ...]:
    """Those that are asked for."""
    return OTHER_BOARDS if given.other_boards else BOARDS


def _outcomes(given: argparse.Namespace) -> Iterator[Outcome]:
    """Of all photographs that are asked for; those that the log has from there."""
    known, boards = {}, _boards(given)
    if given.log and given.log.exists():
        lines = given.log.read_text(encoding="utf-8").splitlines()
        known = {one.number: one for one in (Outcome(*json.loads(line)) for line in lines)}
    log = given.log.open("a", encoding="utf-8") if given.log else nullcontext()
    with log as file:
        for number in range(given.first, given.first + given.count):
            if not boards[number % len(boards)].startswith(given.only):
                continue
            one = known.get(number)
            if one is None:
                for shown in photographs(1, seed=given.seed, first=number, boards=boards):
                    one = outcome_of(shown)
                if one and file:
                    print(json.dumps(one), file=file, flush=True)
            if one:
                yield one


if __name__ == "__main__":
    main()
