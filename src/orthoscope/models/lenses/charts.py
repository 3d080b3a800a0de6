"""Charts: how a ray is flattened to a plane before the lens acts on it.

(X, Y, Z) is a ray of any length, (x, y) its place in the chart, s = |(x, y)|, theta its angle from the axis.
Gnomonic: s = tan(theta), a pin-hole's plane, in front only. Equidistant: s = theta, all directions but
straight back. Coordinates are separate arrays of one shape; NaN where a ray has no place.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["EQUIDISTANT", "GNOMONIC", "Chart", "Covector", "PullBack"]

Covector = tuple[ndarray, ndarray, ndarray]
PullBack = Callable[[ndarray, ndarray], Covector]

# Below this angle theta and its sine are one; its square is a number still.
TINY_ANGLE = 1e-150


class Chart(ABC):
    """A flattening of the directions around the axis.

    Attributes:
        reach: the largest angle from the axis that has a place, radians.
    """

    reach: float

    @abstractmethod
    def flatten(self, X: ndarray, Y: ndarray, Z: ndarray) -> tuple[ndarray, ndarray]:
        """Place (x, y) of rays (X, Y, Z) of any length."""

    @abstractmethod
    def linearise(self, X: ndarray, Y: ndarray, Z: ndarray) -> tuple[ndarray, ndarray, PullBack]:
        """Place (x, y), and the function that takes d/d(x, y) of anything to its d/d(X, Y, Z)."""

    @abstractmethod
    def lift(self, x: ndarray, y: ndarray) -> Float[ndarray, "*batch 3"]:
        """Unit rays of places."""

    @abstractmethod
    def flat(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        """Where a pin-hole sees places: (X/Z, Y/Z) of their rays, NaN for those not in front of it."""

    @abstractmethod
    def radius(self, theta: Any) -> Any:
        """s of an angle from the axis."""

    @abstractmethod
    def angle(self, s: Any) -> Any:
        """The angle from the axis of a radius."""


class _Gnomonic(Chart):
    reach = np.pi / 2

    def flatten(self, X: ndarray, Y: ndarray, Z: ndarray) -> tuple[ndarray, ndarray]:
        depth = np.where(Z > 0, Z, np.nan)
        return X / depth, Y / depth

    def linearise(self, X: ndarray, Y: ndarray, Z: ndarray) -> tuple[ndarray, ndarray, PullBack]:
        inverse = 1.0 / np.where(Z > 0, Z, np.nan)
        x, y = X * inverse, Y * inverse

        def pull_back(along_x: ndarray, along_y: ndarray) -> Covector:
            return along_x * inverse, along_y * inverse, -(along_x * x + along_y * y) * inverse

        return x, y, pull_back

    def lift(self, x: ndarray, y: ndarray) -> Float[ndarray, "*batch 3"]:
        inverse = 1.0 / np.sqrt(1.0 + x * x + y * y)
        return np.stack([x * inverse, y * inverse, inverse], axis=-1)

    def flat(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        return x, y

    def radius(self, theta: Any) -> Any:
        return np.tan(theta)

    def angle(self, s: Any) -> Any:
        return np.arctan(s)


class _Equidistant(Chart):
    reach = np.pi

    def flatten(self, X: ndarray, Y: ndarray, Z: ndarray) -> tuple[ndarray, ndarray]:
        across = np.hypot(X, Y)
        stretch = self._stretch(across, Z)
        return X * stretch, Y * stretch

    def linearise(self, X: ndarray, Y: ndarray, Z: ndarray) -> tuple[ndarray, ndarray, PullBack]:
        across = np.hypot(X, Y)
        stretch = self._stretch(across, Z)
        square = 1.0 / (across * across + Z * Z)
        # This is (Z / R^2 - stretch) / across^2, by its limit near the axis, where the difference loses its
        # digits.
        near = across < 1e-4 * Z
        safe = np.where(near, 1.0, across)
        bend = np.where(
            near, -2.0 / (3.0 * np.where(near, Z, 1.0) ** 3), (Z * square - stretch) / (safe * safe)
        )

        def pull_back(along_x: ndarray, along_y: ndarray) -> Covector:
            along = along_x * X + along_y * Y
            return along_x * stretch + along * X * bend, along_y * stretch + along * Y * bend, -along * square

        return X * stretch, Y * stretch, pull_back

    def lift(self, x: ndarray, y: ndarray) -> Float[ndarray, "*batch 3"]:
        theta = np.sqrt(x * x + y * y)
        sinc = np.sin(theta) / np.maximum(theta, TINY_ANGLE)
        sinc[theta < TINY_ANGLE] = 1.0
        rays = np.stack([x * sinc, y * sinc, np.cos(theta)], axis=-1)
        rays[theta >= np.pi] = np.nan
        return rays

    def flat(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        theta = np.sqrt(x * x + y * y)
        stretch = np.tan(theta) / np.maximum(theta, TINY_ANGLE)
        stretch[theta < TINY_ANGLE] = 1.0
        stretch[theta >= 0.5 * np.pi] = np.nan
        return x * stretch, y * stretch

    def radius(self, theta: Any) -> Any:
        return theta

    def angle(self, s: Any) -> Any:
        return s

    @staticmethod
    def _stretch(across: ndarray, Z: ndarray) -> ndarray:
        """theta / sin(theta) / R; NaN straight back and for the ray of length zero."""
        axis = across == 0
        on_axis = 1.0 / np.where(Z > 0, Z, np.nan)
        return np.where(axis, on_axis, np.arctan2(across, Z) / np.where(axis, 1.0, across))


GNOMONIC: Chart = _Gnomonic()
EQUIDISTANT: Chart = _Equidistant()
