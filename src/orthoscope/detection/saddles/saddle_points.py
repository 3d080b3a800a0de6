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

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["SaddlePoints", "saddle_points"]

# The picture is blurred with this sigma, pixels, before derivatives.
BLUR_SIGMA = 1.5
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
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), BLUR_SIGMA)
    strength = _strength(smooth)
    x, y = _peaks(strength)
    pixels = np.stack([x, y], axis=1).astype(np.float32)
    pixels += _to_peak(strength, x, y)
    angles = 2 * np.pi * np.arange(CIRCLE_SAMPLES) / CIRCLE_SAMPLES
    circle = (CIRCLE_RADIUS * np.stack([np.cos(angles), np.sin(angles)])).astype(np.float32)
    at = pixels[:, :, None] + circle
    if not len(at):
        return SaddlePoints(np.zeros((0, 2)), np.zeros((0, 2)))
    values = cv2.remap(smooth, at[:, 0].copy(), at[:, 1].copy(), cv2.INTER_LINEAR)
    values = values - values.mean(1, keepdims=True)
    power = np.maximum((values**2).sum(1), 1e-9)
    even = (values * np.roll(values, CIRCLE_SAMPLES // 2, axis=1)).sum(1) / power
    sign = values > 0
    changes = sign != np.roll(sign, -1, axis=1)
    good = (changes.sum(1) == 4) & (even > LEAST_EVENNESS) & (power > CIRCLE_SAMPLES * LEAST_CONTRAST**2)
    return SaddlePoints(pixels[good].astype(float), _edges(values[good], changes[good]))


def _strength(smooth: ndarray) -> ndarray:
    """Minus the determinant of the second derivatives, 0 where it is none of a saddle."""
    across = cv2.Sobel(smooth, cv2.CV_32F, 2, 0, ksize=3)
    upright = cv2.Sobel(smooth, cv2.CV_32F, 0, 2, ksize=3)
    mixed = cv2.Sobel(smooth, cv2.CV_32F, 1, 1, ksize=3)
    return np.maximum(4.0 * mixed * mixed - across * upright, 0.0)


def _peaks(strength: ndarray) -> tuple[ndarray, ndarray]:
    """Columns and rows of the strongest places among their neighbours."""
    reach = int(np.ceil(CIRCLE_RADIUS)) + 1
    peak = (strength >= cv2.dilate(strength, np.ones((7, 7), np.uint8))) & (
        strength > LEAST_STRENGTH_SHARE**2 * strength.max(initial=0.0)
    )
    peak[:reach] = peak[-reach:] = False
    peak[:, :reach] = peak[:, -reach:] = False
    y, x = np.nonzero(peak)
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
    following = np.roll(values, -1, axis=1)
    share = values / np.where(changes, values - following, 1.0)
    angle = 2 * np.pi * (np.arange(CIRCLE_SAMPLES) + share) / CIRCLE_SAMPLES
    rising = changes & (following > 0)
    edges = []
    for which in (rising, changes & ~rising):
        turns = np.where(which, np.exp(2j * angle), 0.0).sum(1)  # opposite angles have the same double
        edges.append(0.5 * np.angle(turns) % np.pi)
    return np.stack(edges, axis=1)
