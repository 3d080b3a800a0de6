"""Blurred saddles, fitted to the picture around each corner of a chessboard; all corners at once.

Floor 5.  Two edges cross at the corner c, along the directions a1 and a2 (angles t1, t2), with normals n1 and n2.  The picture is

    I(x) = m + g.(x - c) + C tanh(d1 / w) tanh(d2 / w),        d_i = n_i.(x - c) - k_i (a_i.(x - c))^2 / 2

m grey, g uneven light, C contrast (positive where the square between +a1 and +a2 is the bright one), w blur.  The curvatures k_i are
given: without them a window on a bent edge sees its middle beside the corner.  Nine unknowns, Gauss-Newton; tanh stands for the error
function, whose shape it has to within what a lens's blur differs from a Gaussian, and its slope is 1 - tanh^2.  A pixel's weight falls
from 1 at the corner to 0 at the side of a window in the board's own directions; the window follows the corner, so that whatever the
model lacks (sharpening, white that bleeds into black) is seen symmetrically and moves nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["Saddles", "fit_saddles"]

STEPS = 10
STILL = 1e-3  # px: a corner that moves less has arrived
LEAST_BLUR = 0.75  # px: a pixel's own width; a sharpened edge is steeper, and without a floor the steps then jump from pixel to pixel
LARGEST_STEP = np.array([1.0, 1.0, 0.2, 0.2, 0.5])  # of x, y (px), t1, t2 (radians), log w
DAMPING = 1e-3  # of each unknown's own curvature
PIXELS_AT_ONCE = 60_000  # of all windows together, so that the arrays stay in cache


class Saddles(NamedTuple):
    """places: (n,2) pixels.  contrast: (n,) C, grey levels.  explained: (n,) share of the window's variance that the saddle explains."""

    places: Float[ndarray, "n 2"]
    contrast: Float[ndarray, " n"]
    explained: Float[ndarray, " n"]


def fit_saddles(
    grey: ndarray, start: Float[ndarray, "n 2"], along: Float[ndarray, "n 2"], down: Float[ndarray, "n 2"], *, bends: Float[ndarray, "n 2"]
) -> Saddles:
    """The saddles near `start`.

    grey: (h,w) uint8.  along, down: from a corner to the sides of its window, pixels, in the directions of its two edges.
    bends: curvature of the two edges, 1/px.  Where the steps do not settle the last place is given, with what it explains.
    """
    reach = int(np.ceil((np.abs(along) + np.abs(down)).max())) + 1
    padded = cv2.copyMakeBorder(grey, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
    at_once = max(1, PIXELS_AT_ONCE // (2 * reach + 1) ** 2)
    some = [slice(i, i + at_once) for i in range(0, len(start), at_once)]
    parts = [_Windows(padded, reach, start[s], along[s], down[s], bends[s]).fit() for s in some]
    return Saddles(*(np.concatenate(part) for part in zip(*parts, strict=True)))


class _Windows:
    """Some corners' windows, each a row of k pixels; what is known of them in float32, and the nine unknowns in float64."""

    def __init__(self, padded: ndarray, reach: int, start: ndarray, along: ndarray, down: ndarray, bends: ndarray) -> None:
        height, width = (side - 2 * reach for side in padded.shape)
        offset = np.arange(-reach, reach + 1)
        self.middle = np.clip(np.rint(start).astype(int), 0, (width - 1, height - 1))
        columns, rows = (self.middle[:, axis, None] + offset for axis in (0, 1))
        self.intensity = padded[rows[:, :, None] + reach, columns[:, None, :] + reach].reshape(len(start), -1).astype(np.float32)
        inside = ((rows >= 0) & (rows < height))[:, :, None] & ((columns >= 0) & (columns < width))[:, None, :]
        self.inside = inside.reshape(len(start), -1).astype(np.float32)
        self.x, self.y = (grid.astype(np.float32).ravel() for grid in np.meshgrid(offset, offset))
        area = along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0]
        area = np.where(np.abs(area) < 1e-9, 1e-9, area)
        self.to_window = np.stack([down[:, 1], -down[:, 0], -along[:, 1], along[:, 0]]) / area  # turns pixels into halves of the window
        self.bends = bends
        self.place = start - self.middle
        self.angles = np.stack([np.arctan2(along[:, 1], along[:, 0]), np.arctan2(down[:, 1], down[:, 0])], axis=1)
        self.log_blur = np.zeros(len(start))
        self.linear = np.tile([0.0, 1.0, 0.0, 0.0], (len(start), 1))  # m, C, g

    def fit(self) -> Saddles:
        """Gauss-Newton until no corner moves."""
        columns, weights = self._linearised()
        self.linear = _solved(columns[:, 5:], weights, self.intensity, damping=1e-6)
        columns[:, :5] *= self.linear[:, 1, None, None].astype(np.float32)  # they were made for a contrast of 1
        left = self.intensity
        for _ in range(STEPS):
            left = self.intensity - (self.linear[:, None].astype(np.float32) @ columns[:, 5:])[:, 0]
            step = _solved(columns, weights, left, damping=DAMPING)
            moved = np.clip(step[:, :5], -LARGEST_STEP, LARGEST_STEP)
            self.place += moved[:, :2]
            self.angles += moved[:, 2:4]
            self.log_blur = np.maximum(self.log_blur + moved[:, 4], np.log(LEAST_BLUR))
            self.linear += step[:, 5:]
            if np.abs(moved[:, :2]).max() < STILL:
                break
            columns, weights = self._linearised()
        return Saddles(self.middle + self.place, self.linear[:, 1], self._explained(left, weights))

    def _linearised(self) -> tuple[ndarray, ndarray]:
        """dI / d(x, y, t1, t2, log w, m, C, g), (n, 9, k), and the weights (n, k)."""
        dx, dy = self.x - _column(self.place[:, 0]), self.y - _column(self.place[:, 1])
        (c1, c2), (s1, s2) = (tuple(map(_column, turn(self.angles).T)) for turn in (np.cos, np.sin))
        k1, k2 = map(_column, self.bends.T)
        w = _column(np.exp(self.log_blur))
        a1, a2 = dx * c1 + dy * s1, dx * c2 + dy * s2
        d1, d2 = dy * c1 - dx * s1 - (0.5 * k1) * a1 * a1, dy * c2 - dx * s2 - (0.5 * k2) * a2 * a2
        e1, e2 = np.tanh(d1 / w), np.tanh(-d2 / w)  # so that the square between +a1 and +a2 counts as positive
        contrast = _column(self.linear[:, 1]) / w
        f1, f2 = contrast * (1.0 - e1 * e1) * e2, -contrast * (1.0 - e2 * e2) * e1  # dI/dd1, dI/dd2
        columns = np.empty((len(dx), 9, dx.shape[1]), dtype=np.float32)
        columns[:, 0] = f1 * (s1 + k1 * a1 * c1) + f2 * (s2 + k2 * a2 * c2)
        columns[:, 1] = f1 * (k1 * a1 * s1 - c1) + f2 * (k2 * a2 * s2 - c2)
        columns[:, 2] = -f1 * a1
        columns[:, 3] = -f2 * a2
        columns[:, 4] = -(f1 * d1 + f2 * d2)
        columns[:, 5] = 1.0
        columns[:, 6] = e1 * e2
        columns[:, 7], columns[:, 8] = dx, dy
        return columns, self._weights(dx, dy)

    def _weights(self, dx: ndarray, dy: ndarray) -> ndarray:
        """1 at the corner, 0 at the window's side, smooth between; 0 outside the picture."""
        xx, xy, yx, yy = map(_column, self.to_window)
        out = np.maximum(np.abs(xx * dx + xy * dy), np.abs(yx * dx + yy * dy))
        return np.maximum(1.0 - out * out, 0.0) ** 2 * self.inside

    def _explained(self, left: ndarray, weights: ndarray) -> ndarray:
        """The share of each window's variance that is not left over."""
        total = np.maximum(weights.sum(1), 1e-9)
        mean = (weights * self.intensity).sum(1) / total
        variance = (weights * (self.intensity - mean[:, None]) ** 2).sum(1)
        return 1.0 - (weights * left * left).sum(1) / np.maximum(variance, 1e-9)


def _solved(columns: ndarray, weights: ndarray, right: ndarray, *, damping: float) -> ndarray:
    """Damped weighted least squares in each window: columns (n, p, k), weights and right side (n, k), solution (n, p)."""
    weighted = columns * weights[:, None]
    normal = (weighted @ columns.transpose(0, 2, 1)).astype(float)
    diagonal = np.einsum("npp->np", normal)
    normal += np.eye(normal.shape[1]) * (damping * diagonal + 1e-6)[:, None]
    return np.linalg.solve(normal, (weighted @ right[:, :, None]).astype(float))[:, :, 0]


def _column(values: ndarray) -> ndarray:
    return values.astype(np.float32)[:, None]
