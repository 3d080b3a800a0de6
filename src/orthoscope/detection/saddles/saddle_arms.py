"""The four arms of a saddle, each on its own: do they agree about where the corner is?

From a corner four edges run outwards, the arms; two make an edge of the saddle. Something that covers a part
of a window, a finger, moves or ends some of them, and the saddle is a compromise; glare or a stain inside a
square leaves much unexplained and moves none. So the picture is explained once more,

    I(x) = sum_q L_q Q_q(x) + sum_k J_k (s_k + t_k A_k(x)) E_k(x) + h B(x) + g.x

Q_q the four squares, blurred, each with a grey L_q of its own; E_k what moving arm k changes, s_k its shift
at the corner and t_k its turn, both in blurs, J_k half of the step across it, which the greys tell; B what
blur does; g light. First with the two arms of an edge moving together, which is the saddle with squares that
need not be alike: glare in one of them moves it no more. Then each alone. Ink that bled, or a camera that
sharpens, moves all arms towards the dark, or all towards the bright: that moves no corner and is taken off.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.detection.reused_arrays import ReusedArrays
from orthoscope.detection.saddles.saddle import Saddles, in_pixels
from orthoscope.detection.saddles.saddle_windows import ARM_COUNT, Shapes, Windows
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["SaddleArms", "saddle_arms"]

# So many windows are done together.
WINDOWS_AT_ONCE = 48
# Of the windows of one batch.
ARRAYS = ReusedArrays()
# Each column's own square is raised by this share of it: of the squares, the arms' shifts, turns and the
# blur, and the light, which changes little in a window.
DAMPING = np.array([1e-6] * 4 + [1e-3] * (2 * ARM_COUNT + 1) + [0.03] * 2)
DAMPING_TOGETHER = np.array([1e-6] * 4 + [1e-3] * (ARM_COUNT + 1) + [0.03] * 2)
# Light makes a window's side brighter than its middle by about this share of the contrast.
USUAL_LIGHT = 0.02
# An arm's step counts as at least this share of the saddle's.
LEAST_STEP_SHARE = 0.1
# From the greys of the squares ++, +-, -+ and -- (the sides of both edges) to the half steps across the arms.
HALF_STEPS = 0.5 * np.array([[1, 0, -1, 0], [0, 1, 0, -1], [1, -1, 0, 0], [0, 0, 1, -1]])
# The signs of these where the saddle's contrast is positive.
SIGNS = np.array([1.0, -1.0, 1.0, -1.0])


# From the columns of the saddle whose squares are not alike to those of single arms; ones that stand for the
# half steps across arms are put in.
TOGETHER = np.zeros((4 + 2 * ARM_COUNT + 3, 11))
TOGETHER[[0, 1, 2, 3, 12, 13, 14], [0, 1, 2, 3, 8, 9, 10]] = 1.0
# Rows and columns of these: shifts of arms to those of edges, turns likewise.
OF_ARMS = np.array([[4, 5, 6, 7], [8, 9, 10, 11]]), np.array([[4, 4, 5, 5], [6, 6, 7, 7]])
# The saddle whose squares are not alike takes so many steps, of at most so many pixels and radians.
STEPS, LARGEST_STEP = 2, 0.5


class SaddleArms(NamedTuple):
    """The arms of n saddles: of the first edge the two that lie along the second, one way and the other; of
    the second edge likewise.

    Attributes:
        places: (n,2) pixels, of the saddles with squares that need not be alike.
        shifts: (n,4) pixels by which the corner would move if each arm alone told where its edge is.
        spread: (n,4) their standard deviations.
        steps: (n,4) the step across each as a share of the saddle's.
    """

    places: Float[ndarray, "n 2"]
    shifts: Float[ndarray, "n 4"]
    spread: Float[ndarray, "n 4"]
    steps: Float[ndarray, "n 4"]


def saddle_arms(
    grey: ndarray,
    saddles: Saddles,
    along: Float[ndarray, "n 2"],
    down: Float[ndarray, "n 2"],
    *,
    bends: Float[ndarray, "n 2"],
    arms: Float[ndarray, " n"],
    noise: float,
) -> SaddleArms:
    """What each arm of the saddles says.

    Args:
        grey: (h,w) uint8, the picture that they were fitted to.
        along, down: from a corner to the sides of its window, pixels.
        bends: curvature of the two edges, 1/px.
        arms: (n,) how far from the edges, as a share of the window, its corners are left out.
        noise: variance of the picture's, grey levels squared, the least that a window is believed to have.
    """
    shapes = Shapes(saddles.places.copy(), saddles.angles.copy(), saddles.blur, bends, np.zeros(len(arms)))
    half = np.sqrt(np.maximum((along**2).sum(1), (down**2).sum(1)))
    light = np.maximum(USUAL_LIGHT * np.abs(saddles.contrast) / half, 1e-9)
    shifts, spread, steps = np.full((3, len(arms), ARM_COUNT), np.nan)
    order = np.argsort(half, kind="stable")
    for first in range(0, len(order), WINDOWS_AT_ONCE):
        some = order[first : first + WINDOWS_AT_ONCE]
        every, contrast = np.arange(len(some)), saddles.contrast[some]
        windows = Windows(grey, shapes.places[some], along[some], down[some], arms[some], ARRAYS)
        for step in range(STEPS):
            sums = windows.arm_sums(every, shapes.of(some))
            if not step:
                shifts[some], spread[some], steps[some] = _arms_moved(sums, contrast, light[some], noise)
            moved = in_pixels(_edges_moved(sums, contrast, light[some]), shapes.of(some))
            moved = np.clip(moved, -LARGEST_STEP, LARGEST_STEP)
            shapes.places[some] += moved[:, :2]
            shapes.angles[some] += moved[:, 2:4]
    sines = np.maximum(np.abs(np.sin(shapes.angles[:, 1] - shapes.angles[:, 0])), 0.01)
    scale = (saddles.blur / sines)[:, None]
    signs = SIGNS * np.where(saddles.contrast < 0, -1.0, 1.0)[:, None]
    bled = (shifts * signs).mean(1, keepdims=True)
    return SaddleArms(shapes.places, (shifts - bled * signs) * scale, spread * scale, steps)


def _edges_moved(
    sums: Float[ndarray, "n 16 16"], contrast: Float[ndarray, " n"], light: Float[ndarray, " n"]
) -> Float[ndarray, "n 5"]:
    """Shifts and turns of the two edges, in blurs, and 0 for the blur, as `in_pixels` takes them."""
    solution, _, _ = _solved(sums, DAMPING, light)
    steps = _half_steps(solution, contrast)[1]
    together = np.tile(TOGETHER, (len(sums), 1, 1))
    together[:, *OF_ARMS] = steps[:, None]
    whole = np.zeros((len(sums), together.shape[2] + 1, together.shape[1] + 1))
    whole[:, :-1, :-1], whole[:, -1, -1] = together.transpose(0, 2, 1), 1.0
    solution, _, _ = _solved(whole @ sums @ whole.transpose(0, 2, 1), DAMPING_TOGETHER, light)
    return np.concatenate([solution[:, 4:8], np.zeros((len(sums), 1))], axis=1)


def _arms_moved(
    sums: Float[ndarray, "n 16 16"], contrast: Float[ndarray, " n"], light: Float[ndarray, " n"], least: float
) -> tuple[Float[ndarray, "n 4"], Float[ndarray, "n 4"], Float[ndarray, "n 4"]]:
    """Shifts of arms, in blurs, their standard deviations and the steps across them as shares."""
    solution, inverse, noise = _solved(sums, DAMPING, light)
    shares, steps = _half_steps(solution, contrast)
    arms = slice(4, 4 + ARM_COUNT)
    normal = sums[:, :-1, :-1]
    variances = np.einsum("npq,nqr,nrp->np", inverse, normal, inverse)[:, arms]
    variances *= np.maximum(noise, least)[:, None]
    return solution[:, arms] / steps, np.sqrt(np.maximum(variances, 0.0)) / np.abs(steps), shares


def _solved(
    sums: Float[ndarray, "n p1 p1"], damping: Float[ndarray, " p"], light: Float[ndarray, " n"]
) -> tuple[Float[ndarray, "n p"], Float[ndarray, "n p p"], Float[ndarray, " n"]]:
    """The damped least squares solution in each window, the inverse and the variance that is left; what noise
    makes of a window is not believed to be light.
    """
    normal, right, square = sums[:, :-1, :-1], sums[:, :-1, -1:], sums[:, -1, -1]
    weight = np.maximum(normal[:, :4, :4].sum((1, 2)), 1e-9)  # the four squares together are 1
    added = damping * np.einsum("npp->np", normal) + 1e-6
    solution, inverse, noise = right, normal, np.zeros(len(sums))
    for _ in range(2):
        added[:, -2:] += (noise / light**2)[:, None]
        inverse = np.linalg.inv(normal + np.eye(len(damping)) * added[:, None])
        solution = inverse @ right
        left = square - (solution * (2.0 * right - normal @ solution)).sum((1, 2))
        noise = np.maximum(left, 0.0) / weight
    return solution[:, :, 0], inverse, noise


def _half_steps(
    solution: Float[ndarray, "n p"], contrast: Float[ndarray, " n"]
) -> tuple[Float[ndarray, "n 4"], Float[ndarray, "n 4"]]:
    """Half of the step across each arm: as a share of what the saddle's contrast makes it, and in grey
    levels.
    """
    usual = SIGNS * np.where(np.abs(contrast) < 1e-9, 1e-9, contrast)[:, None]
    shares = solution[:, :4] @ HALF_STEPS.T / usual
    return shares, np.where(np.abs(shares) < LEAST_STEP_SHARE, LEAST_STEP_SHARE, shares) * usual
