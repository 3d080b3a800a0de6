"""Corners to a few hundredths of a pixel: OpenCV's cornerSubPix to come near, then a blurred saddle fitted to
each corner's window.

Windows are measured in the board's own squares, so that a near and a far corner, a large and a small
photograph are treated alike: 0.25 squares to each side for cornerSubPix, which only has to come near and goes
astray where a larger window meets the board's margin, and 0.45 for the fit, which weighs its pixels the less
the farther out they are. Only the board's part of a photograph is looked at, and where squares are large it
is reduced first: beyond some 50 px a square more pixels add time, not truth. Where the fit moves too far, or
the picture is no saddle, cornerSubPix has the last word. docs/detection.md has the figures.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import GridShape, grid_shape, nearest_neighbour
from orthoscope.detection.noise import noise_variance
from orthoscope.detection.saddles.saddle import Saddles, fit_saddles
from orthoscope.detection.saddles.saddle_arms import SaddleArms, saddle_arms
from orthoscope.geometry.arrays import Bool, Float, Int, distinct, median, ndarray

__all__ = ["WIDEST_SPREAD", "WINDOW_SHARE", "Refined", "Usual", "refined", "sought_again"]

# Half the window of cornerSubPix is this share of a square.
NEAR_SHARE = 0.25
# Half the window of the fit is this share of a square.
WINDOW_SHARE = 0.45
# Larger squares are reduced to about this, pixels.
USUAL_SQUARE = 50.0
# Half the largest window is this, pixels.
LARGEST_REACH = 18.0
# With this sigma, pixels, what a camera sharpened until it jumps from pixel to pixel has slopes again.
SMOOTHING_SIGMA = 0.5
# Of an arm this share is used, since blur reaches over its side.
ARM_SHARE = 0.85
# Smoothing leaves this share of the noise's variance.
NOISE_LEFT_SHARE = 0.41
# The mean square of a blurred saddle over its window is about this.
SADDLE_MEAN_SQUARE = 0.6
# A fit that ends farther from its start than this share of a square is not believed.
FARTHEST_SHARE = 0.35
# Of a sure corner the standard deviation is less than this, pixels: it is within a pixel then, as good as
# always.
WIDEST_SPREAD = 0.19
# The edges of a sure corner are off the lattice's lines by less than this, radians.
WIDEST_TURN = 0.4
# A sure corner has more than this share of the usual contrast.
LEAST_CONTRAST_SHARE = 0.35
# Where the saddle leaves at most so much more of a window than of most, as a share of its variance, nothing
# covers it; where much is noise, the arms are asked wherever more than this share of that is left.
HARDLY_UNEXPLAINED, HARDLY_UNEXPLAINED_NOISE = 0.005, 0.1
# Where the arms are known better than this, pixels, and agree, what is left is that squares are not alike.
SMALL_ARM_SPREAD = 0.2
# What no arm tells from noise leaves at most so much more than of most, and of the share that is noise.
MOST_UNEXPLAINED, MOST_UNEXPLAINED_NOISE = 0.02, 0.3
# Where a marker reaches into the window, whose blur is in it, so much more.
MOST_UNEXPLAINED_BY_MARKS = 0.1
# An arm of a whole corner would move it by less than this, pixels, or so many standard deviations.
MOST_ARM_SHIFT, MOST_ARM_SPREADS = 1.0, 4.0
# The step across each arm of a whole corner is at least this share of the saddle's.
LEAST_ARM_STEP_SHARE = 0.25
# A mark on one side of a sure corner is farther from its edges than so many of the fitted blurs.
CLEAR_BLURS = 2.0
# A fit explains at least this share of what is not noise of its window's variance, or is not believed.
LEAST_SADDLE_SHARE = 0.85


class Usual(NamedTuple):
    """What is usual among the corners of a picture, so that some of them can be sought again by themselves.

    Attributes:
        shrink: how many of the photograph's pixels are one of the picture that was fitted.
        noise: variance of that picture's noise, once it is smoothed.
        blur: of the saddles, its pixels.
        contrast: of the saddles, grey levels.
        left: share of a window's variance that is neither saddle nor noise.
    """

    shrink: int
    noise: float
    blur: float
    contrast: float
    left: float


class Refined(NamedTuple):
    """Corners, (m,) of each.

    Attributes:
        pixels: (m,2).
        believed: whether a saddle was fitted; else cornerSubPix had the last word.
        explained: share of its window's variance that the saddle explains.
        sure: whether the saddle says to well within a pixel where the corner is, and is like the others'.
        whole: whether all its arms agree about it; where something covers a part of a window, they do not.
        spread: its standard deviation in its worst direction, pixels, by what its saddle leaves.
        plain: whether its window holds hardly anything but the saddle.
        contrast: grey levels; of one sign where the square towards the next column and row is bright.
        usual: what is usual among them.
    """

    pixels: Float[ndarray, "m 2"]
    believed: Bool[ndarray, " m"]
    explained: Float[ndarray, " m"]
    sure: Bool[ndarray, " m"]
    whole: Bool[ndarray, " m"]
    spread: Float[ndarray, " m"]
    plain: Bool[ndarray, " m"]
    contrast: Float[ndarray, " m"]
    usual: Usual

    def of(self, which: ndarray) -> Refined:
        """Some of them."""
        return Refined._make([*(part[which] for part in self[:-1]), self.usual])

    def among(self, ids: Int[ndarray, " m"], count: int) -> Refined:
        """Them at their numbers among so many, of which the others are nothing yet."""
        parts = [np.zeros((count, *part.shape[1:]), part.dtype) for part in self[:-1]]
        return Refined._make([*parts, self.usual]).with_others(ids, self)

    def with_others(self, which: ndarray, others: Refined) -> Refined:
        """Some of them, by their numbers, replaced."""
        parts = [part.copy() for part in self[:-1]]
        for part, new in zip(parts, others, strict=False):
            part[which] = new
        return Refined._make([*parts, self.usual])


def refined(
    grey: ndarray,
    rough: Float[ndarray, "m 2"],
    places: Float[ndarray, "m 2"],
    *,
    approach: bool = True,
    arm: float | Float[ndarray, " m"] = 1.0,
) -> Refined:
    """Corners from ones that are right to a fifth of a step of their lattice.

    Args:
        grey: (h,w) uint8.
        rough: (m,2) pixels.
        places: (m,2) column and row of each in the lattice, in steps.
        arm: how far from the edges something else than squares is printed, in steps; of all, where it is on
            opposite sides, or of each.
        approach: whether cornerSubPix comes near first; not where it went astray before.
    """
    square = nearest_neighbour(rough, places)
    shrink = max(1, round(median(square) / USUAL_SQUARE))
    every = np.arange(len(rough))
    return _refined(grey, rough, places, square, every, _Asked(shrink, approach, arm, None))


def sought_again(
    grey: ndarray,
    fine: Refined,
    start: Float[ndarray, "m 2"],
    places: Float[ndarray, "m 2"],
    which: Bool[ndarray, " m"],
    *,
    arm: float | Float[ndarray, " m"] = 1.0,
) -> Refined:
    """The corners with some of them refined once more, from where they are foreseen; cornerSubPix went astray
    there.

    Args:
        grey: (h,w) uint8.
        fine: all of them.
        start: (m,2) pixels, of those that are sought.
        places, arm: as for `refined`.
        which: those that are sought.
    """
    rough = np.where(which[:, None], start, fine.pixels)
    square, some = nearest_neighbour(rough, places), np.flatnonzero(which)
    asked = _Asked(fine.usual.shrink, approach=False, arm=arm, usual=fine.usual)
    return fine.with_others(some, _refined(grey, rough, places, square, some, asked))


class _Asked(NamedTuple):
    """How corners are refined: see `refined`; and what is usual, where it is known already."""

    shrink: int
    approach: bool
    arm: float | ndarray
    usual: Usual | None


def _refined(
    grey: ndarray,
    rough: Float[ndarray, "m 2"],
    places: Float[ndarray, "m 2"],
    square: Float[ndarray, " m"],
    some: Int[ndarray, " k"],
    asked: _Asked,
) -> Refined:
    """Those corners whose numbers are in `some`, of all that make the lattice."""
    shrink, usual = asked.shrink, asked.usual
    first, part = _surroundings(grey, rough[some], square.max())
    small = _reduced(part, shrink)
    near = (rough - first + 0.5) / shrink - 0.5
    step = square / shrink
    near = _near(small, near, step) if asked.approach else near
    all_shape = grid_shape(near, places)
    shape, near, step = all_shape.of(some), near[some], step[some]
    arm = asked.arm[some] if isinstance(asked.arm, ndarray) else asked.arm
    bends = np.stack([shape.bend_along, shape.bend_down], axis=1)
    windows = _Windows(_window(shape.along), _window(shape.down), bends, _arms(shape, arm))
    smooth = cv2.GaussianBlur(small, (0, 0), SMOOTHING_SIGMA)
    noise = usual.noise if usual else NOISE_LEFT_SHARE * _noise_of(grey, small, shrink)
    saddles = fit_saddles(
        smooth,
        near,
        windows.along,
        windows.down,
        bends=windows.bends,
        arms=windows.arms,
        noise=noise,
        usual=(usual.blur, usual.contrast) if usual else None,
    )
    allowed = np.maximum(FARTHEST_SHARE * step, 1.0)
    signal = SADDLE_MEAN_SQUARE * saddles.contrast**2
    noise_share = noise / np.maximum(signal + noise, 1e-9)
    least = LEAST_SADDLE_SHARE * (1.0 - noise_share)
    believed = (np.hypot(*(saddles.places - near).T) < allowed) & (saddles.explained > least)
    sure = believed & (saddles.spread * shrink < WIDEST_SPREAD)
    sure &= _are_clear(saddles, step, arm)
    if not (sure & (_turn(saddles, shape) < WIDEST_TURN)).all():  # what is off was perhaps not near yet
        places_now = (rough - first + 0.5) / shrink - 0.5
        places_now[some] = saddles.places
        shape = grid_shape(places_now, places).of(some)
    left = 1.0 - saddles.explained - noise_share
    usual = usual or Usual(
        shrink, noise, median(saddles.blur), median(np.abs(saddles.contrast)), median(left)
    )
    left -= usual.left
    plain = left <= HARDLY_UNEXPLAINED + HARDLY_UNEXPLAINED_NOISE * noise_share
    whole = _are_whole(smooth, saddles, windows, ~plain, left, noise=noise, noise_share=noise_share)
    pixels = (np.where(believed[:, None], saddles.places, near) + 0.5) * shrink - 0.5 + first
    sure &= (_turn(saddles, shape) < WIDEST_TURN) & (
        np.abs(saddles.contrast) > LEAST_CONTRAST_SHARE * usual.contrast
    )
    spread = saddles.spread * shrink
    return Refined(pixels, believed, saddles.explained, sure, whole, spread, plain, saddles.contrast, usual)


class _Windows(NamedTuple):
    """The windows of n corners: see `fit_saddles`."""

    along: Float[ndarray, "n 2"]
    down: Float[ndarray, "n 2"]
    bends: Float[ndarray, "n 2"]
    arms: Float[ndarray, " n"]


def _are_whole(
    smooth: ndarray,
    saddles: Saddles,
    windows: _Windows,
    doubtful: Bool[ndarray, " n"],
    left: Float[ndarray, " n"],
    *,
    noise: float,
    noise_share: Float[ndarray, " n"],
) -> Bool[ndarray, " n"]:
    """Which saddles nothing covers: of those that are doubtful the arms are asked, and where these agree the
    saddle's place is set to what they say, too.
    """
    whole, some = ~doubtful, np.flatnonzero(doubtful)
    if not len(some):
        return whole
    along, down, bends, arms = (part[some] for part in windows)
    few = Saddles(*(part[some] for part in saddles))
    told = saddle_arms(smooth, few, along, down, bends=bends, arms=arms, noise=noise)
    most_left = np.where(arms < 1.0, MOST_UNEXPLAINED_BY_MARKS, MOST_UNEXPLAINED)
    little = left[some] < most_left + MOST_UNEXPLAINED_NOISE * noise_share[some]
    whole[some] = _have_whole_arms(told, little)
    unlike = (arms >= 1.0) & (told.spread < SMALL_ARM_SPREAD).all(1)
    saddles.places[some[unlike]] = told.places[unlike]
    return whole


def _noise_of(grey: ndarray, small: ndarray, shrink: int) -> float:
    """The variance of a reduced part's noise: small squares have few even parts, the whole picture may have
    none.
    """
    return min(noise_variance(small), noise_variance(grey) / shrink**2)


def _have_whole_arms(told: SaddleArms, little: Bool[ndarray, " n"]) -> Bool[ndarray, " n"]:
    """Which saddles have arms that agree; or whose noise hides it, and which leave little else."""
    shifts = np.abs(told.shifts)
    agree = ((shifts < MOST_ARM_SHIFT) & (told.spread < SMALL_ARM_SPREAD)).all(1)
    differ = (shifts > np.maximum(MOST_ARM_SHIFT, MOST_ARM_SPREADS * told.spread)).any(1)
    return (agree | little) & ~differ & (told.steps > LEAST_ARM_STEP_SHARE).all(1)


def _turn(saddles: Saddles, shape: GridShape) -> Float[ndarray, " m"]:
    """How far each saddle's edges are turned from the lattice's lines at most, radians."""
    lines = np.stack([shape.along, shape.down], axis=1)
    turn = saddles.angles - np.arctan2(lines[..., 1], lines[..., 0])
    return np.abs((turn + 0.5 * np.pi) % np.pi - 0.5 * np.pi).max(1)


def _are_clear(
    saddles: Saddles, step: Float[ndarray, " m"], arm: float | Float[ndarray, " m"]
) -> Bool[ndarray, " m"]:
    """Which saddles have no blurred mark beside them: what is printed on one side only draws them there."""
    if isinstance(arm, float):
        return np.ones(len(step), dtype=bool)
    return (arm >= 1.0) | (arm * step > CLEAR_BLURS * saddles.blur)


def _surroundings(
    grey: ndarray, corners: Float[ndarray, "m 2"], margin: float
) -> tuple[Float[ndarray, " 2"], ndarray]:
    """The part of a picture that holds the corners with a margin, and where it begins (x, y)."""
    x, y = np.maximum(np.floor(corners.min(0) - margin), 0).astype(int)
    right, bottom = np.maximum(np.ceil(corners.max(0) + margin), (x, y)).astype(int) + 1
    return np.array([x, y], dtype=float), grey[y:bottom, x:right]


def _reduced(grey: ndarray, shrink: int) -> ndarray:
    """The picture with each block of shrink x shrink pixels averaged."""
    if shrink == 1:
        return grey
    height, width = (side // shrink for side in grey.shape)
    return cv2.resize(
        grey[: height * shrink, : width * shrink], (width, height), interpolation=cv2.INTER_AREA
    )


def _near(grey: ndarray, corners: Float[ndarray, "m 2"], step: Float[ndarray, " m"]) -> ndarray:
    """cornerSubPix with a window that suits each corner's own squares."""
    radius = np.clip(np.rint(NEAR_SHARE * step), 2, LARGEST_REACH).astype(int)
    places = np.clip(corners, 0, np.array(grey.shape[::-1]) - 1).astype(np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-2)
    for size in distinct(radius):
        which = radius == size
        some = np.ascontiguousarray(places[which]).reshape(-1, 1, 2)
        places[which] = cv2.cornerSubPix(grey, some, (int(size), int(size)), (-1, -1), criteria).reshape(
            -1, 2
        )
    return places.astype(float)


def _arms(shape: GridShape, arm: float | Float[ndarray, " m"]) -> Float[ndarray, " m"]:
    """An arm of so many steps as a share of each corner's window; 1 where it reaches over it."""
    longest = np.maximum(np.maximum(np.hypot(*shape.along.T), np.hypot(*shape.down.T)), 1e-9)
    return np.minimum(ARM_SHARE * arm / np.minimum(WINDOW_SHARE, LARGEST_REACH / longest), 1.0)


def _window(square: Float[ndarray, "m 2"]) -> Float[ndarray, "m 2"]:
    """From a corner to the side of its window, given one square."""
    return square * np.minimum(WINDOW_SHARE, LARGEST_REACH / np.maximum(np.hypot(*square.T), 1e-9))[:, None]
