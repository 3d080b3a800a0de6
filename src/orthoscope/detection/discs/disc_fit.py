"""Discs to a few thousandths of a pixel: a blurred ellipse is fitted to the grey values about each outline.

The outline is x = c + A u, |u| = 1, A symmetric. With d the distance from it, positive outside, the picture
is

    I(x) = m + C tanh(d / w) + (1 + r tanh(d / w)) g.(x - c),      r = C / m

m grey, C half the step, w blur, g uneven light. Moving c or A by dc, dA moves the outline along its normal n
by n.(dc + dA u); Gauss-Newton on these and on log w, with m, C and g beside them. All pixels near an outline
take part, which no threshold and no number of rays gives. What the model lacks (a lens's own blur,
sharpening, blur as wide as the disc) lies the same way on opposite sides and moves no centre.

A slope of light and a moved disc look half alike: left free, the light makes the centre a seventh worse than
noise must. But light changes evenly over a picture, and all discs together tell it; with that, and with how
much single discs differ from it beyond their noise, each takes its last step.

Where a disc is hardly wider than the blur, blur, contrast and size look alike, too: blur and contrast are
held to those of the larger discs, as far as noise hides them.

How far the outline of each sector lies from the ellipse says what covers a disc.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, Int, median, ndarray
from orthoscope.geometry.ellipses import Ellipses

__all__ = ["FittedDiscs", "fit_discs"]

# Larger discs are reduced to about this radius, pixels.
USUAL_RADIUS = 24.0
# A step moves the outline by less than this, pixels, when it has arrived; it has at most so many.
STILL_PX, MOST_STEPS = 0.02, 8
# With the light of all discs it has at most so many more.
LIT_STEPS = 2
# How light and outlines change over the picture is a polynomial of this order, of so many discs at least;
# fewer do not tell.
EVEN_ORDERS = (3, 36), (2, 20), (1, 12), (0, 6)
FEWEST_EVEN = EVEN_ORDERS[-1][1]
# How much light differs from that is known to no better than this share of its noise.
LEAST_LIGHT_SHARE = 0.3
# A step is at most this share of the shorter half axis.
LARGEST_STEP_SHARE = 0.25
# The blur from which all begin, and the least and most of it, pixels and shares of the shorter half axis.
FIRST_BLUR, LEAST_BLUR, MOST_BLUR_SHARE = 1.0, 0.6, 1.0
# Pixels take part up to so many blurs from the outline, and one more pixel.
REACH_BLURS = 2.5
# No pixel beyond so many radii takes part: there the next disc may begin.
OUTER_RADII = 1.45
# Each column's own square is raised by this share of it.
DAMPING = np.array([1e-4] * 6 + [1e-6] * 4)
# So many discs tell the blur from which all begin, by so many steps.
BLUR_DISCS, BLUR_STEPS = 4, 3
# So many discs of a size say which pixels are near the outlines of all of them.
LIKE_DISCS = 4
# Blur and contrast of a disc differ from those of the larger ones by about this share.
USUAL_SPREAD = 0.15
# A disc's half axes differ from what all outlines foresee by about this share.
SHAPE_SPREAD = 0.15
# Half the step from inside to outside is at least so many grey levels.
LEAST_HALF_STEP = 1.0
# Pixels that may take part are sought up to so many times as far from the outline as that blur reaches.
SPARE_REACH = 1.5
# Nearer to another disc than this, pixels, a pixel is not asked, where the blur is not known yet or wide.
FIRST_REACH = 4.0
# An outline has so many sectors.
SECTORS = 12
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
    """

    ellipses: Ellipses
    off: Float[ndarray, "n 12"]
    spread: Float[ndarray, "n 12"]
    blur: Float[ndarray, " n"]
    centre_spread: Float[ndarray, " n"]


def fit_discs(grey: ndarray, rough: Ellipses) -> FittedDiscs:
    """Blurred ellipses about outlines that are right to a few pixels.

    Args:
        grey: (h,w) uint8.
        rough: the outlines.
    """
    count = len(rough.centres)
    if not count:
        none = np.zeros((0, SECTORS))
        return FittedDiscs(rough, none, none, np.zeros(0), np.zeros(0))
    shrink = max(1, round(median(np.sqrt(np.abs(np.linalg.det(rough.axes)))) / USUAL_RADIUS))
    first, part = _surroundings(grey, rough)
    height, width = (side // shrink for side in part.shape)
    small = part[: height * shrink, : width * shrink]
    small = cv2.resize(small, (width, height), interpolation=cv2.INTER_AREA) if shrink > 1 else small
    fit = _Fit(small, (rough.centres - first + 0.5) / shrink - 0.5, rough.axes / shrink)
    fit.settle()
    centres = (fit.centres + 0.5) * shrink - 0.5 + first
    off, spread = fit.sectors()
    outlines = Ellipses(centres, fit.axes * shrink)
    return FittedDiscs(outlines, *(part * shrink for part in (off, spread, fit.blur, fit.centre_spread)))


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
        self.level, self.step = np.ones((2, count))
        self.shape = _even_shapes(centres, axes)
        self.usual_blur, self.usual_relief, self.hold = FIRST_BLUR, 0.0, 0.0
        self.light, self.light_spread = np.zeros((count, 2)), np.inf
        self.seen_light, self.seen_light_spread = np.zeros((2, count, 2))
        self.by_size = np.argsort(np.linalg.norm(axes, axis=(1, 2)), kind="stable")
        few = self.by_size[-BLUR_DISCS:]
        self._settle(self._batches(grey, few, np.inf), BLUR_STEPS)
        self._hold_to(few)
        self.blur[:] = np.minimum(self.usual_blur, self._most_blur())
        reach = SPARE_REACH * (REACH_BLURS * float(median(self.blur)) + 1.0)
        self.batches = self._batches(grey, self.by_size, reach)

    def _batches(
        self, grey: ndarray, which: Int[ndarray, " k"], reach: float
    ) -> list[tuple[ndarray, _Pixels]]:
        """Some discs, a few of one size at once, and the pixels within a reach of their outlines."""
        pixels = max(min(reach, float(median(self.half))) * 2.0 * np.pi * float(median(self.half)), 1.0)
        at_once = max(1, int(PIXELS_AT_ONCE / (2.0 * pixels)))
        parts = (which[start : start + at_once] for start in range(0, len(which), at_once))
        return [(some, _Pixels(grey, self.centres, self.axes, some, reach)) for some in parts]

    def _hold_to(self, discs: Int[ndarray, " k"]) -> None:
        """From now on no disc's blur and contrast differ much from those of most of these."""
        self.usual_blur, self.usual_relief = (median(each[discs]) for each in (self.blur, self.relief))
        self.hold = 1.0

    def _most_blur(self) -> Float[ndarray, " n"]:
        return np.maximum(MOST_BLUR_SHARE * self.half, LEAST_BLUR)

    def settle(self) -> None:
        """Steps until each outline has moved by less than `STILL_PX`, or has had its steps; then with the
        light that all discs have.
        """
        self.relief[:] = self.usual_relief
        self._settle(self.batches, MOST_STEPS)
        if len(self.centres) >= FEWEST_EVEN:
            self._share_light()
            self._hold_to(self.by_size[len(self.by_size) // 2 :])
            self._settle(self.batches, LIT_STEPS)

    def _settle(self, batches: list[tuple[ndarray, _Pixels]], most_steps: int) -> None:
        for some, pixels in batches:
            rows = np.arange(len(some))
            for _ in range(most_steps):
                moved = self._step(some[rows], pixels, rows)
                rows = rows[moved > STILL_PX]
                if not len(rows):
                    break

    def _share_light(self) -> None:
        """Uneven light that changes evenly over the picture, through that of all discs; and how much theirs
        differs from it beyond noise.
        """
        self.light = _even(self.centres, self.seen_light)
        noise = median(self.seen_light_spread.ravel())
        scatter = median(np.abs(self.seen_light - self.light).ravel()) / 0.6745
        self.light_spread = float(np.sqrt(max(scatter**2 - noise**2, (LEAST_LIGHT_SHARE * noise) ** 2)))

    def _step(self, here: ndarray, pixels: _Pixels, rows: ndarray) -> Float[ndarray, " n"]:
        """One step of these discs; how far each moved, pixels."""
        columns, *_ = self._columns(here, pixels, rows)
        solution, spread = self._solved(here, columns)
        step = self.step[here]
        self.level[here] = level = np.maximum(pixels.level[rows] + solution[:, 7], 1.0)
        self.seen_light[here], self.seen_light_spread[here] = (
            each[:, 8:] / level[:, None] for each in (solution, spread)
        )
        self.relief[here] = np.clip(solution[:, 6] / level, -1.0, 1.0)
        self.centre_spread[here] = spread[:, :2].max(1) / step * self.blur[here]
        limit = LARGEST_STEP_SHARE * self.half[here, None]
        moved = np.clip(solution[:, :5] / step[:, None] * self.blur[here, None], -limit, limit)
        self.centres[here] += moved[:, :2]
        self.axes[here] += moved[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
        change = np.clip(solution[:, 5] / step, -0.5, 0.5)
        self.blur[here] = np.clip(self.blur[here] * np.exp(-change), LEAST_BLUR, self._most_blur()[here])
        return np.abs(moved).max(1)

    def _solved(
        self, here: ndarray, columns: Float[ndarray, "n 11 k"]
    ) -> tuple[Float[ndarray, "n 10"], Float[ndarray, "n 10"]]:
        """The least squares solution of each disc, held to the light that is known, and its standard
        deviations.
        """
        sums = (columns[:, :-1] @ columns.transpose(0, 2, 1)).astype(float)
        normal, right = sums[:, :, :-1], sums[:, :, -1]
        alone = np.linalg.solve(normal[:, 6:, 6:] + 1e-6 * np.eye(4), right[:, 6:, None])[:, 0, 0]
        step = self.step[here] = np.maximum(np.abs(alone), LEAST_HALF_STEP)
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
        right[:, 2:5] += (shaped * per_px)[:, None] * _three(self.shape[here] - self.axes[here])
        damping[:, 8:] += held
        right[:, 8:] += held * self.light[here] * self.level[here, None]
        inverse = np.linalg.inv(normal + np.eye(10) * damping[:, None])
        solution = (inverse @ right[:, :, None])[:, :, 0]
        left = _left(columns, solution)
        self.noise[here] = (left**2).sum(1) / np.maximum(normal[:, 7, 7] - 10.0, 1.0)
        return solution, np.sqrt(np.einsum("npp->np", inverse) * self.noise[here, None])

    def sectors(self) -> tuple[Float[ndarray, "n 12"], Float[ndarray, "n 12"]]:
        """How far the outline is outside the ellipse in each sector, by what the last step leaves, and the
        standard deviation of that by noise, pixels.
        """
        off, spread = np.zeros((2, len(self.centres), SECTORS))
        for some, pixels in self.batches:
            columns, slope, u, v = self._columns(some, pixels, np.arange(len(some)))
            number = ((np.arctan2(v, u) / (2.0 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS
            solution, _ = self._solved(some, columns)
            left = _left(columns, solution)
            number = (number + SECTORS * np.arange(len(some))[:, None]).ravel()
            total, square = (
                np.bincount(number, each.ravel(), SECTORS * len(some)).reshape(-1, SECTORS)
                for each in (left * slope, slope * slope)
            )
            scale = self.blur[some, None] / np.maximum(np.abs(solution[:, 6:7]), LEAST_HALF_STEP)
            off[some] = -scale * total / np.maximum(square, 1e-9)
            spread[some] = np.abs(scale) * np.sqrt(self.noise[some, None] / np.maximum(square, 1e-9))
        return off, spread

    def _columns(
        self, here: ndarray, pixels: _Pixels, rows: ndarray
    ) -> tuple[Float[ndarray, "n 11 k"], Float[ndarray, "n k"], Float[ndarray, "n k"], Float[ndarray, "n k"]]:
        """The columns of a step, the picture last; and of each pixel its slope and its direction u, v."""
        inverse, blur = np.linalg.inv(self.axes[here]), self.blur[here, None].astype(np.float32)
        offset = (self.centres[here] - pixels.middle[rows]).astype(np.float32).T[:, :, None]
        x, y = pixels.offsets[:, None] - offset
        (a, b), (_, d) = inverse.astype(np.float32).transpose(1, 2, 0)[..., None]
        u, v = a * x + b * y, b * x + d * y
        radius = np.maximum(np.hypot(u, v), np.float32(1e-6))
        u, v = u / radius, v / radius
        across, down = a * u + b * v, b * u + d * v
        steep = np.maximum(np.hypot(across, down), np.float32(1e-9))  # of the radius
        away = (radius - 1.0) / (steep * blur)
        weight = np.clip(1.0 + (REACH_BLURS - np.abs(away)) * blur, 0.0, 1.0)
        weight *= (radius < OUTER_RADII) & pixels.inside[rows]
        edge = np.tanh(away)
        slope = (1.0 - edge * edge) * weight
        lit = weight * (1.0 + self.relief[here, None].astype(np.float32) * edge)
        across, down = across * slope / -steep, down * slope / -steep
        columns = np.stack(
            [
                *(across, down, across * u, across * v + down * u, down * v),
                *(slope * away, edge * weight, weight, lit * x, lit * y),
                pixels.values[rows] * weight,
            ],
            axis=1,
        )
        return columns, slope, u, v


def _three(matrices: Float[ndarray, "n 2 2"]) -> Float[ndarray, "n 3"]:
    """The numbers of symmetric matrices."""
    return matrices[:, [0, 0, 1], [0, 1, 1]]


def _even(places: Float[ndarray, "n 2"], values: Float[ndarray, "n k"]) -> Float[ndarray, "n k"]:
    """Values that change evenly over the picture, through most of these; of few discs these."""
    count = len(places)
    if count < FEWEST_EVEN:
        return values
    x, y = ((places - places.mean(0)) / np.ptp(places, axis=0).max()).T
    order = next(order for order, fewest in EVEN_ORDERS if count >= fewest)
    terms = np.stack([x**i * y**j for i in range(order + 1) for j in range(order + 1 - i)], axis=1)
    good, even = np.ones(count, dtype=bool), values
    for _ in range(2):
        even = terms @ np.linalg.lstsq(terms[good], values[good], rcond=None)[0]
        off = np.linalg.norm(values - even, axis=1)
        good = off <= 3.0 * median(off)
    return even


def _even_shapes(centres: Float[ndarray, "n 2"], axes: Float[ndarray, "n 2 2"]) -> Float[ndarray, "n 2 2"]:
    """The outline of each disc as all foresee it: logarithms change evenly where a board is far and near."""
    values, turns = np.linalg.eigh(axes)
    logarithms = np.einsum("nij,nj,nkj->nik", turns, np.log(values), turns)
    even = _even(centres, _three(logarithms))
    values, turns = np.linalg.eigh(even[:, [0, 1, 1, 2]].reshape(-1, 2, 2))
    return np.einsum("nij,nj,nkj->nik", turns, np.exp(values), turns)


def _left(columns: Float[ndarray, "n 11 k"], solution: Float[ndarray, "n 10"]) -> Float[ndarray, "n k"]:
    """What a step's columns leave of the picture."""
    return columns[:, -1] - (solution[:, None].astype(np.float32) @ columns[:, :-1])[:, 0]


class _Pixels:
    """The pixels about the outlines of n discs: values less their mean, offsets (2,k) from the middle.

    Args:
        grey: (h,w) uint8.
        centres, axes: of all discs.
        some: those n.
        reach: pixels farther from an outline are not asked, nor are those as near to that of another disc.
    """

    def __init__(
        self,
        grey: ndarray,
        centres: Float[ndarray, "m 2"],
        axes: Float[ndarray, "m 2 2"],
        some: Int[ndarray, " n"],
        reach: float,
    ) -> None:
        height, width = grey.shape
        self.middle = np.clip(np.rint(centres[some]).astype(int), 0, (width - 1, height - 1))
        side = int(np.ceil(OUTER_RADII * np.linalg.norm(axes[some], axis=2).max())) + 1
        offsets = np.mgrid[-side : side + 1, -side : side + 1].reshape(2, -1)[::-1].astype(np.float32)
        few = axes[some][:: max(1, len(some) // LIKE_DISCS)]
        radii, away = _distances(np.broadcast_to(offsets, (len(few), *offsets.shape)), few)
        near = ((radii < OUTER_RADII + 0.1) & (np.abs(away) < reach)).any(0)
        self.offsets = offsets[:, near]
        column, row = self.middle.T[:, :, None] + self.offsets.astype(int)[:, None]
        self.inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        values = grey[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)].astype(np.float32)
        self.level = values.mean(1)
        self.values = values - self.level[:, None]
        self._leave_out_others(centres, axes, some, min(reach / SPARE_REACH, FIRST_REACH))

    def _leave_out_others(self, centres: ndarray, axes: ndarray, some: ndarray, reach: float) -> None:
        """Pixels within reach of another disc are not this one's alone."""
        apart = centres - centres[some, None]
        span = np.linalg.norm(np.einsum("nij,nmj->nmi", np.linalg.inv(axes[some]), apart), axis=2)
        half = np.abs(np.linalg.eigvalsh(axes[some])).min(1)
        close = (span < 2.0 + 2.0 * reach / half[:, None]) & (span > 1e-9)
        mine, other = np.nonzero(close)
        if len(mine):
            places = self.offsets + (self.middle[mine] - centres[other])[:, :, None].astype(np.float32)
            theirs = _distances(places, axes[other])[1] < reach
            np.logical_and.at(self.inside, mine, ~theirs)


def _distances(
    offsets: Float[ndarray, "n 2 k"], axes: Float[ndarray, "n 2 2"]
) -> tuple[Float[ndarray, "n k"], Float[ndarray, "n k"]]:
    """Of offsets from the centres of ellipses the radius in each one's frame, and the distance from it along
    the ray, pixels.
    """
    radii = np.linalg.norm(np.linalg.inv(axes).astype(np.float32) @ offsets, axis=1)
    return radii, (radii - 1.0) * np.linalg.norm(offsets, axis=1) / np.maximum(radii, 1e-6)
