"""The ways in which a board is its own image, and what a view that lists its corners another way sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.pose import nearest_rotation
from orthoscope.targets.target import Target

__all__ = ["Turn", "least_turned", "shown_by", "turns_after", "turns_of", "whole_turn"]

# Points nearer than this share of the target's size are one.
SAME_SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class Turn:
    """One way in which a target is its own image.

    Attributes:
        rotation: (3,3) about the middle of its points.
        corners: (p,) which corner each one comes to lie on.
    """

    rotation: Float[ndarray, "3 3"]
    corners: Int[ndarray, " p"]


def turns_of(target: Target) -> list[Turn]:
    """The turns that a detector may not tell from none, the turn by nothing first.

    What a board says of itself, and the quarters of a square one: their colours change places where its
    counts are odd, but not every detector looks at colours.
    """
    points = target.points - target.points.mean(0)
    known = [np.arange(len(points)), *(target.board.symmetries() if target.board else ())]
    if target.grid and target.grid[0] == target.grid[1]:
        ids = np.arange(len(points)).reshape(target.grid)
        known += [np.rot90(ids, quarters).ravel() for quarters in (1, 2, 3)]
    distinct = {corners.tobytes(): corners for corners in known}
    found = [Turn(nearest_rotation(points[corners].T @ points), corners) for corners in distinct.values()]
    return [turn for turn in found if _fits(turn, points)]


def _fits(turn: Turn, points: Float[ndarray, "p 3"]) -> bool:
    """Whether the turn brings every point to where another is."""
    return bool(
        np.abs(points @ turn.rotation.T - points[turn.corners]).max() < SAME_SHARE * np.ptp(points[:, :2])
    )


def whole_turn(target: Target, part: slice, turn: Turn) -> Int[ndarray, " p"]:
    """Which corner of the whole target each one comes to lie on where a member's, those of `part`, turn."""
    corners = np.arange(len(target.points))
    corners[part] = part.start + turn.corners
    return corners


def shown_by(turn: Turn, smooth: Float[ndarray, "p r"], named: int) -> Float[ndarray, "c c"]:
    """What a turned view sees of camera and shape, in the same unknowns: smooth shapes of the whole target,
    turned, are such shapes again.
    """
    of_smooth = smooth.T @ smooth[turn.corners] / len(smooth)  # they are orthogonal, of mean square 1
    r = smooth.shape[1]
    shown = np.eye(named + 3 * r)
    shown[named:, named:] = np.einsum("st,ab->sbta", of_smooth, turn.rotation).reshape(3 * r, 3 * r)
    return shown


def turns_after(turns: list[Turn]) -> Int[ndarray, "g g"]:
    """after[s, t]: what turn t is when the target is looked at as turn s shows it."""
    number = {turn.corners.tobytes(): i for i, turn in enumerate(turns)}
    back = [np.argsort(turn.corners) for turn in turns]
    return np.array([[number[back[s][turn.corners].tobytes()] for turn in turns] for s in range(len(turns))])


def least_turned(chosen: Int[ndarray, " m"], after: Int[ndarray, "g g"]) -> Int[ndarray, " m"]:
    """The same order of all views against each other, with as few of them turned as can be."""
    return min((seen_from[chosen] for seen_from in after), key=lambda some: int((some > 0).sum()))
