"""Corners of single markers to a few hundredths of a pixel: where curves through two of its sides cross.

A marker's corner is no saddle, and blur rounds it. Its sides are edges: at places along each the grey goes
from black to white, or the other way, and where it crosses the middle between both is on the side. A lens
bends the side, so a parabola goes through these places, of short ones a line; corners are where the curves of
neighbouring sides cross.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import cross
from orthoscope.geometry.arrays import Bool, Float, ndarray

__all__ = ["crossings_of_sides"]

# Places along a side, as shares of it, away from its ends where the neighbouring side's blur reaches.
STATIONS = np.linspace(0.12, 0.88, 24)
# Steps along the profile across a side, from inside to outside, as shares of its reach.
ACROSS = np.linspace(-1.0, 1.0, 33)
# A profile reaches at most so far to each side, pixels.
MOST_REACH = 6.0
# Squares of a marker that are larger than this, pixels, are reduced, by halves, to about it.
USUAL_MODULE = 20.0
# A profile reaches over this share of a marker's square to each side; its border is one wide.
REACH_SHARE = 0.65
# Smoothing before, standard deviation in pixels.
SMOOTHING_SIGMA = 0.5
# Sides shorter than this, pixels, get a line, since a parabola follows their noise.
SHORT = 24.0
# A profile counts where its step is at least this share of the marker's usual one.
LEAST_STEP_SHARE = 0.5
# At least so many profiles of a side count.
FEWEST_STATIONS = 10
# Places that are off their side's curve by more than this, pixels, and three times the usual, are left out.
FARTHEST_OFF = 0.3
# Curves are found so many times, each time from the corners of the time before.
ROUNDS = 2
# Curves cross after so many of Newton's steps.
NEWTON_STEPS = 4
# And no farther from the end of their sides than this share of them.
FARTHEST_CROSSING = 0.3


def crossings_of_sides(
    grey: ndarray, corners: Float[ndarray, "n 4 2"], modules: int
) -> tuple[Float[ndarray, "n 4 2"], Bool[ndarray, " n"]]:
    """The corners of markers, and of which markers all four were found.

    Args:
        grey: (h,w) uint8.
        corners: right to about half of a marker's squares, clockwise.
        modules: squares along a marker's side, its border of one included.
    """
    fine, good = corners.copy(), np.ones(len(corners), dtype=bool)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).min(1, initial=np.inf)
    shrinks = np.exp2(np.maximum(np.rint(np.log2(sides / modules / USUAL_MODULE)), 0)).astype(int)
    for shrink in np.unique(shrinks):
        height, width = (side // shrink for side in grey.shape)
        part = grey[: height * shrink, : width * shrink]
        small = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA) if shrink > 1 else grey
        smooth = cv2.GaussianBlur(small, (0, 0), SMOOTHING_SIGMA)
        for number in np.flatnonzero(shrinks == shrink):
            found: ndarray | None = (corners[number] + 0.5) / shrink - 0.5
            for _ in range(ROUNDS):
                found = None if found is None else _of_one(smooth, found, modules)
            good[number] = found is not None
            fine[number] = corners[number] if found is None else (found + 0.5) * shrink - 0.5
    return fine, good


def _of_one(grey: ndarray, corners: Float[ndarray, "4 2"], modules: int) -> Float[ndarray, "4 2"] | None:
    start, end = corners, np.roll(corners, -1, axis=0)
    along = end - start
    length = np.hypot(*along.T)
    if length.min() < 2.0 * modules:
        return None
    reach = min(REACH_SHARE * float(length.min()) / modules, MOST_REACH)
    unit = along / length[:, None]
    outward = np.stack([unit[:, 1], -unit[:, 0]], axis=1)  # corners run clockwise as seen
    at = start[:, None] + STATIONS[:, None] * along[:, None]
    places = at[:, :, None] + reach * ACROSS[:, None] * outward[:, None, None]
    if (places < 0).any() or (places > np.array(grey.shape[::-1]) - 1).any():
        return None
    x, y = places.reshape(4, -1, 2).astype(np.float32).transpose(2, 0, 1)
    values = cv2.remap(grey, x, y, cv2.INTER_LINEAR).astype(float).reshape(4, len(STATIONS), len(ACROSS))
    offset, counts = _offsets(values)
    curves = []
    for side in range(4):
        mine = counts[side]
        if mine.sum() < FEWEST_STATIONS:
            return None
        degree = 1 if length[side] < SHORT else 2
        curves.append(_curve(STATIONS[mine], reach * offset[side, mine], degree))
    return _crossed(start, along, outward, np.array(curves))


def _offsets(values: Float[ndarray, "4 s k"]) -> tuple[Float[ndarray, "4 s"], Bool[ndarray, "4 s"]]:
    """Where each profile crosses its middle, as a share of its reach; and which count."""
    inside, outside = values[..., :8].mean(-1), values[..., -8:].mean(-1)
    step = outside - inside
    sign = np.sign(np.median(step)) or 1.0
    above = sign * (values - 0.5 * (inside + outside)[..., None]) > 0
    first = np.argmax(above, axis=-1)  # the first place beyond the middle
    before = np.maximum(first - 1, 0)
    rows, columns = np.indices(first.shape)
    low, high = values[rows, columns, before], values[rows, columns, first]
    middle = 0.5 * (inside + outside)
    share = np.clip((middle - low) / np.where(high == low, 1.0, high - low), 0.0, 1.0)
    offset = ACROSS[before] + share * (ACROSS[1] - ACROSS[0])
    counts = (first > 0) & (sign * step > LEAST_STEP_SHARE * np.median(sign * step)) & (sign * step > 4.0)
    return offset, counts


def _curve(at: Float[ndarray, " s"], offset: Float[ndarray, " s"], degree: int) -> Float[ndarray, "3"]:
    """Coefficients, constant first, of a parabola or a line through offsets; those far from it left out."""
    powers = np.vander(at, degree + 1, increasing=True)
    kept, curve = np.ones(len(at), dtype=bool), np.zeros(3)
    for _ in range(2):
        curve[: degree + 1] = np.linalg.lstsq(powers[kept], offset[kept], rcond=None)[0]
        off = np.abs(powers @ curve[: degree + 1] - offset)
        still = off <= max(FARTHEST_OFF, 3.0 * float(np.median(off)))
        if (still == kept).all():
            break
        kept = still
    return curve


def _crossed(
    start: Float[ndarray, "4 2"],
    along: Float[ndarray, "4 2"],
    outward: Float[ndarray, "4 2"],
    curves: Float[ndarray, "4 3"],
) -> Float[ndarray, "4 2"] | None:
    """Where the end of each side before meets the begin of each side, by Newton's method."""
    before = [np.roll(part, 1, axis=0) for part in (start, along, outward, curves)]
    s, t = np.ones(4), np.zeros(4)
    for _ in range(NEWTON_STEPS):
        p, dp = _on_sides(before[0], before[1], before[2], before[3], s)
        q, dq = _on_sides(start, along, outward, curves, t)
        area = cross(dp, dq)
        if (np.abs(area) < 1e-9).any():
            return None
        s, t = s + cross(q - p, dq) / area, t + cross(q - p, dp) / area
    if not (np.abs(s - 1.0) < FARTHEST_CROSSING).all() or not (np.abs(t) < FARTHEST_CROSSING).all():
        return None
    return _on_sides(start, along, outward, curves, t)[0]


def _on_sides(
    start: Float[ndarray, "4 2"],
    along: Float[ndarray, "4 2"],
    outward: Float[ndarray, "4 2"],
    curves: Float[ndarray, "4 3"],
    at: Float[ndarray, "4"],
) -> tuple[Float[ndarray, "4 2"], Float[ndarray, "4 2"]]:
    """A place on the curve of each side, and how it moves along."""
    constant, slope, bend = curves.T
    away, turn = constant + at * (slope + at * bend), slope + 2.0 * at * bend
    return start + at[:, None] * along + away[:, None] * outward, along + turn[:, None] * outward
