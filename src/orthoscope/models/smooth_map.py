"""A map of an image's pixels, asked for at few of them and interpolated between, where that is as good as
asking for each.

The image is cut into tiles of about TILE_SIDE pixels. On each the map is the polynomial of degree N - 1 in x
and in y through its values at N x N Chebyshev points, which lie on the tile's sides too, so that neighbours
share them and no seam shows. A lens is analytic within its domain, so a polynomial's error falls
geometrically with N; it is greatest half-way between the points and is looked up there. For a usual lens it
is far below what float32 rounds; beside a fold, or with a spline in the lens, it is some ten-thousandths of a
pixel. A tile is asked pixel by pixel where that error is above TOLERANCE_PX, or where it has a corner for
which the caller does not vouch: the border of a lens's domain is never interpolated.

L. N. Trefethen, Approximation Theory and Approximation Practice, 2013, chapters 8 (convergence) and 15
(Lebesgue constants).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from orthoscope.geometry.arrays import Bool, Float, ndarray

__all__ = ["TOLERANCE_PX", "smooth_map"]

# A tile has so many pixels along a side.
TILE_SIDE = 64
# A tile has so many Chebyshev points along a side.
N = 6
# A place may be off by this, pixels; cv2.remap itself rounds places to 1/32.
TOLERANCE_PX = 1e-3
# A polynomial in x and y is nowhere on its tile larger than this times its largest value at the points.
LEBESGUE_CONSTANT = 4.0
# A pixel whose place is as near as this to the limits, pixels, is asked for itself; it is several times
# TOLERANCE_PX.
DOUBT_PX = 5e-3

Look = Callable[[Float[ndarray, "n 2"]], Float[ndarray, "n 2"]]
Vouched = Callable[[Float[ndarray, "n 2"]], Bool[ndarray, " n"]]


class _Tiles(NamedTuple):
    """Tiles along one side of an image. points, between: where the map is asked for and tried, ascending,
    shared points once.
    """

    number: int
    side: int
    points: ndarray
    between: ndarray

    def pixels(self, tiles: slice, length: int) -> slice:
        """The pixels of neighbouring tiles in an image of that length."""
        return slice(tiles.start * self.side, min(tiles.stop * self.side, length))


class _Limits(NamedTuple):
    """The middle (x, y) of what is looked at, and how far from it a place may be."""

    middle: Float[ndarray, " 2"]
    reach: Float[ndarray, " 2"]

    def keep(self, places: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        """The places, NaN for those outside."""
        return np.where((np.abs(places - self.middle) <= self.reach).all(1, keepdims=True), places, np.nan)


def smooth_map(
    look: Look, size: tuple[int, int], *, vouched: Vouched, limits: tuple[int, int]
) -> tuple[Float[ndarray, "h w"], Float[ndarray, "h w"]]:
    """x and y of what `look` says of each pixel of an image of `size` (width, height), float32, to within
    TOLERANCE_PX and rounding.

    Args:
        look: pixels (n,2) to places (n,2), NaN where there are none.
        vouched: of pixels (n,2), whether `look` is smooth there; where it is at the corners of a rectangle it
            must be all over it.
        limits: (width, height) of what is looked at; places farther out than a pixel are NaN.
    """
    (width, height), seen = size, np.array(limits, dtype=float)
    within = _Limits(0.5 * (seen - 1.0), 0.5 * (seen + 1.0))
    across, down = _tiles(width), _tiles(height)
    values = _at(look, across.points, down.points)
    plain = _of_corners(np.logical_and, _on_corners(vouched, across, down)) & (
        _errors(look, values, across, down) <= TOLERANCE_PX
    )
    maps = _interpolated(values, across, down, size)
    unsure = [np.empty((0, 2), dtype=np.int64)]
    inside, outside = _sure(values, within)
    for row, run in _runs(plain & outside):
        maps[:, down.pixels(row, height), across.pixels(run, width)] = np.nan
    for row, run in _runs(plain & ~inside & ~outside):
        rows, columns = down.pixels(row, height), across.pixels(run, width)
        unsure.append(_cut(maps[:, rows, columns], within) + np.array([columns.start, rows.start]))
    for row, run in _runs(~plain):
        rows, columns = down.pixels(row, height), across.pixels(run, width)
        unsure.append(_grid(np.arange(columns.start, columns.stop), np.arange(rows.start, rows.stop)))
    x, y = np.concatenate(unsure).T
    maps[:, y, x] = within.keep(look(np.stack([x, y], axis=-1).astype(float))).T
    return maps[0], maps[1]


def _tiles(length: int) -> _Tiles:
    number = -(-length // TILE_SIDE)
    side = -(-length // number)
    starts = np.arange(number)[:, None]
    points, between = starts + _points(), starts + _points(half_way=True)
    return _Tiles(number, side, side * np.append(points[:, :-1], number), side * between.ravel())


def _points(*, half_way: bool = False) -> Float[ndarray, " n"]:
    """The N Chebyshev points of [0, 1], its ends among them; or the N - 1 half-way between them."""
    k = np.arange(N - 1) + 0.5 if half_way else np.arange(N)
    return 0.5 * (1.0 - np.cos(np.pi * k / (N - 1)))


def _weights(t: Float[ndarray, " m"]) -> Float[ndarray, "m n"]:
    """What the values at the N points weigh in the polynomial at each t of [0, 1]."""
    return _chebyshev(t) @ np.linalg.inv(_chebyshev(_points()))


def _chebyshev(t: Float[ndarray, " m"]) -> Float[ndarray, "m n"]:
    """The N polynomials of Chebyshev at each t of [0, 1]."""
    return np.cos(np.arange(N) * np.arccos(np.clip(2.0 * t - 1.0, -1.0, 1.0))[:, None])


def _grid(x: ndarray, y: ndarray) -> ndarray:
    """The places (n,2) of a grid, row by row."""
    return np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1).reshape(-1, 2)


def _at(look: Look, x: ndarray, y: ndarray) -> Float[ndarray, "2 rows columns"]:
    """The map on a grid."""
    return look(_grid(x, y).astype(float)).T.reshape(2, len(y), len(x))


def _on_corners(vouched: Vouched, across: _Tiles, down: _Tiles) -> Bool[ndarray, "rows columns"]:
    x, y = across.points[:: N - 1], down.points[:: N - 1]
    return vouched(_grid(x, y)).reshape(len(y), len(x))


def _of_corners(combine: np.ufunc, grid: ndarray) -> ndarray:
    """For each tile what its four corners, of a grid (..., rows + 1, columns + 1), come to."""
    return combine.reduce([grid[..., :-1, :-1], grid[..., :-1, 1:], grid[..., 1:, :-1], grid[..., 1:, 1:]])


def _windows(values: ndarray, axis: int) -> ndarray:
    """For each tile along an axis its N values, as a last axis."""
    windows = sliding_window_view(values, N, axis=axis)
    return windows[(slice(None),) * axis + (slice(None, None, N - 1),)]


def _spread(
    values: Float[ndarray, "2 rows points"], weights: Float[ndarray, "m n"]
) -> Float[ndarray, "2 rows all"]:
    """The polynomials along x, at m places in every tile."""
    return (_windows(values, 2) @ weights.T).reshape(2, values.shape[1], -1)


def _interpolated(
    values: ndarray, across: _Tiles, down: _Tiles, size: tuple[int, int]
) -> Float[ndarray, "2 h w"]:
    """The polynomials at every pixel; in single precision but for the tile's first row, from which the others
    differ little, and which is added last.
    """
    width, height = size
    rows = _spread(values, _weights(np.arange(across.side) / across.side))[:, :, :width]
    weights = np.ones((down.side, N + 1), dtype=np.float32)
    weights[:, :N] = _weights(np.arange(down.side) / down.side)
    maps = np.empty((2, height, width), dtype=np.float32)
    for tile in range(down.number):
        pixels, points = down.pixels(slice(tile, tile + 1), height), slice(tile * (N - 1), tile * (N - 1) + N)
        for part, along in zip(maps[:, pixels], rows[:, points], strict=True):
            from_first = np.concatenate([along - along[0], along[:1]]).astype(np.float32)
            np.matmul(weights[: len(part)], from_first, out=part)
    return maps


def _errors(look: Look, values: ndarray, across: _Tiles, down: _Tiles) -> Float[ndarray, "rows columns"]:
    """By how much each tile's polynomial misses the map half-way between its points; NaN where the map has no
    value.
    """
    weights = _weights(_points(half_way=True))
    columns = _windows(_spread(values, weights), 1) @ weights.T  # (2, tiles down, all across, half-way down)
    missed = np.abs(
        np.moveaxis(columns, 3, 2).reshape(2, len(down.between), -1) - _at(look, across.between, down.between)
    )
    return missed.reshape(2, down.number, N - 1, across.number, N - 1).max((0, 2, 4))


def _sure(
    values: ndarray, within: _Limits
) -> tuple[Bool[ndarray, "rows columns"], Bool[ndarray, "rows columns"]]:
    """Tiles that surely keep within the limits, and those that surely lie outside: their bilinear part is
    farthest out and farthest in in a corner, and the rest of them is small.
    """
    middle, reach = within.middle[:, None, None], within.reach[:, None, None]
    corners, t = values[:, :: N - 1, :: N - 1], _points()[:, None, None]
    sides = (1.0 - t) * corners[:, None, :-1] + t * corners[
        :, None, 1:
    ]  # (2, N, tiles down, tiles across + 1)
    bilinear = (1.0 - t) * sides[:, :, None, :, :-1] + t * sides[
        :, :, None, :, 1:
    ]  # (2, N, N, tiles down, tiles across)
    rest = np.abs(np.moveaxis(_windows(_windows(values, 1), 2), (3, 4), (1, 2)) - bilinear).max((1, 2))
    most, least = (_of_corners(which, corners - middle) for which in (np.maximum, np.minimum))
    rest *= LEBESGUE_CONSTANT
    inside = (np.maximum(most, -least) + rest < reach).all(0)
    return inside, (np.maximum(least, -most) - rest > reach).any(0)


def _runs(flags: Bool[ndarray, "rows columns"]) -> Iterator[tuple[slice, slice]]:
    """Row and columns of each unbroken run of flags."""
    for row, line in enumerate(flags):
        steps = np.flatnonzero(np.diff(np.concatenate([[0], line.view(np.int8), [0]])))
        for start, stop in steps.reshape(-1, 2).tolist():
            yield slice(row, row + 1), slice(start, stop)


def _cut(maps: Float[ndarray, "2 h w"], within: _Limits) -> ndarray:
    """Makes NaN of what lies outside the limits, and returns the pixels (n,2) of this part that lie too near
    them to tell.
    """
    past, past_y = (
        np.abs(part - np.float32(middle)) for part, middle in zip(maps, within.middle, strict=True)
    )
    past -= np.float32(within.reach[0])
    past_y -= np.float32(within.reach[1])
    np.maximum(past, past_y, out=past)
    np.copyto(maps, np.nan, where=past > 0)
    y, x = np.divmod(np.flatnonzero(np.abs(past, out=past) < DOUBT_PX), past.shape[1])
    return np.stack([x, y], axis=-1)
