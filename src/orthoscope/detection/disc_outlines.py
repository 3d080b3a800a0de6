"""Discs in a photograph: dark spots whose moments are an ellipse's, then an ellipse through their outlines.

A threshold says which pixels are dark: compared with their surroundings, a few sizes of which are tried, or
with one level for all. A spot is a disc's image where its area A and the covariance C of its pixels agree,

    A = 4 pi sqrt(det C)   for an ellipse, less for any other shape.

The outline is where grey crosses the middle between inside and outside, sought along rays from the centre
that are evenly spread in the ellipse's own frame. Blur moves it along the normal by as much on opposite
sides, so that the centre of the ellipse through it stays.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.ellipses import Ellipses, fit_ellipses

__all__ = ["refined_discs", "spots"]

SURROUNDINGS = (0.12, 0.04, 0.3)  # of the longer side: windows of the thresholds
STEP = 6.0  # grey levels below its surroundings, at least
FEWEST_PIXELS = 9  # of a spot
LARGEST_SHARE = 0.2  # of the picture
LEAST_LIKE = 0.93  # A / (4 pi sqrt(det C)); a square has .955, but small discs are stairs
SHARP_PIXELS, LEAST_LIKE_SHARP = 120, 0.975  # from so many pixels on stairs no longer matter
LEAST_WIDTH = 0.9  # px: half the shorter axis
MOST_OBLONG = 12.0  # one axis over the other
MOST_SPOTS = 4000  # more are noise
RAYS = 48
SAMPLES = 41  # along a ray
INSIDE, OUTSIDE = 0.45, 1.45  # radii between which the outline is sought; a neighbour begins beyond
LEVELS = 0.25  # of a radius at either end, over which the levels are taken
ROUNDS = 3
LEAST_CONTRAST = 8.0  # grey levels
MOST_ROUGH = 0.12  # rms of the outline about its ellipse, radii
LEAST_SEEN = 0.9  # of the rays
SMOOTHING = 0.7  # px


def spots(grey: ndarray) -> Iterator[Ellipses]:
    """Dark spots that may be discs, under one threshold after the other.

    Args:
        grey: (h,w) uint8.
    """
    longer = max(grey.shape)
    smooth = cv2.GaussianBlur(grey, (0, 0), SMOOTHING)
    for share in SURROUNDINGS:
        window = max(3, int(share * longer)) | 1
        level = cv2.blur(smooth, (window, window), borderType=cv2.BORDER_REPLICATE)
        yield _elliptic(smooth < level.astype(np.int16) - STEP)
    level, _ = cv2.threshold(smooth, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    yield _elliptic(smooth <= level)


def _elliptic(dark: ndarray) -> Ellipses:
    """The connected parts of a mask whose moments are an ellipse's and that do not touch the border."""
    _, labels, stats, middles = cv2.connectedComponentsWithStats(dark.astype(np.uint8), connectivity=4)
    left, top, width, height, area = stats.T
    inside = (left > 0) & (top > 0) & (left + width < dark.shape[1]) & (top + height < dark.shape[0])
    fits = inside & (area >= FEWEST_PIXELS) & (area < LARGEST_SHARE * dark.size)
    fits &= area > 0.5 * np.pi / (4.0 * np.sqrt(2.0)) / MOST_OBLONG * np.minimum(width, height) ** 2
    fits[0] = False
    if not 0 < fits.sum() <= MOST_SPOTS:
        return Ellipses(np.zeros((0, 2)), np.zeros((0, 2, 2)))
    covariances = _covariances(labels, fits, middles)
    which = np.flatnonzero(fits)
    values, vectors = np.linalg.eigh(covariances)
    like = area[which] / (4.0 * np.pi * np.sqrt(np.maximum(values.prod(1), 1e-12)))
    least = np.where(area[which] < SHARP_PIXELS, LEAST_LIKE, LEAST_LIKE_SHARP)
    radii = 2.0 * np.sqrt(np.maximum(values, 1e-12))
    good = (like > least) & (radii[:, 0] > LEAST_WIDTH) & (radii[:, 1] < MOST_OBLONG * radii[:, 0])
    axes = np.einsum("nij,nj,nkj->nik", vectors, radii, vectors)
    return Ellipses(middles[which][good], axes[good])


def _covariances(labels: ndarray, fits: ndarray, middles: ndarray) -> Float[ndarray, "n 2 2"]:
    """Of the pixels of the parts that fit, each pixel a square."""
    row, column = np.nonzero(fits[labels])
    number = (np.cumsum(fits) - 1)[labels[row, column]]
    count = int(fits.sum())
    x, y = column - middles[fits][number, 0], row - middles[fits][number, 1]
    sums = [np.bincount(number, weight, count) for weight in (x * x, x * y, x * y, y * y)]
    area = np.bincount(number, minlength=count)
    return (np.stack(sums, axis=-1) / area[:, None]).reshape(-1, 2, 2) + np.eye(2) / 12.0


def refined_discs(grey: ndarray, rough: Ellipses) -> Ellipses:
    """Ellipses through the outlines of discs that are dark; NaN where there is no whole outline.

    Args:
        grey: (h,w) uint8.
        rough: ellipses that are right to a quarter of their size.
    """
    smooth = cv2.GaussianBlur(grey, (0, 0), SMOOTHING)
    angle = 2.0 * np.pi * np.arange(RAYS) / RAYS
    rays = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    fitted = rough
    for _ in range(ROUNDS):
        known = np.isfinite(fitted.centres[:, 0])
        centres, axes = fitted.centres[known], fitted.axes[known]
        if not len(centres):
            break
        radii = _outline(smooth, centres, axes @ rays.T)
        rims = centres[:, None] + radii[..., None] * np.einsum("nij,kj->nki", axes, rays)
        found = fit_ellipses(rims)
        places = np.linalg.solve(
            np.nan_to_num(found.axes, nan=1.0) + 1e-9 * np.eye(2),
            np.nan_to_num(rims - found.centres[:, None]).swapaxes(1, 2),
        )
        off = np.where(np.isfinite(radii), np.hypot(*places.swapaxes(0, 1)) - 1.0, np.nan)
        seen = np.isfinite(off).mean(1) >= LEAST_SEEN
        rough_px = np.sqrt(np.nanmean(np.where(seen[:, None], off, 1.0) ** 2, axis=1))
        good = seen & (rough_px < MOST_ROUGH)
        new_centres, new_axes = np.full_like(fitted.centres, np.nan), np.full_like(fitted.axes, np.nan)
        which = np.flatnonzero(known)[good]
        new_centres[which], new_axes[which] = found.centres[good], found.axes[good]
        fitted = Ellipses(new_centres, new_axes)
    return fitted


def _outline(smooth: ndarray, centres: ndarray, arms: Float[ndarray, "n 2 k"]) -> Float[ndarray, "n k"]:
    """How far along each ray, in radii, grey rises through the middle between inside and outside; NaN where
    it does not, or where the ray leaves the picture.
    """
    radius = np.linspace(INSIDE, OUTSIDE, SAMPLES)
    x, y = (centres[:, i, None, None] + arms[:, i, :, None] * radius for i in (0, 1))
    shape = (-1, RAYS * SAMPLES)
    grey = cv2.remap(
        smooth.astype(np.float32),
        x.reshape(shape).astype(np.float32),
        y.reshape(shape).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    ).reshape(x.shape)
    ends = max(2, round(SAMPLES * LEVELS / (OUTSIDE - INSIDE)))
    inside = np.median(grey[..., :ends], axis=(1, 2))[:, None]
    outside = np.median(grey[..., -ends:], axis=2)
    level = 0.5 * (inside + outside)[..., None]
    above = grey > level
    rises = above[..., 1:] & ~above[..., :-1]
    first = rises.argmax(-1)
    low, high = (np.take_along_axis(grey, (first + i)[..., None], -1)[..., 0] for i in (0, 1))
    share = (level[..., 0] - low) / np.maximum(high - low, 1e-6)
    found = radius[first] + share * (radius[1] - radius[0])
    height, width = smooth.shape
    far_x, far_y = (centres[:, i, None] + arms[:, i] * 1.1 for i in (0, 1))
    in_picture = (far_x > 0) & (far_x < width - 1) & (far_y > 0) & (far_y < height - 1)
    good = rises.any(-1) & in_picture & (outside - inside > LEAST_CONTRAST)
    return np.where(good, found, np.nan)
