"""What is printed on a target's sheet: black rectangles and discs on white, white discs in them,
in metres on the target's plane.

One drawing serves the renderer, which photographs it, and the printer, which writes it to a file.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["Drawing"]


@dataclass(frozen=True, eq=False)
class Drawing:
    """Black shapes on a white sheet, in the target's frame, x right and y down as printed.

    Attributes:
        low, high: (2,) metres, opposite corners of the white sheet that the target needs.
        rectangles: (n,4) metres, x and y of one corner, then of the opposite one; they do not overlap.
        discs: (n,3) metres, x and y of the centre, radius; disjoint.
        holes: (n,3) white discs inside black rectangles; as `discs`.
    """

    low: Float[ndarray, "2"]
    high: Float[ndarray, "2"]
    rectangles: Float[ndarray, "n 4"] = field(default_factory=lambda: np.zeros((0, 4)))
    discs: Float[ndarray, "k 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    holes: Float[ndarray, "h 3"] = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def size(self) -> Float[ndarray, "2"]:
        """Width and height of the sheet, metres."""
        return self.high - self.low

    def moved(self, step: Float[ndarray, "2"]) -> Drawing:
        """The same shapes elsewhere on the plane."""
        return Drawing(
            self.low + step,
            self.high + step,
            self.rectangles + np.tile(step, 2),
            self.discs + np.array([*step, 0.0]),
            self.holes + np.array([*step, 0.0]),
        )
