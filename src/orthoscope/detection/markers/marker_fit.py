"""Corners of single markers to a few hundredths of a pixel: the whole marker, whose squares are known, is
drawn as the picture has it, and moved and bent until it is the picture.

A marker's corner is no saddle, and blur rounds it; but all edges inside the marker say where it lies, too.
Let P(u) be the marker's drawing and H the homography of its four corners as they are known so far. The
picture is

    I(x) = c + g.x + (b + h.x) M(x),      M(x) = blurred P(H^-1(x + d(x))),    d a polynomial of third order

d moves, stretches and bends: a lens bends the marker. Gauss-Newton on d's twenty numbers and the blur (what
blur does is the Laplacian of M), with b, c and uneven light, g and h, beside them, and with |grad M|: ink
that bled, a camera's curve and white that is clipped make all that is black larger or smaller. What noise
alone would bend is held back as far as lenses hardly bend so much. The corner is where x + d(x) is H's
corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.markers.markers import homography_of
from orthoscope.detection.noise import noise_variance
from orthoscope.geometry.arrays import Bool, Float, median, ndarray

__all__ = ["FittedMarkers", "fit_markers"]

# Squares of a marker that are larger than this, pixels, are reduced to about it.
USUAL_MODULE = 4.5
# A marker's drawing has at most so many pixels along each of its squares; no more than samples are taken.
MOST_DRAWN = 16
# And so many white squares around it.
DRAWN_MARGIN = 2
# The picture around a marker is compared as far as this share of the gap to the next, and a square at most.
GAP_SHARE = 0.6
# A square is drawn with at least so many samples along its shorter side.
SAMPLES_PER_MODULE = 6.0
# So many samples along a pixel are the most.
MOST_SAMPLES = 4
# The blur from which all begin, and the least and most, pixels.
FIRST_BLUR, LEAST_BLUR, MOST_BLUR = 0.8, 0.1, 6.0
# A marker has at most so many steps, and has arrived when its corners move by less than this, pixels; after
# the last by less than the second.
MOST_STEPS, STILL_PX, NEARLY_STILL_PX = 10, 0.05, 0.2
# When they have moved by more than this, pixels, they take the place of those from which it began, in the
# first so many steps: a bend that is begun anew with each step arrives nowhere.
FARTHEST_PX, BEGINNING_STEPS = 0.3, 4
# Less contrast than this, grey levels, is none.
LEAST_CONTRAST = 1.0
# A marker with fewer pixels tells nothing.
FEWEST_PIXELS = 60
# Of a marker of the picture's own width a lens bends the sides by about this share of it: by terms of second
# order, and of third.
USUAL_BENDS = (0.25, 0.25)
# These are powers of x and y in the polynomial.
POWERS = np.array([(i - j, j) for i in range(4) for j in range(i + 1)])
# So many of them move and stretch.
STRAIGHT = 3
# Light changes over half a marker by about this share of the contrast.
USUAL_LIGHT = 0.1
# Edges are all moved outwards by more than about this, pixels, only where the picture says so in spite of its
# noise.
USUAL_SHIFT = 0.015
# At most this share of the picture's variance is neither noise nor explained, or something else is there.
MOST_UNEXPLAINED = 0.03
# What is usually left, by a coarse compression as by noise, counts as noise where so many markers say it, up
# to this share of the square of the contrast.
ENOUGH_TO_COMPARE, MOST_USUAL_SHARE = 4, 0.004
# Within so many squares from a good corner what is left has a variance, but for noise, of at most this share
# of the square of the contrast.
LOCAL_MODULES, MOST_LOCALLY_UNEXPLAINED = 1.5, 0.0015
# Of a good corner the standard deviation is less than this, pixels.
WIDEST_SPREAD = 0.22
# Of a marker that leaves more than so many times what is usual, since something covers a part of it or it is
# bent too much, at most this share of that.
TOUCHED_TIMES, TOUCHED_SHARE = 4.0, 0.5
# With a blur of at least this, pixels, it is told how much of what is left hangs together.
LEAST_COHERENCE_BLUR = 0.7


class FittedMarkers(NamedTuple):
    """corners: (n,4,2) pixels.  good: (n,4) whether the picture says to well within a pixel where each is."""

    corners: Float[ndarray, "n 4 2"]
    good: Bool[ndarray, "n 4"]


def fit_markers(
    grey: ndarray, corners: Float[ndarray, "n 4 2"], drawings: Sequence[ndarray], *, gap: float
) -> FittedMarkers:
    """The corners of markers.

    Args:
        grey: (h,w) uint8.
        corners: right to about half of a marker's squares, its own top left first, then clockwise.
        drawings: which squares (rows, columns) of each marker are black, its border included.
        gap: white around them, in their squares.
    """
    fine, good = corners.copy(), np.zeros(corners.shape[:2], dtype=bool)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)
    modules = np.array([len(drawing) for drawing in drawings])
    shrinks = np.maximum(np.rint(sides.min(1, initial=np.inf) / modules / USUAL_MODULE), 1).astype(int)
    noise = noise_variance(grey)
    fits: dict[int, _Fit] = {}
    for shrink in np.unique(shrinks):
        height, width = (side // shrink for side in grey.shape)
        part = grey[: height * shrink, : width * shrink]
        small = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA) if shrink > 1 else grey
        blur = FIRST_BLUR
        for number in np.flatnonzero(shrinks == shrink).tolist():
            start = (corners[number] + 0.5) / shrink - 0.5
            fit = _Fit(small, start, drawings[number], GAP_SHARE * min(gap, 1.0 / GAP_SHARE), blur)
            if fit.settle():
                fits[number], blur = fit, fit.blur
    usual = median(np.array([fit.noise for fit in fits.values()])) if len(fits) >= ENOUGH_TO_COMPARE else 0.0
    for number, fit in fits.items():
        shrink, signal = shrinks[number], fit.contrast**2
        fine[number] = (fit.corners + 0.5) * shrink - 0.5
        noise_here = max(noise / shrink**2, min(usual, MOST_USUAL_SHARE * signal)) / signal
        good[number] = fit.left_near_corners() < MOST_LOCALLY_UNEXPLAINED + noise_here
        widest = WIDEST_SPREAD * (TOUCHED_SHARE if fit.noise > TOUCHED_TIMES * noise_here * signal else 1.0)
        good[number] &= fit.spread() * np.sqrt(fit.coherence_near_corners()) * shrink < widest
        good[number] &= fit.unexplained < MOST_UNEXPLAINED + noise_here / (0.25 + noise_here)
    return FittedMarkers(fine, good)


class _Fit:
    """One marker on its way."""

    def __init__(
        self, grey: ndarray, corners: Float[ndarray, "4 2"], black: ndarray, margin: float, blur: float
    ) -> None:
        self.start = self.corners = corners
        self.blur, self.noise, self.contrast, self.unexplained = blur, 0.0, 1.0, 1.0
        self._squares = len(black)
        self._side = float(np.ptp(corners, axis=0).max())
        unit = len(black) * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        self._unit = unit
        rim = cv2.perspectiveTransform(
            (unit + margin * np.sign(unit - 0.5 * len(black)))[None], homography_of(unit, corners)
        )[0]
        low = np.maximum(np.floor(rim.min(0) - 3.0), 0).astype(int)
        high = np.minimum(np.ceil(rim.max(0) + 3.0), np.array(grey.shape[::-1]) - 1).astype(int)
        self.is_in_picture = bool(
            (high - low > 6).all() and (rim >= -1.0).all() and (rim <= high + 1.0).all()
        )
        if not self.is_in_picture:
            return
        self._low, self._middle, self._half = low, corners.mean(0) - low, 0.5 * self._side
        self._picture = grey[low[1] : high[1] + 1, low[0] : high[0] + 1].astype(np.float32)
        mask = np.zeros(self._picture.shape, np.uint8)
        cv2.fillConvexPoly(mask, np.rint((rim - low) * 16).astype(np.int32), 1, shift=4)
        self._inside = np.flatnonzero(mask)
        self._values = self._picture.take(self._inside)
        self._places = np.stack(np.divmod(self._inside, self._picture.shape[1])[::-1]).astype(np.float32)
        self._basis_inside = self._basis(self._places)
        square = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).min() / len(black)
        self._samples = int(np.clip(np.ceil(SAMPLES_PER_MODULE / max(square, 1e-3)), 1, MOST_SAMPLES))
        self._drawn_module = int(np.clip(np.exp2(np.round(np.log2(self._samples * square))), 2, MOST_DRAWN))
        self._drawing = _drawing(black, self._drawn_module)
        self._sampled = self._sample_places()
        self._basis_sampled = self._basis(self._sampled[:2])
        self._moved = np.zeros((2, len(POWERS)))
        share = self._side / max(grey.shape)
        bends = self._side * np.repeat([USUAL_BENDS[0] * share, USUAL_BENDS[1] * share**2], [3, 4])
        self._usual_bends = np.tile(np.concatenate([np.full(STRAIGHT, np.inf), bends]), 2)

    def settle(self) -> bool:
        """Steps until the corners stay; whether they do, nearly."""
        if not self.is_in_picture or len(self._values) < FEWEST_PIXELS:
            return False
        moved = np.inf
        for number in range(MOST_STEPS):
            before = self.corners
            if not self._step():
                return False
            moved = np.abs(self.corners - before).max()
            if moved < STILL_PX:
                break
            far = np.abs(self.corners - self.start).max() > FARTHEST_PX
            if far and number < BEGINNING_STEPS:  # the bend is told from better corners
                self.start, self._moved = self.corners, np.zeros_like(self._moved)
        return bool(moved < NEARLY_STILL_PX)

    def left_near_corners(self) -> Float[ndarray, "4"]:
        """The variance that the drawing leaves near each corner, as a share of the square of the contrast."""
        left = [self._left[near].var() if near.any() else np.inf for near in self._near_corners()]
        return np.array(left) / self.contrast**2

    def coherence_near_corners(self) -> Float[ndarray, "4"]:
        """How many times the variance of noise what is left near each corner has once it is blurred; 1 at
        least.

        Noise of single pixels averages out, and so the spread has it. What something in front of a corner
        leaves, be it as small, does not: it moves the corner as noise of so many times the variance would.
        """
        sigma = max(self.blur, LEAST_COHERENCE_BLUR)
        left, there = np.zeros_like(self._picture), np.zeros_like(self._picture)
        left.put(self._inside, self._left)
        there.put(self._inside, 1.0)
        rim = cv2.BORDER_CONSTANT
        blurred = cv2.GaussianBlur(left, (0, 0), sigma, borderType=rim).take(self._inside)
        # the square of a Gaussian is one, narrower: so much of the variance of noise a blur leaves
        share = cv2.GaussianBlur(there, (0, 0), sigma / np.sqrt(2.0), borderType=rim).take(self._inside)
        noise = self.noise / (4.0 * np.pi * sigma**2) * share
        told = [(blurred[near] ** 2).sum() / max(noise[near].sum(), 1e-9) for near in self._near_corners()]
        return np.maximum(told, 1.0)

    def _near_corners(self) -> Bool[ndarray, "4 k"]:
        """Which pixels are near each corner."""
        away = np.linalg.norm(self._places - (self.corners - self._low)[:, :, None], axis=1)
        return away < LOCAL_MODULES * self._side / self._squares

    def _step(self) -> bool:
        """One step of Gauss-Newton; whether it could be made."""
        model, count = self._drawn(), len(POWERS)
        columns = np.empty((2 * count + 8, len(self._values)), np.float32)
        slopes = [
            cv2.Scharr(model, cv2.CV_32F, *way, scale=1.0 / 32.0).take(self._inside)
            for way in ((1, 0), (0, 1))
        ]
        for first, slope in zip((0, count), slopes, strict=True):
            np.multiply(slope, self._basis_inside, out=columns[first : first + count])
        columns[-8] = np.hypot(*slopes)
        columns[-7] = cv2.Laplacian(model, cv2.CV_32F, ksize=1).take(self._inside)
        columns[-2], columns[-1] = model.take(self._inside), 1.0
        columns[-6:-4] = self._basis_inside[1:3]
        np.multiply(self._basis_inside[1:3], columns[-2], out=columns[-4:-2])
        normal = (columns @ columns.T).astype(float)
        # what the bend was before counts, too: as a whole it is held to nothing, by as much as there is noise
        held = 1e-7 * np.diag(normal) + 1e-9
        held[: 2 * count] += self.noise / np.maximum(self._usual_bends * abs(self.contrast), 1e-6) ** 2
        held[-8] += self.noise / max(USUAL_SHIFT * abs(self.contrast), 1e-6) ** 2
        held[-6:-2] += self.noise / max(USUAL_LIGHT * abs(self.contrast), 1e-6) ** 2
        wanted = np.zeros(len(held))
        wanted[: 2 * count] = np.where(
            np.isfinite(self._usual_bends), -self.contrast * self._moved.ravel(), 0.0
        )
        inverse = np.linalg.inv(normal + np.diag(held))
        solution = inverse @ (columns @ self._values + held * wanted)
        self.contrast = float(solution[-2])
        if abs(self.contrast) < LEAST_CONTRAST or not np.isfinite(solution).all():
            return False
        self._left = self._values - solution.astype(np.float32) @ columns
        self.noise = float(self._left @ self._left) / max(len(self._left) - len(solution), 1)
        self.unexplained = float(self._left.var() / max(self._values.var(), 1e-9))
        limit = 0.5 * self._side / self._squares
        steps = solution[: 2 * count].reshape(2, count) / self.contrast
        self._moved = self._moved + np.clip(steps, -limit, limit)
        squared = self.blur**2 + 2.0 * float(np.clip(solution[-7] / self.contrast, -0.5, 0.5))
        self.blur = float(np.sqrt(np.clip(squared, LEAST_BLUR**2, MOST_BLUR**2)))
        self._inverse = inverse
        self.corners = self._foreseen()
        return True

    def _foreseen(self) -> Float[ndarray, "4 2"]:
        """Where the corners are now."""
        here = self.start - self._low
        for _ in range(2):
            here = self.start - self._low - (self._moved @ self._basis(here.T)).T
        return here + self._low

    def spread(self) -> Float[ndarray, "4"]:
        """The standard deviation of each corner, pixels."""
        basis, count = self._basis((self.corners - self._low).T), len(POWERS)
        parts = self._inverse[:count, :count] + self._inverse[count : 2 * count, count : 2 * count]
        variances = np.einsum("ik,ij,jk->k", basis, parts, basis)
        return np.sqrt(np.maximum(variances, 0.0) * self.noise) / abs(self.contrast)

    def _basis(self, places: Float[ndarray, "2 k"]) -> Float[ndarray, "t k"]:
        """The terms of the polynomial."""
        x, y = (places - self._middle[:, None].astype(places.dtype)) / places.dtype.type(self._half)
        terms = np.empty((len(POWERS), *x.shape), places.dtype)
        terms[0], terms[1], terms[2] = 1.0, x, y
        for above, below in enumerate((1, 1, 2), 3):
            np.multiply(terms[below], x if above < 5 else y, out=terms[above])
        terms[4] = x * y
        for above, below in enumerate((3, 4, 5), 6):
            np.multiply(terms[below], x, out=terms[above])
        np.multiply(terms[5], y, out=terms[9])
        return terms

    def _sample_places(self) -> Float[ndarray, "3 k"]:
        """Where the picture's samples are, row by row, and 1."""
        step = (np.arange(self._samples) + 0.5) / self._samples - 0.5
        y, x = ((np.arange(side)[:, None] + step).ravel() for side in self._picture.shape)
        places = np.ones((3, len(y), len(x)), np.float32)
        places[0], places[1] = x, y[:, None]
        return places.reshape(3, -1)

    def _drawn(self) -> ndarray:
        """The marker as the picture would have it, black 0 and white 1."""
        drawn = (self._unit + DRAWN_MARGIN) * self._drawn_module - 0.5
        to_drawing = homography_of(self.start - self._low, drawn).astype(np.float32)
        moved = self._sampled.copy()
        moved[:2] += self._moved.astype(np.float32) @ self._basis_sampled
        u, v, w = to_drawing @ moved
        height, width = self._picture.shape
        shape = (height * self._samples, width * self._samples)
        model = cv2.remap(
            self._drawing,
            (u / w).reshape(shape),
            (v / w).reshape(shape),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=1.0,
        )
        model = cv2.GaussianBlur(model, (0, 0), self.blur * self._samples)
        return (
            cv2.resize(model, (width, height), interpolation=cv2.INTER_AREA) if self._samples > 1 else model
        )


def _drawing(black: ndarray, module: int) -> Float[ndarray, "h w"]:
    """Black 0 and white 1, with white around, `module` pixels a square."""
    white = 1.0 - np.pad(black, DRAWN_MARGIN).astype(np.float32)
    return np.repeat(np.repeat(white, module, axis=0), module, axis=1)
