"""Rendered photographs of chessboards, with the truth about every corner."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer
from orthoscope.simulation.scene import Scene, random_views
from orthoscope.targets.target import chessboard

__all__ = ["Condition", "Photographs", "rendered"]

USUAL_LENS = Brown(k1=-0.2, k2=0.05)


@dataclass(frozen=True)
class Condition:
    """What is photographed and how: size (width, height), least and greatest tilt (degrees), blur (px), noise
    (grey levels at mid-grey).
    """

    name: str
    size: tuple[int, int] = (1280, 960)
    tilt: tuple[float, float] = (0.0, 35.0)
    blur: float = 0.7
    noise: float = 2.0
    lens: Lens = USUAL_LENS
    grid: tuple[int, int] = (14, 9)
    count: int = 3

    @property
    def camera(self) -> Camera:
        """A camera as wide as it is far away."""
        width, height = self.size
        focal = float(width)
        return Camera(self.size, Intrinsics(focal, focal, 0.5 * width + 3.3, 0.5 * height - 2.6), self.lens)


@dataclass(frozen=True)
class Photographs:
    """Files, and where the corners are in each (m,2), pixels."""

    paths: list[str]
    corners: list[Float[ndarray, "m 2"]]
    grid: tuple[int, int]

    def errors(self, found: list[list[list[float]]]) -> list[Float[ndarray, " m"] | None]:
        """Distance of each corner found from the truth, px, in any order; None for a photograph without a
        whole board.
        """
        return [
            _distances(truth, np.array(corners)) for truth, corners in zip(self.corners, found, strict=True)
        ]


def rendered(condition: Condition, folder: Path) -> Photographs:
    """Photographs of this condition, lossless; the same every time."""
    camera, square = condition.camera, 0.02
    target = chessboard(*condition.grid, square)
    rng = np.random.default_rng(1)
    tilt = (np.deg2rad(condition.tilt[0]), np.deg2rad(condition.tilt[1]))
    poses = random_views(camera, target, condition.count, rng=rng, tilt=tilt, fill=(0.6, 0.9), margin=square)
    renderer = Renderer(camera, blur_px=condition.blur, noise=condition.noise)
    paths = []
    for i, pose in enumerate(poses):
        paths.append(str(folder / f"{condition.name.replace(' ', '-').replace('/', '-')}-{i}.png"))
        cv2.imwrite(paths[-1], renderer.photograph(target, pose, rng=rng), [cv2.IMWRITE_PNG_COMPRESSION, 1])
    return Photographs(paths, list(Scene(camera, target, poses).corner_pixels()), condition.grid)


def _distances(truth: Float[ndarray, "m 2"], corners: ndarray) -> Float[ndarray, " m"] | None:
    """From each true corner to the found one that is nearest; None where these are not one for each."""
    if corners.shape != truth.shape:
        return None
    distances = np.hypot(*(truth[:, None] - corners[None]).transpose(2, 0, 1))
    nearest = distances.argmin(1)
    return distances.min(1) if len(np.unique(nearest)) == len(truth) else None
