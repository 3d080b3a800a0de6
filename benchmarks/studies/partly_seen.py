"""Boards of markers of which a part is out of the frame or hidden: how much of the rest is found?

    python -m benchmarks.studies.partly_seen               the table of docs/detection.md, 24 photographs each
    python -m benchmarks.studies.partly_seen --count 60    more of them

Photographs are 1280x960, by a lens `brown` and a fisheye in turn, blur .7 px, noise 2 grey levels, any roll,
tilts to 60 degrees from the line of sight. A board is half out of the frame where its middle is near the
frame's rim; a third of its markers are hidden where something grey lies on each of these. Counted are the
corners around which a whole square is in the picture, and on no side of which something lies.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.studies.false_corners import CAMERAS, FALSE_PX
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import Bool, Float, ndarray
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.simulation.render import Renderer
from orthoscope.targets.aprilgrid import AprilGrid
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

__all__ = ["BOARDS", "PARTS", "Part", "photographs"]

BOARDS = ("charuco:9x6:30mm:22mm:DICT_5X5_100", "aprilgrid:6x6:88mm:0.3")
PARTS = ("half out of the frame", "a third of the markers hidden")
SIZE = (1280, 960)
STEEPEST = np.deg2rad(60.0)
HIDDEN_SHARE, GREY = 1.0 / 3.0, 120
# A board's longer side is seen as long as this share of the picture's height.
FILL = 0.8


class Part(NamedTuple):
    """A photograph, where the corners truly are, and which of them are to be found."""

    picture: ndarray
    truth: Float[ndarray, "m 2"]
    whole: Bool[ndarray, " m"]


def photographs(spec: str, part: str, count: int) -> Iterator[Part]:
    """So many photographs of a board of which such a part is seen."""
    target, rng = parse_target(spec), np.random.default_rng(len(part))
    renderers = [Renderer(camera.resized(SIZE), blur_px=0.7, noise=2.0) for camera in CAMERAS]
    for number in range(count):
        renderer = renderers[number % len(renderers)]
        pose = _pose(renderer.camera, target, out=part == PARTS[0], rng=rng)
        picture = renderer.photograph(target, pose, rng=rng)
        truth = renderer.camera.project(pose.apply(target.points))
        step = _step(target, truth)
        whole = np.asarray(((truth > step[:, None]) & (truth < np.array(SIZE) - 1.0 - step[:, None])).all(1))
        if part == PARTS[1]:
            hidden = _hidden(picture, renderer.camera, target, pose, rng)
            near = np.rint(np.clip(truth, 0, np.array(SIZE) - 1)).astype(int).T
            reach = np.maximum(0.5 * step, 2.0)
            whole &= cv2.distanceTransform(1 - hidden, cv2.DIST_L2, 5)[near[1], near[0]] > reach
        yield Part(picture, truth, whole)


def _pose(camera: Camera, target: Target, *, out: bool, rng: np.random.Generator) -> Pose:
    """A board that is turned and tilted anyhow, its middle in the picture's or near its rim."""
    tilt, roll, about = (
        rng.uniform(0.0, STEEPEST),
        rng.uniform(0.0, 2.0 * np.pi),
        rng.uniform(0.0, 2.0 * np.pi),
    )
    tilted = rotation_from_vector(tilt * np.array([np.cos(about), np.sin(about), 0.0]))
    turned = tilted @ rotation_from_vector(np.array([0.0, 0.0, roll]))
    points = target.points
    focal = float(camera.intrinsics.fx)
    distance = focal * float(np.ptp(points, axis=0).max()) / (FILL * SIZE[1])
    pixel = 0.5 * np.array(SIZE)
    if out:
        side = rng.integers(4)
        pixel = rng.uniform(0.2, 0.8, 2) * SIZE
        pixel[side % 2] = (0.04 if side < 2 else 0.96) * SIZE[side % 2]
    ray = camera.unproject(pixel[None])[0]
    ray = ray / np.linalg.norm(ray)
    axis = np.array([-ray[1], ray[0], 0.0]) / max(float(np.hypot(*ray[:2])), 1e-9)
    rotation = rotation_from_vector(np.arccos(ray[2]) * axis) @ turned  # tilts are from the line of sight
    middle = distance * ray
    return Pose(rotation, middle - rotation @ (0.5 * (points.min(0) + points.max(0))))


def _step(target: Target, truth: Float[ndarray, "m 2"]) -> Float[ndarray, " m"]:
    """How far from each corner the next one of its line is, at most a few, pixels."""
    apart = np.linalg.norm(truth[:, None] - truth, axis=-1)
    return np.sort(apart, axis=1)[:, 1 if isinstance(target.board, AprilGrid) else 2]


def _hidden(
    picture: ndarray, camera: Camera, target: Target, pose: Pose, rng: np.random.Generator
) -> ndarray:
    """Covers a third of the markers in a picture; which of its pixels are covered."""
    board = target.board
    if isinstance(board, AprilGrid):
        outlines = board.points()[board.tag_corners()]
        outlines = outlines.mean(1, keepdims=True) + 0.9 * (outlines - outlines.mean(1, keepdims=True))
    else:
        assert isinstance(board, Charuco)
        flat = board.marker_corners() * board.square
        outlines = np.concatenate([flat, np.zeros_like(flat[..., :1])], axis=-1)
    covered = rng.permutation(len(outlines))[: round(HIDDEN_SHARE * len(outlines))]
    mask = np.zeros(picture.shape, np.uint8)
    for outline in outlines[covered]:
        pixels = camera.project(pose.apply(outline))
        if np.isfinite(pixels).all():
            cv2.fillConvexPoly(mask, np.rint(pixels).astype(np.int32), 1)
    picture[mask > 0] = GREY
    return mask


def main() -> None:
    """What the module's docstring says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=24)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    print("| board | seen | found of those whole in the picture | others | rms, px | worst, px | false |")
    print("|---|---|---|---|---|---|---|")
    for spec in BOARDS:
        for part in PARTS:
            total = found = others = 0
            errors: list[float] = []
            for shown in photographs(spec, part, given.count):
                sight = see(shown.picture, parse_target(spec))
                total += int(shown.whole.sum())
                if isinstance(sight, Sight):
                    found += int(shown.whole[sight.ids].sum())
                    others += int((~shown.whole[sight.ids]).sum())
                    errors += np.hypot(*(sight.pixels - shown.truth[sight.ids]).T).tolist()
            off = np.array(errors)
            print(
                f"| `{spec}` | {part} | {found} of {total} ({found / total:.1%}) | {others} |"
                f" {np.sqrt((off**2).mean()):.3f} | {off.max():.2f} | {int((off > FALSE_PX).sum())} |"
            )


if __name__ == "__main__":
    main()
