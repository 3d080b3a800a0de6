"""Blurred saddles, fitted to the picture around each corner of a chessboard; many corners at once.

Two edges cross at the corner c, along the directions a1 and a2 (angles t1, t2), with normals n1 and n2. The
picture is

    I(x) = m + g.x + (C + r g.x) S,      S = tanh(D1) tanh(D2),
    D_i = +-(n_i.(x - c) - k_i (a_i.(x - c))^2 / 2) / w

m grey, C contrast (positive where the square between +a1 and +a2 is the bright one: D2 takes the sign -), w
blur. g is uneven light: it makes contrast uneven as it does grey, and as much of it, r = C / m; left out,
that moves a corner by a thousandth of its window. The curvatures k_i are given: without them a window on a
bent edge sees its middle beside the corner. tanh stands for the error function, whose shape it has to within
what a lens's blur differs from a Gaussian, and its slope is 1 - tanh^2. A pixel's weight falls from 1 at the
corner to 0 at the side of a window in the board's own directions; the window follows the corner, so that
whatever the model lacks (sharpening, white that bleeds into black) is seen symmetrically and moves nothing.

Gauss-Newton on c, t1, t2 and log w. m, g and C are linear: each step finds them anew beside C times the step,
so that they need no start. A few corners tell the blur from which all begin. The first steps look at the
inner half of a window, a quarter of its pixels; to the whole, one or two are left, and a corner that has
arrived takes no part in the next.

A window may have fewer pixels than a saddle has unknowns, and then leaves nothing, whatever the noise. Once
the inner halves have told what is usual, contrast, blur and the edges' directions are held to it as far as
noise hides them, and no window is believed to have less noise than the picture.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.detection.reused_arrays import ReusedArrays
from orthoscope.detection.saddles.saddle_windows import COLUMN_COUNT, Shapes, Windows
from orthoscope.geometry.arrays import Float, median, ndarray

__all__ = ["Saddles", "fit_saddles", "in_pixels"]

# A stage has a share of the window, and pixels: a corner that moves less has arrived (what is left is its
# square).
STAGES = (
    (0.5, 0.05),
    (1.0, 0.01),
)
# Each stage has at most so many steps.
STAGE_STEPS = 8
# Half the smallest window that is only a share of one is this, pixels.
LEAST_HALF_WINDOW = 6.0
# So many corners tell the blur.
BLUR_CORNERS = 12
# A blur is at least a pixel's own width: a sharpened edge is steeper, and without a floor the steps then jump
# from pixel to pixel.
LEAST_BLUR_PX = 0.75
# A step of x, y (px), t1, t2 (radians) and log w is at most this.
LARGEST_STEP = np.array([1.0, 1.0, 0.2, 0.2, 0.5])
# Each column's own square is raised by this share of it; light changes little in a window.
DAMPING = np.array([1e-3] * 5 + [1e-6] * 2 + [0.03] * 2)
# Light makes a window's side usually brighter than its middle by this share of the contrast; where noise is
# strong, more than that is taken for noise.
USUAL_LIGHT = 0.02
# Contrast and blur of a saddle differ from the usual by about these shares, and its edges from the lattice's
# lines by about so many radians; what noise hides is taken for usual.
USUAL_CONTRAST_SPREAD, USUAL_BLUR_SPREAD, USUAL_TURN = 0.3, 0.3, 0.15
# So many pixels of all windows are done together, so that the arrays stay in cache.
PIXELS_AT_ONCE = 80_000
# Of the windows of one batch, whose next begins when it is done.
ARRAYS = ReusedArrays()


class Saddles(NamedTuple):
    """What was fitted.

    Attributes:
        places: (n,2) pixels.
        angles: (n,2) of the two edges, radians.
        blur: (n,) w, pixels.
        contrast: (n,) C, grey levels.
        explained: (n,) share of the window's variance that the saddle explains.
        spread: (n,) standard deviation of a place in its worst direction, pixels, by what is not explained.
    """

    places: Float[ndarray, "n 2"]
    angles: Float[ndarray, "n 2"]
    blur: Float[ndarray, " n"]
    contrast: Float[ndarray, " n"]
    explained: Float[ndarray, " n"]
    spread: Float[ndarray, " n"]


def fit_saddles(
    grey: ndarray,
    start: Float[ndarray, "n 2"],
    along: Float[ndarray, "n 2"],
    down: Float[ndarray, "n 2"],
    *,
    bends: Float[ndarray, "n 2"],
    arms: Float[ndarray, " n"] | None = None,
    noise: float = 0.0,
    usual: tuple[float, float] | None = None,
) -> Saddles:
    """The saddles near `start`.

    Where the steps do not settle the last place is given, with what it explains.

    Args:
        grey: (h,w) uint8.
        along, down: from a corner to the sides of its window, pixels, in the directions of its two edges.
        bends: curvature of the two edges, 1/px.
        arms: (n,) how far from the edges, as a share of the window, its corners are left out, where something
            else is printed.
        noise: variance of the picture's, grey levels squared: a window of a few pixels, which the saddle
            follows wherever they go, leaves less than there is.
        usual: blur, pixels, and contrast, grey levels, of the picture's saddles, where they are known; these
            tell them otherwise.
    """
    fit = _Fit(grey, start, along, down, bends, np.ones(len(start)) if arms is None else arms, noise)
    if usual is None:
        fit.begin_with_one_blur()
    else:
        fit.shapes.blur[:] = usual[0]
        fit.usual = usual
    for share, still in STAGES:
        fit.settle(fit.by_size, share, still)
        fit.usual = usual or (median(fit.shapes.blur), median(np.abs(fit.contrast)))
    shapes = fit.shapes
    return Saddles(shapes.places, shapes.angles, shapes.blur, fit.contrast, fit.explained, fit.spread())


class _Fit:
    """All corners of a picture on their way; by_size: their order, windows of one size together; usual: blur
    and contrast of most, once they are known.
    """

    def __init__(
        self,
        grey: ndarray,
        start: ndarray,
        along: ndarray,
        down: ndarray,
        bends: ndarray,
        arms: ndarray,
        noise: float,
    ) -> None:
        self.arms, self.least_noise = arms, noise
        self.usual: tuple[float, float] | None = None
        self.grey, self.along, self.down = grey, along, down
        angles = np.stack([np.arctan2(along[:, 1], along[:, 0]), np.arctan2(down[:, 1], down[:, 0])], axis=1)
        self.lines = angles.copy()
        self.shapes = Shapes(start.astype(float), angles, np.ones(len(start)), bends, np.zeros(len(start)))
        self.contrast, self.explained = np.zeros((2, len(start)))
        self.sums = np.zeros((len(start), COLUMN_COUNT + 1, COLUMN_COUNT + 1))
        self.noise = np.zeros(len(start))
        self.half = np.sqrt(np.maximum(np.maximum((along**2).sum(1), (down**2).sum(1)), 1e-12))
        self.area = 4.0 * np.abs(along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0])
        self.by_size = np.argsort(self.area, kind="stable")

    def begin_with_one_blur(self) -> None:
        """The middle one of a few corners' blurs, for all."""
        few = self.by_size[:: max(1, len(self.by_size) // BLUR_CORNERS)]
        self.settle(few, *STAGES[0])
        self.shapes.blur[:] = median(self.shapes.blur[few])

    def settle(self, which: ndarray, share: float, still: float) -> None:
        """Steps in a share of the window until each corner has moved by less than `still` px, or has had its
        steps.
        """
        side = np.minimum(np.hypot(*self.along.T), np.hypot(*self.down.T))
        shares = np.clip(LEAST_HALF_WINDOW / np.maximum(side, 1e-9), share, 1.0)[:, None]
        at_once = max(1, int(PIXELS_AT_ONCE / max((shares[:, 0] ** 2 * self.area).max(), 1.0)))
        for i in range(0, len(which), at_once):
            some = which[i : i + at_once]
            windows = Windows(
                self.grey,
                self.shapes.places[some],
                shares[some] * self.along[some],
                shares[some] * self.down[some],
                self.arms[some] / shares[some, 0],
                ARRAYS,
            )
            rows = np.arange(len(some))
            for _ in range(STAGE_STEPS):
                moved = self._step(
                    some[rows], windows.sums(rows, self.shapes.of(some[rows])), windows.level[rows]
                )
                rows = rows[moved > still]
                if not len(rows):
                    break

    def _step(
        self, here: ndarray, sums: Float[ndarray, "n 10 10"], level: Float[ndarray, " n"]
    ) -> Float[ndarray, " n"]:
        """One step of these corners; how far each moved, px."""
        shapes = self.shapes
        self.sums[here] = sums
        damping, towards = self._held(here, sums)
        solution, self.explained[here], self.noise[here] = _solved(sums, damping, towards)
        contrast = self.contrast[here] = solution[:, 5]
        step = in_pixels(
            solution[:, :5] / np.where(np.abs(contrast) < 1e-9, 1e-9, contrast)[:, None], shapes.of(here)
        )
        step = np.minimum(np.maximum(step, -LARGEST_STEP), LARGEST_STEP)
        shapes.places[here] += step[:, :2]
        shapes.angles[here] += step[:, 2:4]
        shapes.blur[here] = np.maximum(shapes.blur[here] * np.exp(step[:, 4]), LEAST_BLUR_PX)
        shapes.relief[here] = np.clip(contrast / np.maximum(level + solution[:, 6], 1.0), -1.0, 1.0)
        return np.abs(step[:, :2]).max(1)

    def _held(
        self, here: ndarray, sums: Float[ndarray, "n 10 10"]
    ) -> tuple[Float[ndarray, "n 9"], Float[ndarray, "n 9"]]:
        """What is added to the diagonal of the sums and to their right side: what noise makes of a window is
        not believed to be light beyond `USUAL_LIGHT`, nor contrast and blur that are not usual.
        """
        damping = DAMPING * np.einsum("npp->np", sums[:, :-1, :-1]) + 1e-6
        towards = np.zeros_like(damping)
        contrast = self.contrast[here]
        light = USUAL_LIGHT * np.abs(contrast) / self.half[here]
        damping[:, 7:] += (self.noise[here] / np.maximum(light**2, 1e-9))[:, None]
        if self.usual:
            blur, usual = self.usual
            noise, signed = np.maximum(self.noise[here], self.least_noise), np.copysign(usual, contrast)
            of_blur = noise / max(USUAL_BLUR_SPREAD * usual, 1e-9) ** 2
            of_contrast = noise / max(USUAL_CONTRAST_SPREAD * usual, 1e-9) ** 2
            of_turn = noise / max(USUAL_TURN * usual, 1e-9) ** 2
            turned = self.shapes.angles[here] - self.lines[here]
            damping[:, 2:4] += of_turn[:, None]
            towards[:, 2:4] = (of_turn * contrast)[:, None] * turned * [1.0, -1.0]
            damping[:, 4] += of_blur
            damping[:, 5] += of_contrast
            towards[:, 4] = of_blur * contrast * np.log(self.shapes.blur[here] / blur)
            towards[:, 5] = of_contrast * signed
        return damping, towards

    def spread(self) -> Float[ndarray, " n"]:
        """The standard deviation of each corner in its worst direction, pixels, from the last step's sums."""
        every = np.arange(len(self.contrast))
        damped = self.sums[:, :-1, :-1] + np.eye(COLUMN_COUNT) * self._held(every, self.sums)[0][:, None]
        scale = np.maximum(self.noise, self.least_noise) / np.maximum(self.contrast**2, 1e-9)
        of_columns = np.linalg.solve(damped, np.eye(COLUMN_COUNT)[:, :2])[:, :2] * scale[:, None, None]
        blur = np.maximum(self.shapes.blur, self.usual[0] if self.usual else 0.0)
        bends = self.shapes.bends
        shapes = Shapes(self.shapes.places, self.shapes.angles, blur, bends, self.shapes.relief)
        units = np.broadcast_to(np.eye(5)[:2], (len(blur), 2, 5))
        turned = np.stack([in_pixels(units[:, i], shapes)[:, :2] for i in (0, 1)], axis=2)
        variances = np.linalg.eigvalsh(turned @ of_columns @ turned.transpose(0, 2, 1))
        return np.sqrt(np.maximum(variances[:, -1], 0.0))


def _solved(
    sums: Float[ndarray, "n 10 10"], damping: Float[ndarray, "n 9"], towards: Float[ndarray, "n 9"]
) -> tuple[Float[ndarray, "n 9"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """The damped least squares solution in each window, the share of its variance that this explains, and
    the variance that it leaves.
    """
    normal, right, square = sums[:, :-1, :-1], sums[:, :-1, -1], sums[:, -1, -1]
    damped = normal + np.eye(COLUMN_COUNT) * damping[:, None]
    solution = np.linalg.solve(damped, (right + towards)[:, :, None])[:, :, 0]
    left = square - (solution * (2.0 * right - (normal @ solution[:, :, None])[:, :, 0])).sum(1)
    weight = np.maximum(normal[:, 6, 6], 1e-9)
    variance = square - right[:, 6] ** 2 / weight
    return solution, 1.0 - left / np.maximum(variance, 1e-9), left / np.maximum(weight, 1.0)


def in_pixels(column_steps: Float[ndarray, "n 5"], shapes: Shapes) -> Float[ndarray, "n 5"]:
    """The step of x, y, t1, t2 and log w that makes such multiples of the first five columns."""
    f1, f2, turn1, turn2, blurring = column_steps.T
    (c1, c2), (s1, s2) = np.cos(shapes.angles).T, np.sin(shapes.angles).T
    area = s1 * c2 - c1 * s2
    scale = shapes.blur / np.where(np.abs(area) < 0.01, 0.01, area)
    x, y = scale * (c2 * f1 + c1 * f2), scale * (s2 * f1 + s1 * f2)
    along1, along2 = c1 * x + s1 * y, c2 * x + s2 * y
    return np.stack(
        [x, y, shapes.bends[:, 0] * along1 - turn1, shapes.bends[:, 1] * along2 + turn2, -blurring], axis=1
    )
