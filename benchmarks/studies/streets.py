"""Photographs of a made-up street by a camera that is known: facades, windows, and much that is not straight.

A straight picture is drawn three times as large, blurred, and looked up through the lens; then comes noise.
Every line of the scene is straight in space; crowns, wheels and cables are not.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy import ndarray

from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.lens import Lens

__all__ = ["street_camera", "street_photograph"]

OVERSAMPLING = 3


def street_photograph(camera: Camera, *, rng: np.random.Generator, noise: float = 3.0) -> ndarray:
    """A grey photograph, uint8.

    Args:
        camera: that takes it.
        rng: the source of the street and of the noise.
        noise: standard deviation, grey values.
    """
    width, height = camera.image_size
    side = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2).astype(float)
    straight = camera.undistort_pixels(side)
    low, high = np.nanmin(straight, axis=0) - 2, np.nanmax(straight, axis=0) + 2
    drawn = _street((OVERSAMPLING * (high - low)).astype(int) + 1, rng)
    where = ((straight - low) * OVERSAMPLING).astype(np.float32).reshape(height, width, 2)
    seen = cv2.remap(
        cv2.GaussianBlur(drawn, (0, 0), 0.6 * OVERSAMPLING), where[..., 0], where[..., 1], cv2.INTER_LINEAR
    )
    return np.clip(seen + rng.normal(0, noise, seen.shape), 0, 255).astype(np.uint8)


def street_camera(
    lens: Lens, *, centre: tuple[float, float] = (330.0, 232.0), focal: float = 520.0
) -> Camera:
    """A camera of 640 x 480 pixels with the lens about a centre of its own."""
    K = Intrinsics(focal, focal, 320.0, 240.0)
    return Camera((640, 480), K, lens, lens_frame=Intrinsics(focal, focal, *centre))


def _street(size: ndarray, rng: np.random.Generator) -> ndarray:
    """Two walls and a front in perspective, with rows of windows; poles, crowns and cables."""
    width, height = map(int, size)
    picture = np.full((height, width), 205, np.float32)
    vanishing = np.array([rng.uniform(0.3, 0.7) * width, rng.uniform(0.35, 0.65) * height])
    for turn in range(3):
        shade = rng.uniform(70, 180)
        _wall(picture, _corners(turn, vanishing, width, height, rng), shade, rng)
    for _ in range(4):  # poles and the paving run on over everything
        ends = np.array([vanishing + rng.uniform(0.05, 0.1) * width, [rng.uniform(0, width), height]])
        cv2.polylines(picture, [_fixed(ends)], False, rng.uniform(10, 250), 9, cv2.LINE_AA, 4)
        x = rng.uniform(0.05, 0.95) * width
        pole = np.array([[x, rng.uniform(0, 0.3) * height], [x + rng.uniform(-9, 9), height]])
        cv2.polylines(picture, [_fixed(pole)], False, rng.uniform(10, 250), 18, cv2.LINE_AA, 4)
    for _ in range(12):  # crowns, wheels, people
        centre, axes = rng.uniform(0, 1, 2) * size, rng.uniform(0.01, 0.06, 2) * width
        spot = tuple(map(int, centre)), tuple(map(int, axes)), rng.uniform(0, 180)
        cv2.ellipse(picture, *spot, 0, 360, rng.uniform(20, 230), -1)
    for _ in range(2):  # cables that hang: bent in space
        x = np.linspace(0, width, 60)
        y = rng.uniform(0.1, 0.5) * height - rng.uniform(0.02, 0.12) * height * ((2 * x / width - 1) ** 2)
        cv2.polylines(picture, [_fixed(np.stack([x, y], axis=-1))], False, 30.0, 7, cv2.LINE_AA, 4)
    grain = cv2.resize(
        rng.normal(0, 6, (height // 9 + 1, width // 9 + 1)).astype(np.float32), (width, height)
    )
    return picture + grain


def _corners(turn: int, vanishing: ndarray, width: int, height: int, rng: np.random.Generator) -> ndarray:
    """A wall to the left, to the right, or the front between: four corners of a rectangle in perspective."""
    if turn == 2:
        w, h = rng.uniform(0.2, 0.35) * width, rng.uniform(0.3, 0.45) * height
        skewed = rng.uniform(-0.05, 0.05, (4, 2)) * [w, h]
        return vanishing + np.array([[-w, -h], [w, -h], [w, h], [-w, h]]) / 2 + skewed
    x = 0.0 if turn == 0 else float(width)
    top, bottom, share = -0.1 * height, rng.uniform(0.9, 1.2) * height, rng.uniform(0.55, 0.75)
    near = np.array([[x, top], [x, bottom]])
    far = near + share * (vanishing - near)
    return np.array([near[0], far[0], far[1], near[1]])


def _wall(picture: ndarray, corners: ndarray, shade: float, rng: np.random.Generator) -> None:
    """A wall with windows in rows."""
    to_picture = cv2.getPerspectiveTransform(
        np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32), corners.astype(np.float32)
    )
    cv2.fillPoly(picture, [_fixed(corners)], shade, cv2.LINE_AA, 4)
    columns, rows = int(rng.integers(5, 9)), int(rng.integers(4, 7))

    def draw(left: float, top: float, wide: float, high: float, grey: float) -> None:
        box = np.array([[left, top], [left + wide, top], [left + wide, top + high], [left, top + high]])
        seen = cv2.perspectiveTransform(box[None].astype(np.float32), to_picture)[0]
        cv2.fillPoly(picture, [_fixed(seen)], float(grey), cv2.LINE_AA, 4)

    for row in range(rows):
        draw(0.0, row / rows, 1.0, 0.12 / rows, shade + 35)  # a cornice
        for column in range(columns):
            grey = shade + rng.choice([-60, 60])
            draw((column + 0.2) / columns, (row + 0.3) / rows, 0.6 / columns, 0.5 / rows, grey)


def _fixed(points: ndarray) -> ndarray:
    """Points as OpenCV draws them, in sixteenths of a pixel."""
    return np.round(points * 16).astype(np.int32)
