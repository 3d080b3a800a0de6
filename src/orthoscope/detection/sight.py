"""What a detector says of one photograph: corners with their ids, or why there are none."""

from __future__ import annotations

from typing import NamedTuple

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["TWICE", "Sight", "Unseen"]

# The remark where two boards alike are in a photograph.
TWICE = "is in it more than once; the one that shows most of itself was taken"


class Sight(NamedTuple):
    """Corners that were found.

    Attributes:
        ids: (n,) rows of the target's points, ascending.
        pixels: (n,2) where they are.
        remark: what a person should know of the choice, as it is told after the target's name; mostly empty.
        diameter: of discs as they are drawn, metres, told by the distances between them; 0 of others.
    """

    ids: Int[ndarray, " n"]
    pixels: Float[ndarray, "n 2"]
    remark: str = ""
    diameter: float = 0.0


class Unseen(NamedTuple):
    """Why there are none, as it is told after the target's name: `was not found in it`."""

    reason: str
