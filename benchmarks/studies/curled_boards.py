"""Boards of paper that curls: what is found of them, and how well?

    python -m benchmarks.studies.curled_boards               the table of docs/detection.md
    python -m benchmarks.studies.curled_boards --count 60    more photographs

A sheet is bent about an axis in any direction, as a part of a cylinder; its middle lies out of the plane of
its ends by up to an eighth of its length. Photographs are 1280x960, by a lens `brown` and a fisheye in turn,
blur .7 px, noise 2 grey levels, any roll, tilts to 70 degrees from the line of sight. Counted are the corners
that face the camera by more than 8 degrees and are a step from the picture's rim.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.studies.false_corners import CAMERAS, FALSE_PX
from benchmarks.studies.true_places import errors_of_sight, margin_of, true_ids
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import Bool, Float, ndarray
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.simulation.render import BACKGROUND_LEVEL, BLACK_LEVEL, WHITE_LEVEL
from orthoscope.simulation.sheet import Sheet
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

__all__ = ["BOARDS", "Curl", "photographs"]

BOARDS = (
    "chessboard:9x6:25mm",
    "charuco:9x6:30mm:22mm:DICT_5X5_100",
    "aprilgrid:6x6:88mm:0.3",
    "aruco:5x4:40mm:10mm:DICT_4X4_50",
)
SIZE = (1280, 960)
TILTS = ((0.0, 30.0), (30.0, 55.0), (55.0, 70.0))
MOST_SAG, FILL = 1.0 / 8.0, 0.75
# Where a pixel's neighbours are so far from each other on the sheet, metres, one of them is not on it.
TORN = 0.05
BLUR, NOISE, OVERSAMPLING = 0.7, 2.0, 4
LEAST_FACING = np.sin(np.deg2rad(8.0))


class Curl(NamedTuple):
    """A sheet bent about an axis.

    Attributes:
        middle: (2,) of the sheet, metres.
        across: (2,) the direction in the sheet that is bent, of length 1.
        radius: of the cylinder, metres; negative where it bends away from the camera.
    """

    middle: Float[ndarray, " 2"]
    across: Float[ndarray, " 2"]
    radius: float

    def bent(self, places: Float[ndarray, "m 2"]) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
        """Where places of the sheet are in space, and the normals there."""
        u, v = self._turned(places - self.middle).T
        angle = u / self.radius
        plane = self._back(np.stack([self.radius * np.sin(angle), v], axis=1)) + self.middle
        normal = self._back(np.stack([-np.sin(angle), np.zeros_like(v)], axis=1))
        return (
            np.column_stack([plane, self.radius * (1.0 - np.cos(angle))]),
            np.column_stack([normal, np.cos(angle)]),
        )

    def seen(self, origin: Float[ndarray, " 3"], rays: Float[ndarray, "n 3"], sheet: Sheet) -> ndarray:
        """(2,n) the place of the sheet that each ray meets first, metres; far outside where it meets none."""
        o, d = self._turned(origin[:2] - self.middle), self._turned(rays[:, :2])
        z, w = origin[2] - self.radius, rays[:, 2]
        a, b, c = d[:, 0] ** 2 + w**2, d[:, 0] * o[0] + w * z, o[0] ** 2 + z**2 - self.radius**2
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        place = np.full((2, len(rays)), 1e6)
        for distance in ((-b + root) / a, (-b - root) / a):  # the nearer one last
            angle = np.arctan2((o[0] + distance * d[:, 0]) / self.radius, -(z + distance * w) / self.radius)
            flat = np.stack([angle * self.radius, o[1] + distance * d[:, 1]], axis=1)
            there = (self._back(flat) + self.middle).T
            met = (b * b > a * c) & (distance > 0) & (np.abs(angle) < 0.5 * np.pi) & sheet.near(*there)
            place[:, met] = there[:, met]
        return place

    def _turned(self, plane: ndarray) -> ndarray:
        return plane @ np.column_stack([self.across, [-self.across[1], self.across[0]]])

    def _back(self, turned: ndarray) -> ndarray:
        return turned @ np.stack([self.across, [-self.across[1], self.across[0]]])


class Shown(NamedTuple):
    """A photograph, where corners truly are, and which of them are to be found."""

    picture: ndarray
    truth: Float[ndarray, "m 2"]
    whole: Bool[ndarray, " m"]


def photographs(spec: str, tilts: tuple[float, float], count: int) -> Iterator[Shown]:
    """So many photographs of a curled board at such tilts, degrees."""
    target, rng = parse_target(spec), np.random.default_rng(int(tilts[1]))
    cameras = [camera.resized(SIZE) for camera in CAMERAS]
    for number in range(count):
        yield _photograph(target, cameras[number % len(cameras)], np.deg2rad(tilts), rng)


def _photograph(target: Target, camera: Camera, tilts: ndarray, rng: np.random.Generator) -> Shown:
    drawing, points = target.drawing(), target.points
    length, middle = float(drawing.size.max()), 0.5 * (drawing.low + drawing.high)
    about, bend = rng.uniform(0.0, 2.0 * np.pi, 2)
    sag = rng.uniform(0.2, 1.0) * MOST_SAG * length
    radius = float(rng.choice((-1.0, 1.0))) * (length**2 / 8.0 + 0.5 * sag**2) / sag
    curl = Curl(middle, np.array([np.cos(bend), np.sin(bend)]), radius)
    pose = _pose(camera, middle, length, tilt=float(rng.uniform(*tilts)), about=float(about), rng=rng)
    places, normals = curl.bent(points[:, :2])
    truth, eye = camera.project(pose.apply(places)), -pose.rotation.T @ pose.translation
    towards = (eye - places) / np.linalg.norm(eye - places, axis=1)[:, None]
    facing = np.abs((towards * normals).sum(1))
    sheet = Sheet(drawing, black=BLACK_LEVEL, white=WHITE_LEVEL)
    light = _seen_light(camera, pose, curl, sheet)
    picture = cv2.GaussianBlur(light, (0, 0), BLUR) + rng.normal(0.0, NOISE, light.shape)
    met = curl.seen(eye, towards * -1.0, sheet).T  # what hides a corner is met before it
    step = 2.0 * margin_of(target) / length * FILL * SIZE[1]
    whole = (facing > LEAST_FACING) & (np.linalg.norm(met - points[:, :2], axis=1) < 1e-6)
    whole &= ((truth > step) & (truth < np.array(SIZE) - 1.0 - step)).all(1)
    return Shown(np.clip(np.rint(picture), 0, 255).astype(np.uint8), truth, whole)


def _pose(
    camera: Camera,
    middle: Float[ndarray, " 2"],
    length: float,
    *,
    tilt: float,
    about: float,
    rng: np.random.Generator,
) -> Pose:
    """A board in the middle of the picture, rolled anyhow."""
    tilted = rotation_from_vector(tilt * np.array([np.cos(about), np.sin(about), 0.0]))
    turned = tilted @ rotation_from_vector(np.array([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)]))
    half = camera.unproject(0.5 * np.array(SIZE) + [[0.0, 0.5 * FILL * SIZE[1]]])[0]
    distance = 0.5 * length * half[2] / np.hypot(half[0], half[1])
    return Pose(turned, np.array([0.0, 0.0, distance]) - turned @ np.array([*middle, 0.0]))


def _seen_light(camera: Camera, pose: Pose, curl: Curl, sheet: Sheet) -> Float[ndarray, "h w"]:
    """The picture before blur and noise."""
    width, height = SIZE
    y, x = np.mgrid[:height, :width].reshape(2, -1).astype(float)
    rays = camera.unproject(np.stack([x, y], axis=1)) @ pose.rotation
    place = curl.seen(-pose.rotation.T @ pose.translation, rays, sheet).reshape(2, height, width)
    slopes = np.stack(np.gradient(place, axis=(2, 1)), axis=1)
    least, most = np.abs(slopes).max(1).min(0), np.abs(slopes).max((0, 1))
    on = (least > 0.0) & (most < TORN)
    cover, grey = sheet.look(place[:, on], slopes[:, :, on], OVERSAMPLING)
    light = np.full((height, width), float(BACKGROUND_LEVEL), np.float32)
    light[on] = light[on] * (1.0 - cover) + grey
    return light


def main() -> None:
    """What the module's docstring says."""
    parser = argparse.ArgumentParser(description="Boards of paper that curls.")
    parser.add_argument("--count", type=int, default=24, help="photographs of each board and range of tilts")
    count = parser.parse_args().count
    print("| board | tilts | found | corners of those that face the camera | rms, px | worst, px | false |")
    print("|---|---|---|---|---|---|---|")
    for spec in BOARDS:
        target = parse_target(spec)
        for tilts in TILTS:
            boards, found, shown, errors = 0, 0, 0, [np.zeros(0)]
            for one in photographs(spec, tilts, count):
                sight = see(one.picture, target)
                shown += int(one.whole.sum())
                if isinstance(sight, Sight):
                    ids = true_ids(target, one.truth, sight)
                    boards, found = boards + 1, found + int(one.whole[ids].sum())
                    errors.append(errors_of_sight(ids, one.truth, sight))
            off = np.concatenate(errors)
            rms = np.sqrt(0.5 * (off**2).mean()) if len(off) else 0.0
            print(
                f"| `{spec}` | {tilts[0]:.0f} to {tilts[1]:.0f} | {boards} of {count} |"
                f" {found} of {shown} ({found / max(shown, 1):.1%}) | {rms:.3f} |"
                f" {off.max(initial=0.0):.2f} | {int((off > FALSE_PX).sum())} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
