"""Corners to a few hundredths of a pixel: a blurred saddle is fitted to the picture around each.

Floor 5.  Around a corner at c, with the two edges along unit vectors at angles t1 and t2, a chessboard looks like

    I = m + C tanh(d1 / w) tanh(d2 / w) + g . (x - c),    d1, d2 = signed distances of x from the two edges

m and C are grey and contrast, w the blur, g uneven light.  Nine unknowns a corner, Gauss-Newton on all corners at once; weights fall from 1 at the
corner to 0 at 0.4 squares in the board's own directions, so that neighbours never look in.  The fit starts from OpenCV's cornerSubPix and gives
way to it where it moves too far or the picture is no saddle.  Photographs with large squares are reduced first: beyond some 40 px a square, more
pixels add time, not truth.  Idea: H. Mueller and others' fitted intensity patches; docs/detection.md says what it gains and how that was measured.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["refined"]

SHARE = 0.4  # of a square: how far from its corner a pixel still has a say
START_SHARE = 0.25  # the same for cornerSubPix, which only has to come near
LARGE = 40.0  # px a square: larger ones are reduced
REACH = 16.0  # px: no window is larger to either side
SMOOTHING = 0.5  # px: sigma of the blur before the fit, so that its derivatives exist where a camera has sharpened
STEPS = 10
STILL = 1e-3  # px: a corner that moves less has arrived
LEAST_BLUR = 0.75  # px
FARTHEST = 0.15  # of a square: a fit that ends farther from its start is not believed, nor one
LEAST_FIT = 0.5  # that explains less than this share of the window's variance
PIXELS_AT_ONCE = 120_000


def refined(grey: ndarray, rough: Float[ndarray, "m 2"], columns: int, rows: int) -> Float[ndarray, "m 2"]:
    """Corners (columns * rows, 2), row by row, pixels, from ones that are right to a pixel or two."""
    shrink = max(1, int(np.median(_spacing(rough, columns, rows)) // LARGE))
    height, width = (side // shrink * shrink for side in grey.shape)
    small = cv2.resize(grey[:height, :width], None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA) if shrink > 1 else grey
    start = _nearby((small), (rough + 0.5) / shrink - 0.5, columns, rows)
    along, down = _directions(start, columns, rows)
    spacing = _spacing(start, columns, rows)
    fitted, explained = _fit_saddles(cv2.GaussianBlur(small, (0, 0), SMOOTHING), start, along, down)
    good = (np.hypot(*(fitted - start).T) < np.maximum(FARTHEST * spacing, 1.0)) & (explained > LEAST_FIT)
    return (np.where(good[:, None], fitted, start) + 0.5) * shrink - 0.5


def _nearby(grey: ndarray, corners: ndarray, columns: int, rows: int) -> ndarray:
    """cornerSubPix with a window that suits each corner's own squares."""
    radius = np.clip(np.round(START_SHARE * _spacing(corners, columns, rows)), 2, REACH).astype(int)
    out = corners.astype(np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, STILL)
    for size in np.unique(radius):
        which = radius == size
        window = np.ascontiguousarray(out[which]).reshape(-1, 1, 2)
        out[which] = cv2.cornerSubPix(grey, window, (int(size), int(size)), (-1, -1), criteria).reshape(-1, 2)
    return out.astype(float)


def _directions(corners: ndarray, columns: int, rows: int) -> tuple[ndarray, ndarray]:
    """For each corner, one square along its row and one along its column, pixels."""
    grid = corners.reshape(rows, columns, 2)
    return np.gradient(grid, axis=1).reshape(-1, 2), np.gradient(grid, axis=0).reshape(-1, 2)


def _spacing(corners: ndarray, columns: int, rows: int) -> ndarray:
    """The distance to the nearest neighbour along row and column, pixels."""
    grid = corners.reshape(rows, columns, 2)
    nearest = np.full((rows, columns), np.inf)
    for axis in (0, 1):
        gaps = np.hypot(*np.moveaxis(np.diff(grid, axis=axis), -1, 0))
        for side in (slice(None, -1), slice(1, None)):
            place = (side, slice(None)) if axis == 0 else (slice(None), side)
            nearest[place] = np.minimum(nearest[place], gaps)
    return nearest.ravel()


def _fit_saddles(grey: ndarray, start: ndarray, along: ndarray, down: ndarray) -> tuple[ndarray, ndarray]:
    """The saddles' places (m,2), and the share of each window's variance that they explain."""
    along = along * np.minimum(SHARE, REACH / np.hypot(*along.T))[:, None]
    down = down * np.minimum(SHARE, REACH / np.hypot(*down.T))[:, None]
    reach = int(np.ceil((np.abs(along) + np.abs(down)).max())) + 1
    at_once = max(1, PIXELS_AT_ONCE // (2 * reach + 1) ** 2)
    padded = cv2.copyMakeBorder(grey, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
    places, explained = np.empty_like(start), np.empty(len(start))
    for i in range(0, len(start), at_once):
        some = slice(i, i + at_once)
        places[some], explained[some] = _Windows(padded, grey.shape, reach, start[some], along[some], down[some]).fit()
    return places, explained


class _Windows:
    """The windows of some corners, flattened: intensity (n, k), and where each pixel is from the window's middle."""

    def __init__(self, padded: ndarray, shape: tuple[int, ...], reach: int, start: ndarray, along: ndarray, down: ndarray) -> None:
        offset = np.arange(-reach, reach + 1)
        self.middle = np.clip(np.round(start).astype(int), 0, np.array(shape[1::-1]) - 1)
        rows, columns = (self.middle[:, axis, None] + reach + offset for axis in (1, 0))
        self.intensity = padded[rows[:, :, None], columns[:, None, :]].reshape(len(start), -1).astype(np.float32)
        self.px, self.py = (grid.ravel().astype(np.float32) for grid in np.meshgrid(offset, offset))
        x, y = self.middle[:, :1] + self.px, self.middle[:, 1:] + self.py
        self.inside = ((x >= 0) & (x < shape[1]) & (y >= 0) & (y < shape[0])).astype(np.float32)
        determinant = (along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0])[:, None]
        self.board_x = np.stack([down[:, 1], -down[:, 0]], axis=1) / determinant  # rows that turn pixels into windows' own units
        self.board_y = np.stack([-along[:, 1], along[:, 0]], axis=1) / determinant
        self.place = start - self.middle
        self.angles = np.stack([np.arctan2(along[:, 1], along[:, 0]), np.arctan2(down[:, 1], down[:, 0])], axis=1)
        self.blur = np.ones(len(start))

    def fit(self) -> tuple[ndarray, ndarray]:
        """Gauss-Newton over place, angles and blur; the four linear unknowns are solved for exactly at each step."""
        explained = np.zeros(len(self.place))
        for _ in range(STEPS):
            with np.errstate(divide="ignore", invalid="ignore"):
                step, explained = self._step()
            step = np.nan_to_num(step)
            moved = np.clip(step[:, :2], -1.0, 1.0)
            self.place = self.place + moved
            self.angles = self.angles + np.clip(step[:, 2:4], -0.2, 0.2)
            self.blur = np.maximum(self.blur * np.exp(np.clip(step[:, 4], -0.5, 0.5)), LEAST_BLUR)
            if np.abs(moved).max() < STILL:
                break
        return self.middle + self.place, np.nan_to_num(explained)

    def _step(self) -> tuple[ndarray, ndarray]:
        """The step of the five unknowns (dx, dy, t1, t2, log w), and the variance explained before it."""
        dx, dy = self.px - _column(self.place[:, 0]), self.py - _column(self.place[:, 1])
        weights = self._weights(dx, dy)
        (c1, s1), (c2, s2) = ((_column(np.cos(t)), _column(np.sin(t))) for t in self.angles.T)
        w = _column(self.blur)
        d1, d2 = dy * c1 - dx * s1, dx * s2 - dy * c2
        t1, t2 = np.tanh(d1 / w), np.tanh(d2 / w)
        linear = np.stack([np.ones_like(dx), t1 * t2, dx, dy], axis=1)  # (n, 4, k): m, C, g
        amount = _solved(linear, weights, self.intensity)
        residual = self.intensity - (amount[:, :, None].astype(np.float32) * linear).sum(1)
        f1, f2 = (_column(amount[:, 1]) / w * slope for slope in ((1 - t1 * t1) * t2, (1 - t2 * t2) * t1))
        nonlinear = [f1 * s1 - f2 * s2, f2 * c2 - f1 * c1, -f1 * (dx * c1 + dy * s1), f2 * (dx * c2 + dy * s2), -(f1 * d1 + f2 * d2)]
        step = _solved(np.concatenate([np.stack(nonlinear, axis=1), linear], axis=1), weights, residual)
        mean = (weights * self.intensity).sum(1) / weights.sum(1)
        variance = (weights * (self.intensity - mean[:, None]) ** 2).sum(1)
        return step[:, :5], 1.0 - (weights * residual * residual).sum(1) / np.maximum(variance, 1e-9)

    def _weights(self, dx: ndarray, dy: ndarray) -> ndarray:
        """1 at the corner, 0 at the window's side, smooth between."""
        x = _column(self.board_x[:, 0]) * dx + _column(self.board_x[:, 1]) * dy
        y = _column(self.board_y[:, 0]) * dx + _column(self.board_y[:, 1]) * dy
        out = np.maximum(np.abs(x), np.abs(y))
        return np.maximum(1.0 - out * out, 0.0) ** 2 * self.inside


def _solved(columns: ndarray, weights: ndarray, right: ndarray) -> ndarray:
    """Weighted least squares of each window: columns (n, p, k), weights and right side (n, k); a little damped."""
    weighted = columns * weights[:, None]
    normal = (weighted @ columns.transpose(0, 2, 1)).astype(float)
    diagonal = np.einsum("npp->np", normal)
    normal += np.eye(normal.shape[1]) * (1e-4 * diagonal + 1e-6)[:, None]
    return np.linalg.solve(normal, (weighted @ right[:, :, None]).astype(float))[:, :, 0]


def _column(values: ndarray) -> ndarray:
    return values.astype(np.float32)[:, None]
