"""Where a target's corners really are: printed targets are stretched, bent and wavy.

The corners of a target are at its nominal points plus displacements, metres, in the target's frame. A
similarity would only move, turn or scale the whole target, which its poses (and the unit of length) do
already: displacements have none. `flat` trusts the target; `smooth` is a surface of low order, in-plane scale
and shear included; `free` gives each corner its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray
from orthoscope.geometry.pose import nearest_rotation

__all__ = ["SHAPES", "WHOLE", "TargetShape", "polynomials", "without_similarity"]

# The kinds of shape, from the stiffest to the softest.
SHAPES = ("flat", "smooth", "free")
# A smooth surface has these orders: a sheet was stretched, hangs or curls; waves are for single corners.
SMOOTH_ORDERS = (1, 2, 3, 4)
# A polynomial that differs from those before it by less than this share of its size is one of them.
LEAST_DIFFERENCE = 1e-6

# All corners as one body.
WHOLE = (slice(None),)


@dataclass(frozen=True, eq=False)
class TargetShape:
    """Where the corners of a target are.

    Attributes:
        kind: one of SHAPES.
        displacements: (m,3) metres, target frame, from nominal to real; 0 for corners that were never seen.
    Raises:
        InputError: another kind, or a flat target whose corners are displaced.
    """

    kind: str
    displacements: ndarray

    def __post_init__(self) -> None:
        if self.kind not in SHAPES:
            raise InputError(f"target shape {self.kind!r} is not known; expected one of {', '.join(SHAPES)}.")
        object.__setattr__(
            self, "displacements", frozen(self.displacements, (None, 3), "target shape: displacements")
        )
        if self.kind == "flat" and self.displacements.any():
            raise InputError(
                "a flat target's corners are displaced; expected displacements of 0, or the shape smooth or"
                " free."
            )

    def __repr__(self) -> str:
        apart = (
            1e3 * float(np.sqrt((self.displacements**2).sum(1).mean())) if len(self.displacements) else 0.0
        )
        return f"TargetShape({self.kind}, {len(self.displacements)} corners, {apart:.3g} mm rms from nominal)"

    @classmethod
    def flat(cls, corners: int) -> TargetShape:
        """The shape of a target with so many corners that is as it is said to be."""
        return cls("flat", np.zeros((corners, 3)))

    @property
    def rms(self) -> float:
        """Root mean square of the displacements' lengths, metres, over the corners that have one."""
        squared = (self.displacements**2).sum(1)
        return float(np.sqrt(squared[squared > 0].mean())) if squared.any() else 0.0

    @property
    def height(self) -> float:
        """From the lowest corner to the highest, metres."""
        return float(np.ptp(self.displacements[:, 2]))


def without_similarity(
    points: Float[ndarray, "m 3"],
    displacements: Float[ndarray, "m 3"],
    seen: ndarray,
    *,
    parts: Sequence[slice] = WHOLE,
) -> Float[ndarray, "m 3"]:
    """The displacements once each part is moved, turned and scaled to where it is nearest to nominal.

    Args:
        points: the nominal ones, (m,3) metres.
        displacements: from nominal to real, (m,3) metres.
        seen: (m,) bool, at least three corners off a line of each part that was seen.
        parts: which corners are of one body; of several targets each has poses of its own.
    Returns:
        (m,3) metres; 0 for corners that were not seen.
    Source:
        S. Umeyama, Least-squares estimation of transformations, TPAMI 13(4), 1991.
    """
    settled = np.zeros_like(displacements)
    for part in parts:
        mine = np.zeros(len(points), dtype=bool)
        mine[part] = seen[part]
        if mine.any():
            settled[mine] = _without_similarity(points[mine], displacements[mine])
    return settled


def _without_similarity(
    points: Float[ndarray, "n 3"], displacements: Float[ndarray, "n 3"]
) -> Float[ndarray, "n 3"]:
    nominal, real = points, points + displacements
    target, source = nominal - nominal.mean(0), real - real.mean(0)
    rotation = nearest_rotation(target.T @ source)
    scale = np.vdot(target, source @ rotation.T) / np.vdot(source, source)
    return scale * source @ rotation.T - target


def polynomials(
    points: Float[ndarray, "m 3"],
    seen: ndarray,
    *,
    orders: Sequence[int] = SMOOTH_ORDERS,
    parts: Sequence[slice] = WHOLE,
) -> Float[ndarray, "m r"]:
    """Polynomials of the target's plane, orthogonal over the seen corners and of mean square 1 there.

    Args:
        points: the nominal ones, (m,3) metres.
        seen: (m,) bool.
        orders: which are wanted.
        parts: which corners are of one body; of several targets each has polynomials of its own, 0 elsewhere.
    Returns:
        A column each, 0 at corners that were not seen; fewer where the seen corners cannot tell them apart.
    """
    if len(parts) > 1:
        found = []
        for part in parts:
            mine = np.zeros(len(points), dtype=bool)
            mine[part] = seen[part]
            if mine.any():
                found.append(polynomials(points, mine, orders=orders))
        return np.concatenate(found, axis=1)
    plane = points[:, :2] - points[seen, :2].mean(0)
    x, y = (plane / np.abs(plane[seen]).max()).T
    exponents = [(order - i, i) for order in range(max(orders) + 1) for i in range(order + 1)]
    found, wanted = np.zeros((len(exponents), len(points))), []
    for i, j in exponents:
        before, rest = found[: len(wanted)], x**i * y**j * seen
        for _ in range(2):  # what rounding leaves the first time goes the second
            rest = rest - (before @ rest) @ before
        size = np.sqrt(rest @ rest)
        if size > LEAST_DIFFERENCE * np.sqrt(seen.sum()):
            found[len(wanted)] = rest / size
            wanted.append(i + j in orders)
    return np.ascontiguousarray(found[: len(wanted)][wanted].T) * np.sqrt(seen.sum())
