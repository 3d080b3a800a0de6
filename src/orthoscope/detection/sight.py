"""What a detector says of one photograph: corners with their ids, or why there are none."""

from __future__ import annotations

from typing import NamedTuple

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["Sight", "Unseen"]


class Sight(NamedTuple):
    """Corners that were found.

    Attributes:
        ids: (n,) rows of the target's points, ascending.
        pixels: (n,2) where they are.
    """

    ids: Int[ndarray, " n"]
    pixels: Float[ndarray, "n 2"]


class Unseen(NamedTuple):
    """Why there are none, as it is told after the target's name: `was not found in it`."""

    reason: str
