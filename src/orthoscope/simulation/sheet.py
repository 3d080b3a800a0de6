"""A printed sheet as a camera's pixels see it: the mean of its black and white over a pixel's footprint.

Black rectangles divide the sheet into cells by all their sides, black or white each. The integral of such
a picture from the sheet's corner to (X, Y) is bilinear inside a cell, so that it is known from its values at
the crossings, and the mean over a footprint of w by h is

    (F(X + w/2, Y + h/2) - F(X - w/2, Y + h/2) - F(X + w/2, Y - h/2) + F(X - w/2, Y - h/2)) / (w h)

exactly, however many cells it reaches over. A disc has its rim taken as straight within a footprint, which is
small against it. A pixel that no side or rim crosses is of one cell; one that is crossed is divided into
oversampling^2 footprints, placed by the slopes of the map from pixels to the sheet, since a pixel's own
footprint lies askew on it. Each footprint is symmetric, so edges and corners stay where they are.
"""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.targets.drawing import Drawing

__all__ = ["Sheet"]


class Sheet:
    """A drawing, ready to be looked at.

    Args:
        drawing: what is printed, metres.
        black, white: grey levels.
    """

    def __init__(self, drawing: Drawing, *, black: float, white: float) -> None:
        self._black, self._white = black, white
        self._low, self._high = drawing.low, drawing.high
        self._discs = [
            (discs, sign) for discs, sign in ((drawing.discs, 1.0), (drawing.holes, -1.0)) if len(discs)
        ]
        boxes = drawing.rectangles.reshape(-1, 2, 2)
        outline = np.stack([drawing.low, drawing.high])
        self._sides = [_distinct(np.concatenate([boxes[:, :, i].ravel(), outline[:, i]])) for i in (0, 1)]
        self._cells = _black_cells(self._sides, boxes)
        areas = self._cells * np.diff(self._sides[0])[:, None] * np.diff(self._sides[1])
        self._integral = np.pad(areas.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
        self._halo = 0.05 * drawing.size.min()

    def near(self, x: ndarray, y: ndarray) -> ndarray:
        """Which places, metres, are on the sheet or near it."""
        (left, top), (right, bottom) = self._low - self._halo, self._high + self._halo
        return (x > left) & (x < right) & (y > top) & (y < bottom)

    def look(
        self, place: Float[ndarray, "2 n"], slopes: Float[ndarray, "2 2 n"], oversampling: int
    ) -> tuple[ndarray, ndarray]:
        """Share of each pixel that the sheet covers, and the grey that it adds.

        Args:
            place: (X, Y) at the pixels' centres, metres.
            slopes: d place / d pixel; [i, j] is of coordinate i along axis j.
            oversampling: footprints along a pixel's side where it is crossed.
        """
        cells = [
            np.searchsorted(sides, part, "right") - 1 for sides, part in zip(self._sides, place, strict=True)
        ]
        outside = np.zeros(place.shape[1], dtype=bool)
        for cell, sides in zip(cells, self._sides, strict=True):
            outside |= (cell < 0) | (cell >= len(sides) - 1)
            np.clip(cell, 0, len(sides) - 2, out=cell)
        cover = np.where(outside, 0.0, 1.0)
        black = self._cells[cells[0], cells[1]] * cover
        reach = 0.5 * np.abs(slopes).sum(1)  # a pixel's square reaches so far on the sheet
        crossed = self._crosses(place, reach, cells)
        for discs, sign in self._discs:
            black += sign * _in_discs(discs, place[0], place[1], 1e-12)
            crossed |= np.abs(_from_rim(discs, *place)) <= np.hypot(*reach)
        which = np.flatnonzero(crossed)
        if len(which):
            offset = (np.arange(oversampling) + 0.5) / oversampling - 0.5
            offsets = np.stack(np.meshgrid(offset, offset)).reshape(2, -1)
            sub_place = place[:, which, None] + np.einsum("ijn,js->ins", slopes[:, :, which], offsets)
            width = np.hypot(slopes[:, 0, which], slopes[:, 1, which])[..., None] / oversampling
            fine_cover, fine_black = self._mean(sub_place, width)
            cover[which], black[which] = fine_cover.mean(-1), fine_black.mean(-1)
        return cover, self._white * cover - (self._white - self._black) * black

    def _crosses(self, place: ndarray, reach: ndarray, cells: list[Int[ndarray, " n"]]) -> ndarray:
        """Which pixels a side of a rectangle may cross."""
        crossed = np.zeros(place.shape[1], dtype=bool)
        for part, far, cell, sides in zip(place, reach, cells, self._sides, strict=True):
            crossed |= (part - far <= sides[cell]) | (part + far >= sides[cell + 1])
        return crossed

    def _mean(
        self, place: Float[ndarray, "2 n s"], width: Float[ndarray, "2 n 1"]
    ) -> tuple[ndarray, ndarray]:
        """Share covered by the sheet and share that is black, in the mean over footprints of these widths."""
        low, high = place - 0.5 * width, place + 0.5 * width
        x, y = ([_between(sides, end[i]) for end in (low, high)] for i, sides in enumerate(self._sides))
        black = _inside(self._integral, x[1], y[1]) - _inside(self._integral, x[0], y[1])
        black += _inside(self._integral, x[0], y[0]) - _inside(self._integral, x[1], y[0])
        black /= width[0] * width[1]
        for discs, sign in self._discs:
            black += sign * _in_discs(discs, place[0], place[1], np.sqrt(width[0] * width[1]))
        on = [
            (np.clip(high[i], self._low[i], self._high[i]) - np.clip(low[i], self._low[i], self._high[i]))
            / width[i]
            for i in (0, 1)
        ]
        return on[0] * on[1], black


def _in_discs(discs: Float[ndarray, "k 3"], x: ndarray, y: ndarray, width: ndarray | float) -> ndarray:
    """Share of footprints inside a disc, their rims taken as straight."""
    return np.clip(0.5 - _from_rim(discs, x, y) / width, 0.0, 1.0)


def _from_rim(discs: Float[ndarray, "k 3"], x: ndarray, y: ndarray) -> ndarray:
    """The distance to the nearest disc's rim, negative inside; infinite far from all."""
    nearest = np.full(x.shape, np.inf)
    if not x.size:
        return nearest
    centres, near = discs[:, :2], 2.0 * discs[:, 2]
    low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
    gap = np.maximum(np.maximum(low - centres, centres - high), 0.0).max(1)
    for centre_x, centre_y, radius in discs[gap < near]:
        np.minimum(nearest, np.hypot(x - centre_x, y - centre_y) - radius, out=nearest)
    return nearest


def _distinct(values: ndarray) -> Float[ndarray, " n"]:
    """Sorted, what differs by rounding only taken as one."""
    values = np.sort(values)
    return values[np.concatenate([[True], np.diff(values) > 1e-9 * np.ptp(values)])]


def _black_cells(sides: list[ndarray], boxes: Float[ndarray, "k 2 2"]) -> Float[ndarray, "n m"]:
    """1 in the cells that a rectangle covers."""
    x, y = (
        np.searchsorted(lines, np.sort(boxes[:, :, i], axis=1) - 1e-9 * np.ptp(lines))
        for i, lines in enumerate(sides)
    )
    steps = np.zeros((len(sides[0]), len(sides[1])))
    for i, j, sign in ((0, 0, 1.0), (1, 0, -1.0), (0, 1, -1.0), (1, 1, 1.0)):
        np.add.at(steps, (x[:, i], y[:, j]), sign)
    return (steps.cumsum(0).cumsum(1) > 0.5)[:-1, :-1].astype(float)


def _between(sides: ndarray, values: ndarray) -> tuple[Int[ndarray, "*n"], Float[ndarray, "*n"]]:
    """Between which two sides each value is, and how far from the first to the second, 0 to 1."""
    if _are_even(sides):  # of a chessboard all are, and no search is needed
        at = (values - sides[0]) / (sides[1] - sides[0])
        cell = np.clip(at.astype(np.int64), 0, len(sides) - 2)
        return cell, np.clip(at - cell, 0.0, 1.0)
    cell = np.clip(np.searchsorted(sides, values, "right") - 1, 0, len(sides) - 2)
    first = sides[cell]
    return cell, np.clip((values - first) / (sides[cell + 1] - first), 0.0, 1.0)


def _are_even(sides: Float[ndarray, " n"]) -> bool:
    steps = np.diff(sides)
    return bool(np.ptp(steps) < 1e-9 * steps[0])


def _inside(table: ndarray, x: tuple[ndarray, ndarray], y: tuple[ndarray, ndarray]) -> ndarray:
    """The table's bilinear values."""
    (i, s), (j, t) = x, y
    stride = table.shape[1]
    flat, at = table.ravel(), i * stride + j
    above = flat[at] * (1.0 - t) + flat[at + 1] * t
    below = flat[at + stride] * (1.0 - t) + flat[at + stride + 1] * t
    return above * (1.0 - s) + below * s
