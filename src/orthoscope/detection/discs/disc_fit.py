"""Discs to a few thousandths of a pixel: a blurred ellipse is fitted to the grey values about each outline.

The outline is x = c + A u, |u| = 1, A symmetric. With d the distance from it, positive outside, the picture
is

    I(x) = m + C tanh(d / w) + (1 + r tanh(d / w)) g.(x - c),      r = C / m

m grey, C half the step (of white discs negative), w blur, g uneven light. Moving c or A by dc, dA moves the
outline along its normal n by n.(dc + dA u); Gauss-Newton on these and on log w, with m, C and g beside them.
All pixels near an outline take part, which no threshold and no number of rays gives. What the model lacks (a
lens's own blur, sharpening, blur as wide as the disc) lies alike on opposite sides and moves no centre.

A slope of light and a moved disc look half alike: left free, the light makes the centre a seventh worse than
noise must. But light changes evenly over a picture, and all discs together tell it; with that, and with how
much single discs differ from it beyond their noise, each takes its last steps.

Where a disc is hardly wider than the blur, blur, contrast and size look alike, too: blur and contrast are
held to those of the larger discs, and the outline to what all foresee, as far as noise hides them.

How far the outline of each sector lies from the ellipse says what covers a disc.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.discs.disc_evenness import FEWEST_EVEN, even_shapes, even_values, in_a_row
from orthoscope.detection.discs.disc_pixels import OUTER_RADII, SPARE_REACH, Pixels
from orthoscope.geometry.arrays import Float, Int, median, ndarray
from orthoscope.geometry.ellipses import Ellipses

__all__ = ["FittedDiscs", "fit_discs"]

# Larger discs are reduced to about this radius, pixels.
USUAL_RADIUS = 24.0
# A step moves the outline by less than this, pixels, when it has arrived; it has at most so many.
STILL_PX, MOST_STEPS = 0.02, 8
# When it has moved by less than this, pixels, the light of all discs is asked; with it, it has at most so
# many more steps.
NEARLY_STILL_PX, LIT_STEPS = 0.1, 4
# How much the light of single discs differs from that of all is known to no better than this share of its
# noise.
LEAST_LIGHT_SHARE = 0.3
# A step is at most this share of the shorter half axis.
LARGEST_STEP_SHARE = 0.25
# The blur from which all begin, and the least and most of it, pixels and shares of the shorter half axis.
FIRST_BLUR, LEAST_BLUR, MOST_BLUR_SHARE = 1.0, 0.6, 1.0
# Pixels take part up to so many blurs from the outline, and one more pixel.
REACH_BLURS = 2.5
# Each column's own square is raised by this share of it.
DAMPING = np.array([1e-4] * 6 + [1e-6] * 4)
# So many discs tell the blur from which all begin, by so many steps.
BLUR_DISCS, BLUR_STEPS = 4, 3
# Blur and contrast of a disc differ from those of the larger ones by about this share.
USUAL_SPREAD = 0.15
# A disc's half axes differ from what all outlines foresee by about this share.
SHAPE_SPREAD = 0.15
# Half the step from inside to outside is at least so many grey levels.
LEAST_HALF_STEP = 1.0
# An outline has so many sectors.
SECTORS = 12
# A step has so many columns: centre 2, axes 3, blur, half step, grey, light 2, and the picture.
COLUMN_COUNT = 11
# So many pixels of all discs are done together.
PIXELS_AT_ONCE = 30_000


class FittedDiscs(NamedTuple):
    """What was fitted to n discs.

    Attributes:
        ellipses: their outlines.
        off: (n,12) how far the picture's outline is outside the ellipse in each sector, pixels.
        spread: (n,12) the standard deviation of that by noise, pixels.
        blur: (n,) w, pixels.
        centre_spread: (n,) standard deviation of a centre by noise, pixels.
        rest: (n,) rms of what the fit leaves of the picture, in half steps from inside to outside.
    """

    ellipses: Ellipses
    off: Float[ndarray, "n 12"]
    spread: Float[ndarray, "n 12"]
    blur: Float[ndarray, " n"]
    centre_spread: Float[ndarray, " n"]
    rest: Float[ndarray, " n"]


def fit_discs(grey: ndarray, rough: Ellipses) -> FittedDiscs:
    """Blurred ellipses about outlines that are right to a few pixels.

    Args:
        grey: (h,w) uint8.
        rough: the outlines.
    """
    count = len(rough.centres)
    if not count:
        none = np.zeros((0, SECTORS))
        return FittedDiscs(rough, none, none, *np.zeros((3, 0)))
    shrink = max(1, round(median(np.sqrt(np.abs(np.linalg.det(rough.axes)))) / USUAL_RADIUS))
    first, part = _surroundings(grey, rough)
    height, width = (side // shrink for side in part.shape)
    small = part[: height * shrink, : width * shrink]
    small = cv2.resize(small, (width, height), interpolation=cv2.INTER_AREA) if shrink > 1 else small
    fit = _Fit(small, (rough.centres - first + 0.5) / shrink - 0.5, rough.axes / shrink)
    fit.settle()
    centres = (fit.centres + 0.5) * shrink - 0.5 + first
    outlines = Ellipses(centres, fit.axes * shrink)
    lengths = fit.off, fit.off_spread, fit.blur, fit.centre_spread
    rest = np.sqrt(fit.noise) / np.abs(fit.step)
    return FittedDiscs(outlines, *(length * shrink for length in lengths), rest)


def _surroundings(grey: ndarray, discs: Ellipses) -> tuple[Int[ndarray, " 2"], ndarray]:
    """The part of a picture that holds the discs, and where it begins (x, y)."""
    reach = OUTER_RADII * np.linalg.norm(discs.axes, axis=2) + 4.0
    low = np.maximum(np.floor((discs.centres - reach).min(0)), 0).astype(int)
    high = np.maximum(np.ceil((discs.centres + reach).max(0)).astype(int) + 1, low + 1)
    return low, grey[low[1] : high[1], low[0] : high[0]]


class _Fit:
    """All discs of a picture on their way.

    light: (n,2) uneven light as a share of the grey a pixel, as all discs have it, known to `light_spread`.
    """

    def __init__(self, grey: ndarray, centres: ndarray, axes: ndarray) -> None:
        self.centres, self.axes = centres.copy(), axes.copy()
        count = len(centres)
        self.half = np.abs(np.linalg.eigvalsh(axes)).min(1)
        self.blur = np.minimum(np.full(count, FIRST_BLUR), self._most_blur())
        self.relief, self.noise, self.centre_spread = np.zeros((3, count))
        self.off, self.off_spread = np.zeros((2, count, SECTORS))
        self.level, self.step = np.ones((2, count))
        self.shape = even_shapes(centres, axes)
        self.usual_blur, self.usual_relief, self.hold = FIRST_BLUR, 0.0, 0.0
        self.light, self.light_spread = np.zeros((count, 2)), np.inf
        self.seen_light, self.seen_light_spread = np.zeros((2, count, 2))
        self.by_size = np.argsort(np.linalg.norm(axes, axis=(1, 2)), kind="stable")
        few = self.by_size[-BLUR_DISCS:]
        self._settle(self._batches(grey, few, np.inf), BLUR_STEPS, STILL_PX, seeing=False)
        self._hold_to(few)
        self.blur[:] = np.minimum(self.usual_blur, self._most_blur())
        reach = SPARE_REACH * (REACH_BLURS * float(median(self.blur)) + 1.0)
        self.batches = self._batches(grey, self.by_size, reach)

    def _batches(
        self, grey: ndarray, which: Int[ndarray, " k"], reach: float
    ) -> list[tuple[ndarray, Pixels]]:
        """Some discs, a few of one size at once, and the pixels within a reach of their outlines."""
        pixels = max(min(reach, float(median(self.half))) * 2.0 * np.pi * float(median(self.half)), 1.0)
        at_once = max(1, int(PIXELS_AT_ONCE / (2.0 * pixels)))
        parts = (which[start : start + at_once] for start in range(0, len(which), at_once))
        return [(some, Pixels(grey, self.centres, self.axes, some, reach)) for some in parts]

    def _hold_to(self, discs: Int[ndarray, " k"]) -> None:
        """From now on no disc's blur and contrast differ much from those of most of these."""
        self.usual_blur, self.usual_relief = (median(each[discs]) for each in (self.blur, self.relief))
        self.hold = 1.0

    def _most_blur(self) -> Float[ndarray, " n"]:
        return np.maximum(MOST_BLUR_SHARE * self.half, LEAST_BLUR)

    def settle(self) -> None:
        """Steps until each outline has moved by less than `NEARLY_STILL_PX`, or has had its steps; then with
        the light that all discs have until it has moved by less than `STILL_PX`.
        """
        self.relief[:] = self.usual_relief
        self._settle(self.batches, MOST_STEPS, NEARLY_STILL_PX, seeing=False)
        if len(self.centres) >= FEWEST_EVEN:
            self._share_light()
            self._hold_to(self.by_size[len(self.by_size) // 2 :])
        self._settle(self.batches, LIT_STEPS, STILL_PX, seeing=True)

    def _settle(
        self, batches: list[tuple[ndarray, Pixels]], most_steps: int, still: float, *, seeing: bool
    ) -> None:
        """Steps until each outline has moved by less than `still`, or has had its steps; with `seeing` what
        the last one leaves says how far each sector is off.
        """
        for some, pixels in batches:
            rows = np.arange(len(some))
            for number in range(most_steps):
                moved, *left = self._step(some[rows], pixels, rows)
                done = (moved <= still) | (number == most_steps - 1)
                if seeing:
                    self._see_sectors(some[rows[done]], *(part[done] for part in left))
                rows = rows[~done]
                if not len(rows):
                    break

    def _share_light(self) -> None:
        """Uneven light that changes evenly over the picture, through that of all discs; and how much theirs
        differs from it beyond noise.
        """
        self.light = even_values(self.centres, self.seen_light)
        noise = median(self.seen_light_spread.ravel())
        scatter = median(np.abs(self.seen_light - self.light).ravel()) / 0.6745
        self.light_spread = float(np.sqrt(max(scatter**2 - noise**2, (LEAST_LIGHT_SHARE * noise) ** 2)))

    def _step(
        self, here: ndarray, pixels: Pixels, rows: ndarray
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, "n k"], Float[ndarray, "n k"], Float[ndarray, "n 2 k"]]:
        """One step of these discs: how far each moved, pixels; what it leaves of the picture; of each pixel
        by how much it tells where the outline is; and where it is from the middle.
        """
        columns, slope, out = self._columns(here, pixels, rows)
        solution, spread, left = self._solved(here, columns)
        step = self.step[here]
        self.level[here] = level = np.maximum(pixels.level[rows] + solution[:, 7], 1.0)
        self.seen_light[here], self.seen_light_spread[here] = (
            each[:, 8:] / level[:, None] for each in (solution, spread)
        )
        self.relief[here] = np.clip(solution[:, 6] / level, -1.0, 1.0)
        self.centre_spread[here] = spread[:, :2].max(1) / np.abs(step) * self.blur[here]
        limit = LARGEST_STEP_SHARE * self.half[here, None]
        moved = np.clip(solution[:, :5] / step[:, None] * self.blur[here, None], -limit, limit)
        self.centres[here] += moved[:, :2]
        self.axes[here] += moved[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
        change = np.clip(solution[:, 5] / step, -0.5, 0.5)
        self.blur[here] = np.clip(self.blur[here] * np.exp(-change), LEAST_BLUR, self._most_blur()[here])
        return np.abs(moved).max(1), left, slope, out

    def _solved(
        self, here: ndarray, columns: Float[ndarray, "n 11 k"]
    ) -> tuple[Float[ndarray, "n 10"], Float[ndarray, "n 10"], Float[ndarray, "n k"]]:
        """The least squares solution of each disc, held to the light that is known, its standard deviations,
        and what it leaves of the picture.
        """
        sums = (columns[:, :-1] @ columns.transpose(0, 2, 1)).astype(float)
        normal, right = sums[:, :, :-1], sums[:, :, -1]
        alone = np.linalg.solve(normal[:, 6:, 6:] + 1e-6 * np.eye(4), right[:, 6:, None])[:, 0, 0]
        step = self.step[here] = np.where(
            np.abs(alone) > LEAST_HALF_STEP, alone, np.copysign(LEAST_HALF_STEP, alone)
        )
        held = self.noise[here, None] / np.maximum(self.light_spread * self.level[here, None], 1e-9) ** 2
        damping = DAMPING * np.einsum("npp->np", normal) + 1e-6
        usual = self.usual_relief * self.level[here]
        like = self.hold * self.noise[here] / np.maximum(USUAL_SPREAD * np.abs(usual), 1e-9) ** 2
        damping[:, 5:7] += like[:, None]
        right[:, 5] += like * usual * np.log(self.blur[here] / self.usual_blur)
        right[:, 6] += like * usual
        per_px = step / self.blur[here]
        shaped = self.noise[here] / (per_px * SHAPE_SPREAD * self.half[here]) ** 2
        damping[:, 2:5] += shaped[:, None]
        right[:, 2:5] += (shaped * per_px)[:, None] * in_a_row(self.shape[here] - self.axes[here])
        damping[:, 8:] += held
        right[:, 8:] += held * self.light[here] * self.level[here, None]
        inverse = np.linalg.inv(normal + np.eye(10) * damping[:, None])
        solution = (inverse @ right[:, :, None])[:, :, 0]
        left = _left(columns, solution)
        self.noise[here] = (left**2).sum(1) / np.maximum(normal[:, 7, 7] - 10.0, 1.0)
        return solution, np.sqrt(np.einsum("npp->np", inverse) * self.noise[here, None]), left

    def _see_sectors(
        self, here: ndarray, left: Float[ndarray, "n k"], slope: Float[ndarray, "n k"], out: ndarray
    ) -> None:
        """How far the outline is outside the ellipse in each sector, by what a step leaves, and the standard
        deviation of that by noise, pixels.

        Args:
            here: the discs.
            left: of the picture.
            slope: by how much a pixel tells of that.
            out: (n,2,k) from the middle.
        """
        turn = np.arctan2(out[:, 1], out[:, 0]) * np.float32(SECTORS / (2.0 * np.pi))
        number = np.floor(turn).astype(int) % SECTORS + SECTORS * np.arange(len(here))[:, None]
        total, square = (
            np.bincount(number.ravel(), each.ravel(), SECTORS * len(here)).reshape(-1, SECTORS)
            for each in (left * slope, slope * slope)
        )
        scale = (self.blur[here] / self.step[here])[:, None]
        self.off[here] = -scale * total / np.maximum(square, 1e-9)
        self.off_spread[here] = np.abs(scale) * np.sqrt(self.noise[here, None] / np.maximum(square, 1e-9))

    def _columns(
        self, here: ndarray, pixels: Pixels, rows: ndarray
    ) -> tuple[Float[ndarray, "n 11 k"], Float[ndarray, "n k"], Float[ndarray, "n 2 k"]]:
        """The columns of a step, the picture last; and of each pixel its slope and where it is from the
        middle, in the disc's frame.
        """
        inverse, blur = np.linalg.inv(self.axes[here]), self.blur[here, None].astype(np.float32)
        offset = (self.centres[here] - pixels.middle[rows]).astype(np.float32).T[:, :, None]
        x, y = pixels.offsets[:, None] - offset
        (a, b), (_, d) = inverse.astype(np.float32).transpose(1, 2, 0)[..., None]
        out = np.stack([a * x + b * y, b * x + d * y], axis=1)
        u, v = out[:, 0], out[:, 1]
        radius = np.maximum(_length(u, v), np.float32(1e-6))
        out /= radius[:, None]
        across, down = a * u + b * v, b * u + d * v
        steep = np.maximum(_length(across, down), np.float32(1e-9))  # of the radius
        away = (radius - 1.0) / (steep * blur)
        columns = np.empty((len(rows), COLUMN_COUNT, x.shape[1]), dtype=np.float32)
        weight = np.clip(1.0 + (REACH_BLURS - np.abs(away)) * blur, 0.0, 1.0, out=columns[:, 7])
        weight *= (radius < OUTER_RADII) & pixels.inside[rows]
        edge = np.tanh(away)
        slope = (1.0 - edge * edge) * weight
        normal = slope / -steep
        across = np.multiply(across, normal, out=columns[:, 0])
        down = np.multiply(down, normal, out=columns[:, 1])
        np.multiply(across, u, out=columns[:, 2])
        np.add(across * v, down * u, out=columns[:, 3])
        np.multiply(down, v, out=columns[:, 4])
        np.multiply(slope, away, out=columns[:, 5])
        np.multiply(edge, weight, out=columns[:, 6])
        lit = weight + self.relief[here, None].astype(np.float32) * columns[:, 6]
        np.multiply(lit, x, out=columns[:, 8])
        np.multiply(lit, y, out=columns[:, 9])
        np.multiply(pixels.values[rows], weight, out=columns[:, 10])
        return columns, slope, out


def _length(x: ndarray, y: ndarray) -> ndarray:
    """Of vectors; several times as quick as numpy's own, which also takes the largest numbers."""
    return np.sqrt(x * x + y * y)


def _left(columns: Float[ndarray, "n 11 k"], solution: Float[ndarray, "n 10"]) -> Float[ndarray, "n k"]:
    """What a step's columns leave of the picture."""
    return columns[:, -1] - (solution[:, None].astype(np.float32) @ columns[:, :-1])[:, 0]
