"""The pin-hole: K = [fx skew cx; 0 fy cy; 0 0 1] (the paper's A = [alpha gamma u0; 0 beta v0; 0 0 1])."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray

__all__ = ["Intrinsics"]


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """The pin-hole, pixels: u = fx x + skew y + cx, v = fy y + cy.

    Raises:
        InputError: a focal length is not positive or a number is not finite.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0

    def __post_init__(self) -> None:
        for name, value in zip(
            ("fx", "fy", "cx", "cy", "skew"), frozen(self.as_tuple(), (5,), "intrinsics"), strict=True
        ):
            object.__setattr__(self, name, float(value))
        if self.fx <= 0 or self.fy <= 0:
            raise InputError(f"focal lengths are {self.fx:g} and {self.fy:g} px; expected positive ones.")

    def as_tuple(self) -> tuple[float, float, float, float, float]:
        """(fx, fy, cx, cy, skew)."""
        return self.fx, self.fy, self.cx, self.cy, self.skew

    def after(self, undone: Intrinsics, done: Intrinsics) -> Intrinsics:
        """The pin-hole that does what `done` does, undoes `undone` and then does this: K times undone^-1
        times done.
        """
        if undone is done:
            return self
        (fx, skew, cx), (_, fy, cy), _ = self.matrix @ np.linalg.solve(undone.matrix, done.matrix)
        return Intrinsics(fx, fy, cx, cy, skew)

    @property
    def matrix(self) -> Float[ndarray, "3 3"]:
        """K (3,3)."""
        return np.array([[self.fx, self.skew, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def to_pixels(self, plane: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        """Pixels of places in the lens's plane."""
        return np.stack(self.pixel(plane[:, 0], plane[:, 1]), axis=-1)

    def to_plane(self, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        """Places in the lens's plane of pixels."""
        return np.stack(self.place(pixels[:, 0], pixels[:, 1]), axis=-1)

    def pixel(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        """The pixel (u, v) of a place in the lens's plane."""
        u = self.fx * x + self.cx
        return (u + self.skew * y if self.skew else u), self.fy * y + self.cy

    def place(self, u: ndarray, v: ndarray) -> tuple[ndarray, ndarray]:
        """The place (x, y) in the lens's plane of a pixel."""
        y = (v - self.cy) / self.fy
        x = u - self.cx
        return (x - self.skew * y if self.skew else x) / self.fx, y
