"""Cameras that are not this project's own: what a verdict is judged against must not share its mistakes.

`brown` and its richer kin are cv2.projectPoints (4, 5, 8, 12 or 14 coefficients).  `fisheye` is the odd
polynomial of the angle, theta (1 + k1 theta^2 + ... + k4 theta^8), which cv2.fisheye.projectPoints is in
front of the camera and which goes on past 90 degrees.  A `port` is a flat window into water: a ray is bent
once, by Snell's law, and the camera has no single centre.  A telephone that was turned over writes the same
picture upside down.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy import ndarray

__all__ = ["Projector"]

WATER = 1.333
BISECTIONS = 60
POLAR, AROUND = 120, 144  # of the table by which a pixel is turned back into a direction
WIDEST = np.deg2rad(110.0)


@dataclass(frozen=True)
class Projector:
    """The truth about a camera.

    Args:
        size: (width, height), pixels.
        focal: (fx, fy), pixels.
        centre: (cx, cy), pixels.
        coefficients: of the lens, in OpenCV's order.
        fisheye: whether they are those of the fisheye.
        port: distance of a flat window into water, metres; 0 in air.
        turned: whether the picture is written upside down.
    """

    size: tuple[int, int] = (640, 480)
    focal: tuple[float, float] = (560.0, 558.0)
    centre: tuple[float, float] = (331.0, 236.0)
    coefficients: tuple[float, ...] = (-0.28, 0.09, 0.0006, -0.0004, 0.0)
    fisheye: bool = False
    port: float = 0.0
    turned: bool = False

    def pixels(self, points: ndarray) -> ndarray:
        """Where points (n,3), camera frame, are seen (n,2); NaN behind the camera, or where the lens has
        folded over.
        """
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        if self.port:
            points = _through_water(points, self.port)
        seen = self._fisheye(points) if self.fisheye else self._plane(points)
        return np.array(self.size) - 1.0 - seen if self.turned else seen

    def zoomed(self, ratio: float) -> Projector:
        """The same with another focal length."""
        return replace(self, focal=(self.focal[0] * ratio, self.focal[1] * ratio))

    def shifted(self, x: float, y: float) -> Projector:
        """The same with its principal point elsewhere, by pixels."""
        return replace(self, centre=(self.centre[0] + x, self.centre[1] + y))

    def directions(self, pixels: ndarray) -> ndarray:
        """Unit vectors (n,3) seen near pixels (n,2): those of the nearest entry of a table, good to a degree
        or two.
        """
        towards, at = self._table
        nearest = [int(np.nanargmin(((at - pixel) ** 2).sum(1))) for pixel in np.reshape(pixels, (-1, 2))]
        return towards[nearest]

    @cached_property
    def _table(self) -> tuple[ndarray, ndarray]:
        theta, phi = np.meshgrid(np.linspace(0.0, WIDEST, POLAR), np.linspace(0.0, 2.0 * np.pi, AROUND))
        fine = theta.ravel() * (1.0 if self.fisheye else min(1.0, 1.2 * self._half_angle / WIDEST))
        towards = np.stack(
            [np.sin(fine) * np.cos(phi.ravel()), np.sin(fine) * np.sin(phi.ravel()), np.cos(fine)], 1
        )
        return towards, self.pixels(towards * 1e3)

    @property
    def _half_angle(self) -> float:
        corners = np.array([[0, 0], [self.size[0], 0], [0, self.size[1]], self.size], dtype=float)
        return float(np.arctan(np.hypot(*((corners - self.centre) / self.focal).T).max() * 1.3))

    def _plane(self, points: ndarray) -> ndarray:
        seen = np.full((len(points), 2), np.nan)
        ahead = points[:, 2] > 1e-9
        if ahead.any():
            K = np.array(
                [[self.focal[0], 0, self.centre[0]], [0, self.focal[1], self.centre[1]], [0, 0, 1.0]]
            )
            lens = np.array(self.coefficients)
            seen[ahead] = cv2.projectPoints(points[ahead], np.zeros(3), np.zeros(3), K, lens)[0].reshape(
                -1, 2
            )
            seen[ahead] = np.where(self._unfolded(points[ahead])[:, None], seen[ahead], np.nan)
        return seen

    def _unfolded(self, points: ndarray) -> ndarray:
        """Whether the radial curve still grows from the axis to each point."""
        k = np.zeros(8)
        k[: min(8, len(self.coefficients))] = self.coefficients[:8]
        r = np.linspace(0.0, 6.0, 3001)
        s = r * r
        curve = r * (1 + s * (k[0] + s * (k[1] + s * k[4]))) / (1 + s * (k[5] + s * (k[6] + s * k[7])))
        falls = np.flatnonzero(np.diff(curve) <= 0.0)
        end = r[falls[0]] if len(falls) else np.inf
        return np.hypot(points[:, 0], points[:, 1]) < end * points[:, 2]

    def _fisheye(self, points: ndarray) -> ndarray:
        across = np.hypot(points[:, 0], points[:, 1])
        theta = np.arctan2(across, points[:, 2])
        k = np.zeros(4)
        k[: len(self.coefficients)] = self.coefficients
        s = theta * theta
        curve = theta * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))))
        plane = points[:, :2] * (curve / np.maximum(across, 1e-300))[:, None]
        grows = 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3]))) > 0.0
        return np.where(grows[:, None], plane * self.focal + self.centre, np.nan)


def _through_water(points: ndarray, port: float) -> ndarray:
    """Points in the direction, in air, by which the camera sees points that are in water behind a window at z
    = port.
    """
    across, depth = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    low, high = np.zeros(len(points)), np.full(len(points), 0.5 * np.pi - 1e-9)
    for _ in range(BISECTIONS):
        air = 0.5 * (low + high)
        water = np.arcsin(np.sin(air) / WATER)
        reaches = port * np.tan(air) + (depth - port) * np.tan(water)
        low, high = np.where(reaches < across, air, low), np.where(reaches < across, high, air)
    turned = points[:, :2] / np.maximum(across, 1e-300)[:, None] * np.tan(0.5 * (low + high))[:, None]
    return np.column_stack([turned, np.ones(len(points))])
