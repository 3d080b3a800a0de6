"""Made photographs whose truth is known: a camera that is not this project's own, a board as boards are, and
what can go wrong.

A `World` is made from a `Recipe` and a seed: poses are drawn for a board (standing.py), the board is what it
really is (boards.py), each photograph has its own camera where something moved (`CAMERAS`), noise is white,
alike within a view, or heavy-tailed, and a detector makes its mistakes (`DETECTORS`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from benchmarks.studies.boards import grid, shaped, smooth_height
from benchmarks.studies.projectors import Projector
from benchmarks.studies.standing import Standing, stand

__all__ = ["CAMERAS", "DETECTORS", "Photograph", "Recipe", "World", "made", "true_error"]

ROWS = 4  # rounds in which a rolling shutter finds the time at which a corner was read


class Photograph(NamedTuple):
    """What a detector found: ids (n,), pixels (n,2)."""

    image: str
    ids: ndarray
    pixels: ndarray


@dataclass(frozen=True)
class Recipe:
    """What is photographed, by what, how, and what went wrong.

    Args:
        camera: the true one.
        board: columns, rows, square in metres.
        standing: where the board is held.
        noise: standard deviation of each coordinate, pixels.
        alike: of a smooth error that a whole view shares, pixels.
        tails: degrees of freedom of the noise's t distribution; 0 for normal noise.
        shape: share of the board's size for each kind of SHAPES.
        bending: share of the board's size by which each view bends it anew.
        cameras: name of CAMERAS and how much.
        shutter: how far the board moves across the image while it is read, as a share of its width (rms).
        detectors: names of DETECTORS and how much, in order.
    """

    camera: Projector = Projector()
    board: tuple[int, int, float] = (9, 6, 0.025)
    standing: Standing = Standing()
    noise: float = 0.1
    alike: float = 0.0
    tails: float = 0.0
    shape: Mapping[str, float] = field(default_factory=dict)
    bending: float = 0.0
    cameras: tuple[str, float] = ("one", 0.0)
    shutter: float = 0.0
    detectors: tuple[tuple[str, float], ...] = ()


class World(NamedTuple):
    """What was found, and the truth.

    Args:
        photographs: in the order of a folder.
        cameras: of each photograph as it was drawn, before detectors made mistakes.
        groups: of each photograph, which camera it was; all alike where there is but one.
        recipe: what it was made by.
        distance: of the board in the typical photograph, metres.
    """

    photographs: list[Photograph]
    cameras: list[Projector]
    groups: list[int]
    recipe: Recipe
    distance: float


def made(recipe: Recipe, seed: int) -> World:
    """The world of a recipe; the same for the same seed."""
    rng = np.random.default_rng([seed, 20260])
    flat = grid(*recipe.board)
    board = shaped(flat, dict(recipe.shape), rng)
    poses = stand(recipe.camera, flat, recipe.standing, rng)
    kind, amount = recipe.cameras
    cameras, groups, poses = CAMERAS[kind](recipe.camera, poses, amount, rng)
    photographs = []
    for i, (camera, (rotation, translation)) in enumerate(zip(cameras, poses, strict=True)):
        points = smooth_height(board, recipe.bending, rng) if recipe.bending else board
        pixels = _seen(camera, points, rotation, translation, _motion(recipe, translation, rng))
        inside = ((pixels >= 0.0) & (pixels <= np.array(camera.size) - 1.0)).all(1)
        pixels = pixels + _noise(recipe, flat, rng)
        photographs.append(Photograph(f"{i + 1:02d}.jpg", np.flatnonzero(inside), pixels[inside]))
    for name, amount in recipe.detectors:
        photographs = DETECTORS[name](photographs, amount, recipe, rng)
    distance = float(np.median([np.linalg.norm(translation) for _, translation in poses]))
    return World(photographs, cameras, groups, recipe, distance)


def true_error(world: World, pixels: ndarray, rays: ndarray) -> float:
    """How far off an estimated camera is: rms over pixels, against the true camera of every photograph.

    A rotation is fitted out, of directions; behind a window in water, where no camera has a single centre, a
    motion, of points at the target's distance.

    Args:
        pixels: (n,2) of the estimated camera's image.
        rays: (n,3) which it says they show; rows of NaN take no part.
    """
    known = np.isfinite(rays).all(1)
    each = [
        _apart(camera, pixels[known], rays[known], world.distance) for camera in dict.fromkeys(world.cameras)
    ]
    return float(np.sqrt(np.mean(np.square(each)))) if known.any() else float("nan")


def _apart(camera: Projector, pixels: ndarray, rays: ndarray, distance: float) -> float:
    """Rms distance of the pixels from where the true camera, moved as fits best, sees the points."""
    turn, shift, step = np.diag([-1.0, -1.0, 1.0]) if camera.turned else np.eye(3), np.zeros(3), 1e-5
    points = rays * distance
    off = np.full_like(pixels, np.nan)
    for _ in range(8):
        moved = points @ turn.T + shift
        off = camera.pixels(moved) - pixels
        steps = [moved @ _turn(step * axis).T for axis in np.eye(3)]
        steps += [moved + step * axis for axis in np.eye(3)] if camera.port else []
        by_step = np.stack([(camera.pixels(stepped) - pixels - off) / step for stepped in steps], -1)
        good = np.isfinite(off).all(1) & np.isfinite(by_step).all((1, 2))
        if good.sum() < 6:
            return float("inf")
        least = np.linalg.lstsq(by_step[good].reshape(-1, len(steps)), -off[good].ravel(), rcond=None)[0]
        turned = _turn(least[:3])
        turn, shift = turned @ turn, turned @ shift + (least[3:] if camera.port else 0.0)
    good = np.isfinite(off).all(1)
    return float(np.sqrt((off[good] ** 2).sum(1).mean()))


def _turn(vector: ndarray) -> ndarray:
    angle = float(np.linalg.norm(vector))
    if angle < 1e-300:
        return np.eye(3)
    x, y, z = vector / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def _motion(recipe: Recipe, translation: ndarray, rng: np.random.Generator) -> ndarray:
    """How far the board moves while the image is read, metres."""
    if not recipe.shutter:
        return np.zeros(3)
    width = recipe.camera.size[0] / recipe.camera.focal[0] * translation[2]
    return recipe.shutter * width * rng.normal(size=3) * [1.0, 1.0, 0.0]


def _seen(
    camera: Projector, points: ndarray, rotation: ndarray, translation: ndarray, motion: ndarray
) -> ndarray:
    at = points @ rotation.T + translation
    pixels = camera.pixels(at)
    if motion.any():
        for _ in range(ROWS):
            time = np.nan_to_num(pixels[:, 1] / camera.size[1] - 0.5)
            pixels = camera.pixels(at + time[:, None] * motion)
    return pixels


def _noise(recipe: Recipe, flat: ndarray, rng: np.random.Generator) -> ndarray:
    shape = (len(flat), 2)
    white = (
        rng.standard_t(recipe.tails, shape) / np.sqrt(recipe.tails / (recipe.tails - 2))
        if recipe.tails
        else rng.normal(size=shape)
    )
    if not recipe.alike:
        return recipe.noise * white
    x, y = (flat[:, :2] - flat[:, :2].mean(0)).T / np.ptp(flat[:, 0]) * 2.0
    waves = np.stack([x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3], 1)
    waves = np.linalg.qr(waves)[0] * np.sqrt(len(flat))
    return recipe.noise * white + recipe.alike * waves @ rng.normal(size=(waves.shape[1], 2)) / np.sqrt(
        waves.shape[1]
    )


# Cameras: the true camera and the poses to the camera of each photograph, its group, and its pose.

Poses = list[tuple[ndarray, ndarray]]
Cameras = Callable[[Projector, Poses, float, np.random.Generator], tuple[list[Projector], list[int], Poses]]


def _alternately(other: Callable[[Projector, float], Projector]) -> Cameras:
    def two(
        camera: Projector, poses: Poses, amount: float, rng: np.random.Generator
    ) -> tuple[list[Projector], list[int], Poses]:
        group = rng.permutation(np.arange(len(poses)) % 2).tolist()
        return [other(camera, amount) if g else camera for g in group], group, poses

    return two


def _each(other: Callable[[Projector, float, np.random.Generator], Projector]) -> Cameras:
    return lambda camera, poses, amount, rng: (
        [other(camera, amount, rng) for _ in poses],
        list(range(len(poses))),
        poses,
    )


def _copies(
    camera: Projector, poses: Poses, amount: float, rng: np.random.Generator
) -> tuple[list[Projector], list[int], Poses]:
    """The same pictures again, straightened by another program."""
    straight = replace(
        camera, coefficients=(0.0, 0.0, 0.0, 0.0), fisheye=False, focal=(camera.focal[0] * (1 - amount),) * 2
    )
    return [camera] * len(poses) + [straight] * len(poses), [0] * len(poses) + [1] * len(poses), poses * 2


CAMERAS: dict[str, Cameras] = {
    "one": lambda camera, poses, _, rng: ([camera] * len(poses), [0] * len(poses), poses),
    "zoom": _alternately(lambda camera, ratio: camera.zoomed(1.0 + ratio)),
    "other": _alternately(
        lambda camera, share: camera.shifted(share * camera.size[0], share * camera.size[0])
    ),
    "turned": _alternately(lambda camera, _: replace(camera, turned=True)),
    "lenses": _alternately(
        lambda camera, share: replace(
            camera, coefficients=tuple(k * (1 - share) for k in camera.coefficients)
        )
    ),
    "breathing": _each(lambda camera, share, rng: camera.zoomed(1.0 + share * rng.normal())),
    "stabiliser": _each(lambda camera, px, rng: camera.shifted(*(px * rng.normal(size=2)))),
    "copies": _copies,
}


# Detectors: what they make of photographs.

Detector = Callable[[list[Photograph], float, Recipe, np.random.Generator], list[Photograph]]


def _wild(
    photographs: list[Photograph], share: float, recipe: Recipe, rng: np.random.Generator
) -> list[Photograph]:
    """A share of all corners is anywhere within 40 px."""
    wild = []
    for photo in photographs:
        off = rng.random(len(photo.ids)) < share
        wild.append(
            photo._replace(pixels=photo.pixels + off[:, None] * rng.uniform(-40.0, 40.0, (len(off), 2)))
        )
    return wild


def _first(change: Callable[[Photograph, Recipe, np.random.Generator], Photograph]) -> Detector:
    """Some of the photographs, `amount` of them, are changed."""

    def detector(
        photographs: list[Photograph], amount: float, recipe: Recipe, rng: np.random.Generator
    ) -> list[Photograph]:
        chosen = set(rng.permutation(len(photographs))[: int(amount)].tolist())
        return [change(photo, recipe, rng) if i in chosen else photo for i, photo in enumerate(photographs)]

    return detector


def _shift(photo: Photograph, recipe: Recipe, rng: np.random.Generator) -> Photograph:
    """The board was found one row too low: its ids are those of the next row; the last row is lost."""
    columns, rows, _ = recipe.board
    keep = photo.ids < columns * (rows - 1)
    return photo._replace(ids=photo.ids[keep] + columns, pixels=photo.pixels[keep])


def _transpose(photo: Photograph, recipe: Recipe, rng: np.random.Generator) -> Photograph:
    """Its corners were listed column by column."""
    columns, rows, _ = recipe.board
    row, column = np.divmod(photo.ids, columns)
    return photo._replace(ids=column * rows + row)


def _shuffle(photo: Photograph, recipe: Recipe, rng: np.random.Generator) -> Photograph:
    return photo._replace(ids=rng.permutation(photo.ids))


def _upside_down(photo: Photograph, recipe: Recipe, rng: np.random.Generator) -> Photograph:
    """The board was taken to be the other way up."""
    columns, rows, _ = recipe.board
    return photo._replace(ids=columns * rows - 1 - photo.ids)


def _blurred(photo: Photograph, recipe: Recipe, rng: np.random.Generator) -> Photograph:
    return photo._replace(pixels=photo.pixels + 20.0 * recipe.noise * rng.normal(size=photo.pixels.shape))


def _another_board(photo: Photograph, recipe: Recipe, rng: np.random.Generator) -> Photograph:
    """Every second column is 10 % of a square farther right: a board that only looks like this one."""
    columns, _, _ = recipe.board
    across = photo.ids % columns
    step = np.ptp(photo.pixels, axis=0).max() / columns
    return photo._replace(pixels=photo.pixels + 0.1 * step * (across % 2)[:, None] * [1.0, 0.0])


def _copied(
    photographs: list[Photograph], amount: float, recipe: Recipe, rng: np.random.Generator
) -> list[Photograph]:
    """Every photograph `amount` times, from a tripod: the same but for noise."""
    return [
        Photograph(
            f"{photo.image[:-4]}-{k}.jpg",
            photo.ids,
            photo.pixels + 0.2 * recipe.noise * rng.normal(size=photo.pixels.shape),
        )
        for photo in photographs
        for k in range(int(amount))
    ]


DETECTORS: dict[str, Detector] = {
    "wild": _wild,
    "shifted": _first(_shift),
    "transposed": _first(_transpose),
    "shuffled": _first(_shuffle),
    "upside down": _first(_upside_down),
    "blurred": _first(_blurred),
    "another board": _first(_another_board),
    "copied": _copied,
}
