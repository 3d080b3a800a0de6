"""Places where four squares meet, wherever they are in a picture, before anything is known of a board.

A saddle of the blurred picture has a negative determinant of its second derivatives; most of texture and
noise has some. What tells a corner of four squares is a circle around it: along it the picture is bright and
dark by turns, four times, and the same on opposite sides. With v_k the grey at the angles 2 pi k / n, mean
taken out,

    even = sum v_k v_(k + n/2) / sum v_k^2        1 where opposite sides are alike, -1 at an edge
    crossings = sign changes of v around the circle, 4 at a corner

The angles of the crossings are those of the two edges. A picture is looked at in copies, halved again and
again, since squares of a large photograph are too blurred for a small circle.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.reused_arrays import ReusedArrays
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["SaddlePoints", "saddle_points"]

# The picture is blurred with this sigma, pixels, before derivatives.
BLUR_SIGMA = 1.5
KERNEL = cv2.getGaussianKernel(13, BLUR_SIGMA, cv2.CV_32F)
# Of one picture at a time.
ARRAYS = ReusedArrays()
# The circle about a saddle has this radius, pixels.
CIRCLE_RADIUS = 5.0
# So many places on the circle are looked at.
CIRCLE_SAMPLES = 32
# Opposite places on the circle correlate by more than this.
LEAST_EVENNESS = 0.5
# Saddles with less than this share of the strongest one's strength are not looked at.
LEAST_STRENGTH_SHARE = 0.02
# The rms along the circle is more than so many grey levels.
LEAST_CONTRAST = 2.5
# So few places on the circle rule most saddles out.
FEW_SAMPLES = 8
# Opposite ones of the few correlate by more than this.
LEAST_EVENNESS_OF_FEW = 0.2
# The mean square along the few is more than this share of what it is along the circle.
LEAST_CONTRAST_SHARE_OF_FEW = 0.3
# So many saddles are looked at, the strongest first.
MOST_SADDLES = 2500


class SaddlePoints(NamedTuple):
    """n corners of four squares.

    Attributes:
        pixels: (n,2) to about half a pixel.
        edges: (n,2) angles of the two edges, radians, 0 to pi, the bright square lying between the first and
            the second.
    """

    pixels: Float[ndarray, "n 2"]
    edges: Float[ndarray, "n 2"]


def saddle_points(grey: ndarray) -> SaddlePoints:
    """The corners of four squares in a picture (h,w) uint8."""
    smooth = cv2.sepFilter2D(grey, cv2.CV_32F, KERNEL, KERNEL, dst=ARRAYS.of("smooth", grey.shape))
    strength = _strength(smooth)
    x, y = _peaks(strength)
    pixels = np.stack([x, y], axis=1).astype(np.float32)
    pixels += _to_peak(strength, x, y)
    if len(pixels):
        pixels = pixels[_may_be_corners(smooth, pixels)]
    if not len(pixels):
        return SaddlePoints(np.zeros((0, 2)), np.zeros((0, 2)))
    values, even, power = _around(smooth, pixels, CIRCLE_SAMPLES)
    sign = values > 0
    changes = sign != np.roll(sign, -1, axis=1)
    good = (changes.sum(1) == 4) & (even > LEAST_EVENNESS) & (power > LEAST_CONTRAST**2)
    return SaddlePoints(pixels[good].astype(float), _edges(values[good], changes[good]))


def _may_be_corners(smooth: ndarray, pixels: ndarray) -> ndarray:
    """Which places a look at a few samples of their circles does not rule out: most saddles are noise's."""
    _, even, power = _around(smooth, pixels, FEW_SAMPLES)
    return (even > LEAST_EVENNESS_OF_FEW) & (power > LEAST_CONTRAST_SHARE_OF_FEW * LEAST_CONTRAST**2)


def _around(smooth: ndarray, pixels: ndarray, samples: int) -> tuple[ndarray, ndarray, ndarray]:
    """Along the circles: grey without its mean, how alike opposite sides are, and the mean square."""
    angles = 2 * np.pi * np.arange(samples) / samples
    circle = (CIRCLE_RADIUS * np.stack([np.cos(angles), np.sin(angles)])).astype(np.float32)
    x, y = pixels.T[:, :, None] + circle[:, None]
    values = cv2.remap(smooth, x, y, cv2.INTER_LINEAR)
    values -= values.mean(1, keepdims=True)
    square = np.maximum(np.einsum("nk,nk->n", values, values), 1e-9)
    half = samples // 2
    even = 2.0 * np.einsum("nk,nk->n", values[:, :half], values[:, half:]) / square
    return values, even, square / samples


def _strength(smooth: ndarray) -> ndarray:
    """Minus the determinant of the second derivatives, 0 where it is none of a saddle."""
    across, upright, mixed = (
        cv2.Sobel(smooth, cv2.CV_32F, *orders, ksize=3, dst=ARRAYS.of(str(orders), smooth.shape))
        for orders in ((2, 0), (0, 2), (1, 1))
    )
    cv2.multiply(across, upright, dst=across)
    cv2.multiply(mixed, mixed, dst=mixed, scale=4.0)
    cv2.subtract(mixed, across, dst=mixed)
    return np.maximum(mixed, 0.0, out=mixed)


def _peaks(strength: ndarray) -> tuple[ndarray, ndarray]:
    """Columns and rows of the strongest places among their neighbours."""
    reach = int(np.ceil(CIRCLE_RADIUS)) + 1
    if min(strength.shape) <= 2 * reach:
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    least = LEAST_STRENGTH_SHARE**2 * float(strength.max())
    largest = cv2.dilate(strength, np.ones((7, 7), np.uint8), dst=ARRAYS.of("largest", strength.shape))
    peak = np.greater_equal(strength, largest, out=ARRAYS.of("peak", strength.shape, bool))
    peak &= np.greater(strength, least, out=ARRAYS.of("strong", strength.shape, bool))
    y, x = np.divmod(np.flatnonzero(peak), strength.shape[1])
    height, width = strength.shape
    inside = (x >= reach) & (x < width - reach) & (y >= reach) & (y < height - reach)
    x, y = x[inside], y[inside]
    if len(y) > MOST_SADDLES:
        first = np.argpartition(-strength[y, x], MOST_SADDLES)[:MOST_SADDLES]
        y, x = y[first], x[first]
    return x, y


def _to_peak(strength: ndarray, x: ndarray, y: ndarray) -> ndarray:
    """From a peak's pixel to the top of the parabola through it and its neighbours."""
    steps = []
    for dx, dy in ((1, 0), (0, 1)):
        before, here, after = strength[y - dy, x - dx], strength[y, x], strength[y + dy, x + dx]
        bend = before - 2.0 * here + after
        steps.append(np.clip(0.5 * (before - after) / np.where(bend < 0, bend, -1e-9), -0.5, 0.5))
    return np.stack(steps, axis=1)


def _edges(values: ndarray, changes: ndarray) -> Float[ndarray, "n 2"]:
    """The angles at which the circle goes from dark to bright and from bright to dark, opposite ones
    averaged.
    """
    corner, sample = np.nonzero(changes)  # four for each corner, up and down by turns
    here, following = values[corner, sample], values[corner, (sample + 1) % CIRCLE_SAMPLES]
    angle = 2 * np.pi * (sample + here / (here - following)) / CIRCLE_SAMPLES
    turns = np.exp(2j * angle).reshape(-1, 2, 2).sum(1)  # opposite angles have the same double
    rises_first = (following > 0)[::4, None]
    return 0.5 * np.angle(np.where(rises_first, turns, turns[:, ::-1])) % np.pi
