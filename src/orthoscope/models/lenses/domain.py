"""Where a lens ends: in each direction of the chart, the radius at which its map first folds.

A place at radius s lies in the domain where s is below the end of its direction and the determinant is
positive. Both are needed: beyond a fold the determinant may become positive again (a decentred lens is
quadratic far out, and a quadratic map covers the plane twice), while the ends are known in some directions
only. These are even, and halved where the end changes fast.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import ndarray

__all__ = ["Domain", "find_domain"]

# The end is looked for in this many even directions first.
DIRECTION_COUNT = 64
# A direction is halved at most this often: 2 pi / 64 / 2^12 is 2e-5 radians, a twentieth of a pixel of 4000.
HALVING_ROUNDS = 12
# Neighbouring ends a < b with b - a > STEEP_SHARE a (1 + b) get another end between them.
STEEP_SHARE = 0.02
# Between neighbours that are not steep an end may lie beyond both by this share.
END_MARGIN = 0.01

# Whether a map has folded at places, of which radius, cosine and sine are given.
Folded = Callable[[ndarray, ndarray, ndarray], ndarray]


@dataclass(frozen=True, eq=False)
class Domain:
    """The part of a chart that a lens images.

    Attributes:
        hole: radius around the centre without image.
        angles: (d,) of directions, ascending from -pi to pi.
        ends: (d,) radii at which the domain ends in these directions.
    """

    hole: float
    angles: ndarray
    ends: ndarray

    @property
    def symmetric(self) -> bool:
        """Whether the domain is a disc (or a ring), its end exact."""
        return len(self.ends) == 2

    @property
    def inner(self) -> float:
        """Everything nearer (and beyond the hole) is in the domain."""
        return float(self.ends[0] if self.symmetric else (1.0 - END_MARGIN) * self.ends.min())

    @property
    def outer(self) -> float:
        """The end in the direction where it is farthest."""
        return float(self.ends.max())

    def ends_towards(self, x: ndarray, y: ndarray) -> ndarray:
        """For each place (x, y) about the radius at which the domain ends in its direction.

        The domain ends no nearer than that but in the few narrow sectors that are steep.
        """
        a, b = self.ends[:-1], self.ends[1:]
        ends = np.where(_steep(self.ends), np.minimum(a, b), (1.0 + END_MARGIN) * np.maximum(a, b))
        sector = np.searchsorted(self.angles, np.arctan2(y, x)) - 1
        return ends[sector.clip(0, len(ends) - 1)]


def find_domain(folded: Folded, radii: ndarray, *, hole: float, symmetric: bool) -> Domain:
    """The domain of a map.

    Args:
        folded: tells of places (radius, cosine, sine) whether the map has folded there.
        radii: (n,) ascending, at which it is looked at first.
        hole: radius around the centre without image.
        symmetric: whether all directions end alike.
    """
    if symmetric:
        return Domain(hole, np.array([-np.pi, np.pi]), np.repeat(_first_fold(folded, radii, np.zeros(1)), 2))
    angles = np.linspace(-np.pi, np.pi, DIRECTION_COUNT + 1)
    ends = _first_fold(folded, radii, angles)
    for _ in range(HALVING_ROUNDS):
        steep = np.flatnonzero(_steep(ends))
        if not len(steep):
            break
        between = 0.5 * (angles[steep] + angles[steep + 1])
        angles = np.insert(angles, steep + 1, between)
        ends = np.insert(ends, steep + 1, _first_fold(folded, radii, between))
    return Domain(hole, angles, ends)


def _steep(ends: ndarray) -> ndarray:
    """Between which neighbours the end changes fast."""
    a, b = np.minimum(ends[:-1], ends[1:]), np.maximum(ends[:-1], ends[1:])
    return b - a > STEEP_SHARE * a * (1.0 + b)


def _first_fold(folded: Folded, radii: ndarray, angles: ndarray) -> ndarray:
    """In each direction the radius up to which the map has not folded.

    It is looked for among the radii, then 32 times finer again and again.
    """
    cosine, sine = np.cos(angles), np.sin(angles)
    radii = np.concatenate([[0.0], radii])
    bad = folded(radii[1:, None], cosine, sine)
    ever, first = bad.any(0), bad.argmax(0)
    low, high = radii[first], radii[first + 1]
    fractions = np.linspace(0.0, 1.0, 33)[:, None]
    for _ in range(8):
        between = low + (high - low) * fractions
        cell = folded(between[1:-1], cosine, sine)
        first = np.where(cell.any(0), cell.argmax(0), 31)
        low, high = np.take_along_axis(between, np.stack([first, first + 1]), axis=0)
    return np.where(ever, low, radii[-1])
