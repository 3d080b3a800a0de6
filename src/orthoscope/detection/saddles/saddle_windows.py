"""The windows around corners, and what a step of the saddle fit needs to know of their pixels: sums of
products, nothing else.

The model is that of saddle.py, linearised; with S = tanh(D1) tanh(D2) a window's columns are, for each of its
pixels,

    F1 = (1 - tanh^2 D1) tanh D2,   F2 = tanh D1 (1 - tanh^2 D2),   F1 A1,   F2 A2,   F1 D1 + F2 D2,
    S,   1,   x (1 + r S),   y (1 + r S)

A_i the distance along edge i in units of the blur, and last the picture itself. The parts that bend F1 and F2
towards x and y are multiples of F1 A1 and F2 A2, so that nothing else need be formed. All in single
precision, several windows at once; corners that are done drop out. Windows of one batch share their list of
pixels: those that at least one of them reaches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.detection.reused_arrays import ReusedArrays
from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["ARM_COUNT", "COLUMN_COUNT", "Shapes", "Windows"]

# A window has so many columns besides the picture.
COLUMN_COUNT = 9
# A saddle has so many arms.
ARM_COUNT = 4
# Beyond this share of a window a pixel's weight is below 2 %.
INNER_SHARE = 0.93


class Shapes(NamedTuple):
    """What is known of n saddles so far.

    Attributes:
        places: (n,2) pixels.
        angles: (n,2) of the two edges, radians.
        blur: (n,) w, pixels.
        bends: (n,2) curvatures, 1/px.
        relief: (n,) r = C / m, 0 where it is not known yet.
    """

    places: Float[ndarray, "n 2"]
    angles: Float[ndarray, "n 2"]
    blur: Float[ndarray, " n"]
    bends: Float[ndarray, "n 2"]
    relief: Float[ndarray, " n"]

    def of(self, which: Int[ndarray, " k"]) -> Shapes:
        """Those of some saddles, copied."""
        return Shapes(*(part[which] for part in self))


class Windows:
    """The pixels of n windows, k each.

    Args:
        grey: (h,w) uint8.
        start: (n,2) where the corners are to a few pixels.
        along, down: (n,2) from a corner to the sides of its window.
        arms: (n,) how far from the edges the window's corners are left out, as a share of it.
        arrays: that no other windows use as long as these are needed.
        level: (n,) mean grey, which the sums do without.
    """

    def __init__(
        self,
        grey: ndarray,
        start: Float[ndarray, "n 2"],
        along: Float[ndarray, "n 2"],
        down: Float[ndarray, "n 2"],
        arms: Float[ndarray, " n"],
        arrays: ReusedArrays,
    ) -> None:
        height, width = grey.shape
        self._arrays = arrays
        self._middle = np.clip(np.rint(start).astype(int), 0, (width - 1, height - 1))
        self._to_window = _inverses(along, down)
        self._arms = arms[:, None].astype(np.float32)
        reach = int(np.ceil((np.abs(along) + np.abs(down)).max()))
        x, y = _reached(self._to_window, reach)
        first = self._middle[:, 1] * width + self._middle[:, 0]
        shape = (len(start), len(x))
        places = np.add(first[:, None], y * width + x, out=arrays.of("places", shape, np.intp))
        seen = grey.ravel().take(places, mode="clip", out=arrays.of("seen", shape, grey.dtype))
        self.level = seen.mean(1, dtype=np.float32)
        self._pixels = np.subtract(seen, self.level[:, None], out=arrays.of("pixels", shape))
        self._inside = np.ones((len(start), 1), dtype=np.float32)
        if (self._middle < reach).any() or (self._middle >= (width - reach, height - reach)).any():
            column, row = self._middle[:, :1] + x, self._middle[:, 1:] + y
            self._inside = ((row >= 0) & (row < height) & (column >= 0) & (column < width)).astype(np.float32)
        self._offsets = np.stack([x, y, np.ones_like(x)]).astype(np.float32)

    def sums(self, which: Int[ndarray, " k"], shapes: Shapes) -> Float[ndarray, "k 10 10"]:
        """Weighted sums of products of the nine columns and the picture, of some of the windows and their
        saddles.
        """
        a1, a2, d1, d2, u, v = self._distances(which, shapes)
        columns = self._arrays.of("columns", (len(which), COLUMN_COUNT + 1, d1.shape[1]))
        f1, f2, f1_a1, f2_a2, blurring, saddle, one, across, upright, picture = columns.transpose(1, 0, 2)
        np.multiply(_root_weights(u, v, self._arms[which]), self._inside[which], out=one)
        e1, e2 = np.tanh(d1), np.tanh(d2)
        e1_one = np.multiply(e1, one, out=u)
        np.multiply(e1_one, e2, out=saddle)
        np.multiply(one - e1 * e1_one, e2, out=f1)
        np.subtract(e1_one, saddle * e2, out=f2)
        np.multiply(f1, a1, out=f1_a1)
        np.multiply(f2, a2, out=f2_a2)
        np.add(f1 * d1, f2 * d2, out=blurring)
        lit = np.add(one, shapes.relief[:, None].astype(np.float32) * saddle, out=v)
        np.multiply(lit, self._offsets[0], out=across)
        np.multiply(lit, self._offsets[1], out=upright)
        np.multiply(one, self._pixels[which], out=picture)
        return _products(columns)

    def arm_sums(self, which: Int[ndarray, " k"], shapes: Shapes) -> Float[ndarray, "k 16 16"]:
        """Weighted sums of products of the columns that let each arm of a saddle move by itself, and the
        picture (`saddle_arms.py`): four squares, four arms' shifts and turns, blur, and light across and
        upright.
        """
        a1, a2, d1, d2, u, v = self._distances(which, shapes)
        weights = _root_weights(u, v, self._arms[which]) * self._inside[which]
        e1, e2 = np.tanh(d1), np.tanh(d2)
        sides1, sides2 = (0.5 + 0.5 * e1, 0.5 - 0.5 * e1), (0.5 + 0.5 * e2, 0.5 - 0.5 * e2)
        f1, f2 = 1.0 - e1 * e1, 1.0 - e2 * e2
        squares = [one * two for one in sides1 for two in sides2]
        shifts = [f1 * side for side in sides2] + [f2 * side for side in sides1]
        turns = [shift * a for shift, a in zip(shifts, (a1, a1, a2, a2), strict=True)]
        light = [np.broadcast_to(offset, e1.shape) for offset in self._offsets[:2]]
        blurring = f1 * e2 * d1 + e1 * f2 * d2
        columns = np.stack([*squares, *shifts, *turns, blurring, *light, self._pixels[which]], axis=1)
        columns *= weights[:, None]
        return _products(columns)

    def _distances(self, which: ndarray, shapes: Shapes) -> Float[ndarray, "6 n k"]:
        """Along both edges and from both (the second's sign turned), in blurs; along both sides of the
        window, in halves.
        """
        (c1, c2), (s1, s2) = np.cos(shapes.angles).T / shapes.blur, np.sin(shapes.angles).T / shapes.blur
        forms = np.empty((6, len(which), 3))
        forms[:4, :, :2] = np.array([[c1, s1], [c2, s2], [-s1, c1], [s2, -c2]]).transpose(0, 2, 1)
        forms[4:, :, :2] = self._to_window[:, which]
        forms[:, :, 2] = -(forms[:, :, :2] * (shapes.places - self._middle[which])).sum(-1)
        out = self._arrays.of("distances", (6, len(which), self._offsets.shape[1]))
        np.matmul(forms.astype(np.float32), self._offsets, out=out)
        bend1, bend2 = (0.5 * shapes.blur * shapes.bends.T)[:, :, None].astype(np.float32)
        out[2] -= bend1 * out[0] * out[0]
        out[3] += bend2 * out[1] * out[1]
        return out


def _inverses(along: ndarray, down: ndarray) -> Float[ndarray, "2 n 2"]:
    """What turns an offset in pixels into halves of the window, along and down."""
    area = along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0]
    area = np.where(np.abs(area) < 1e-9, 1e-9, area)[:, None]
    return np.stack([down[:, ::-1] * (1.0, -1.0) / area, along[:, ::-1] * (-1.0, 1.0) / area])


def _reached(to_window: Float[ndarray, "2 n 2"], reach: int) -> Int[ndarray, "2 k"]:
    """The offsets, whole pixels, that lie in one of the windows at least."""
    offsets = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)[::-1]
    out = (to_window.reshape(-1, 2).astype(np.float32) @ offsets.astype(np.float32)).reshape(
        2, to_window.shape[1], -1
    )
    return offsets[:, np.maximum(*np.abs(out, out=out)).min(0) < INNER_SHARE]


def _root_weights(u: ndarray, v: ndarray, arms: ndarray) -> ndarray:
    """Roots of weights: 1 at the corner, 0 at the window's side, smooth between; written over u.

    Where both distances are beyond an arm, something else is printed: nothing is weighed there.
    """
    off_arms = np.minimum(np.abs(u), np.abs(v)) > arms if (arms < 1).any() else None
    out = np.maximum(np.abs(u, out=u), np.abs(v, out=v), out=u)
    np.multiply(out, out, out=out)
    np.maximum(np.subtract(1.0, out, out=out), 0.0, out=out)
    if off_arms is not None:
        out[off_arms] = 0.0
    return out


def _products(columns: Float[ndarray, "n p k"]) -> Float[ndarray, "n p p"]:
    """Each window's columns times themselves; not all by all at once, for which BLAS has a routine three
    times as slow at this size.
    """
    count, size, _ = columns.shape
    sums = np.empty((count, size, size))
    sums[:, :-1] = columns[:, :-1] @ columns.transpose(0, 2, 1)
    sums[:, -1, :-1] = sums[:, :-1, -1]
    sums[:, -1, -1] = np.einsum("nk,nk->n", columns[:, -1], columns[:, -1])
    return sums
