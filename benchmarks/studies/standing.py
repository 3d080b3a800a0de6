"""Where a board stands in each photograph: an aim in the image, a tilt, a roll and a size, drawn until it can
be seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy import ndarray

from benchmarks.studies.projectors import Projector

__all__ = ["Standing", "stand"]

ATTEMPTS = 400
GRAZING = np.cos(np.deg2rad(72.0))  # of the angle between a line of sight and the board's normal
FITTING = 6  # rounds that bring the board to the size that was drawn


@dataclass(frozen=True)
class Standing:
    """How a person holds the board.

    Args:
        count: of photographs.
        tilt: least and greatest, degrees, against the line of sight.
        fill: least and greatest share of the image's height or width.
        reach: how far from the image's middle boards are aimed, as a share of the way to its border.
        seen: least share of the corners that are in the image; 1 for whole boards.
        middle: of all aims, as shares of the image.
        roll: greatest turn in the board's own plane, degrees.
    """

    count: int = 15
    tilt: tuple[float, float] = (5.0, 45.0)
    fill: tuple[float, float] = (0.4, 0.8)
    reach: float = 0.8
    seen: float = 1.0
    middle: tuple[float, float] = (0.5, 0.5)
    roll: float = 180.0


def stand(
    camera: Projector, points: ndarray, standing: Standing, rng: np.random.Generator
) -> list[tuple[ndarray, ndarray]]:
    """Rotation (3,3) and translation (3,) camera_from_target of each photograph."""
    return [_one(camera, points, standing, rng) for _ in range(standing.count)]


def _one(
    camera: Projector, points: ndarray, standing: Standing, rng: np.random.Generator
) -> tuple[ndarray, ndarray]:
    size, middle = np.array(camera.size), points.mean(0)
    for attempt in range(ATTEMPTS):
        nearer = standing.reach * 0.995**attempt
        aim = (np.array(standing.middle) + 0.5 * nearer * rng.uniform(-1.0, 1.0, 2)) * size
        sight = camera.directions(aim)[0]
        rotation = _facing(sight) @ _turned(rng, standing)
        wanted = rng.uniform(*standing.fill)
        distance = float(np.ptp(points[:, :2], axis=0).max()) * camera.focal[0] / (wanted * size[0])
        for _ in range(FITTING):
            seen = camera.pixels(points @ rotation.T + distance * sight - rotation @ middle)
            box = np.nanmax(np.ptp(seen, axis=0) / size) if np.isfinite(seen).all() else 2.0 * wanted
            distance *= float(np.clip(box / wanted, 0.6, 1.6))
        translation = distance * sight - rotation @ middle
        if _good(camera, points @ rotation.T + translation, rotation, standing.seen):
            return rotation, translation
    raise RuntimeError(f"no board can stand as {standing} asks before {camera}")


def _good(camera: Projector, points: ndarray, rotation: ndarray, least: float) -> bool:
    seen = camera.pixels(points)
    inside = ((seen >= 0.0) & (seen <= np.array(camera.size) - 1.0)).all(1)
    sight = points / np.linalg.norm(points, axis=1)[:, None]
    upright = sight @ rotation[:, 2] > GRAZING
    return bool((inside & upright).mean() >= least and inside.sum() >= 8 and upright[inside].all())


def _turned(rng: np.random.Generator, standing: Standing) -> ndarray:
    tilt, axis = np.deg2rad(rng.uniform(*standing.tilt)), rng.uniform(-np.pi, np.pi)
    roll = np.deg2rad(standing.roll) * rng.uniform(-1.0, 1.0)
    return (
        cv2.Rodrigues(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))[0]
        @ cv2.Rodrigues(np.array([0.0, 0.0, roll]))[0]
    )


def _facing(sight: ndarray) -> ndarray:
    """The shortest turn that takes the z axis to a direction."""
    axis = np.cross([0.0, 0.0, 1.0], sight)
    sine = np.linalg.norm(axis)
    return np.eye(3) if sine < 1e-12 else cv2.Rodrigues(axis / sine * np.arctan2(sine, sight[2]))[0]
