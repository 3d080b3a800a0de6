"""The target, face on: its corners, millimetres, and how far each is from where it is said to be.

Drawn as the camera sees it, x to the right and y down; arrows are displacements in the plane, colours those
out of it, along the target's z, so positive away from the camera.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.report.figures.arrows import draw_key, round_magnification, true_to_scale
from orthoscope.report.figures.style import COLUMN_WIDTH, GREY, INK, note, styled
from orthoscope.report.shape import corners_seen

__all__ = ["target_misfit", "target_shape"]

# Around the corners this share of the board's diagonal is left.
DRAWN_MARGIN_SHARE = 0.09
# A long arrow has this share of the diagonal.
LONG_ARROW_SHARE = 0.07


@styled
def target_misfit(evaluation: Evaluation) -> Figure:
    """Where the corners seem to be against where they are said to be, as far as views agree on it; mm, and px
    in the key.
    """
    misfit = evaluation.misfit.target
    points = evaluation.calibration.detections.target.points
    if np.isnan(misfit.test.f):
        return _empty_board(points, "too few views to tell")
    if not np.nanmax(np.abs(misfit.displacements), initial=0.0) > 0.0:
        return _empty_board(points, "the views agree on nothing: only noise")
    return _displaced(points, misfit.displacements, misfit.pixels_per_metre)


@styled
def target_shape(calibration: Calibration) -> Figure:
    """The shape that was estimated for the target: heights as a map, displacements in the plane as arrows;
    mm.
    """
    points, displacements = calibration.detections.target.points, calibration.target_shape.displacements
    seen = corners_seen(calibration)
    return _displaced(points, np.where(seen[:, None], displacements, np.nan), float("nan"), filled=True)


def _displaced(
    points: ndarray, displacements: ndarray, pixels_per_metre: float, *, filled: bool = False
) -> Figure:
    """The corners with their displacements (NaN: left out); `filled` also paints the heights between them."""
    figure, axes, diagonal = _board(points)
    seen = np.isfinite(displacements).all(1)
    places, moved = 1e3 * points[seen], 1e3 * displacements[seen]
    if not len(places):
        note(axes, "no corner was seen")
        return figure
    top = max(float(np.abs(moved[:, 2]).max()), 1e-9)
    heights: dict[str, Any] = {"cmap": "PuOr", "vmin": -top, "vmax": top}
    if filled:
        axes.tricontourf(
            Triangulation(*places[:, :2].T), moved[:, 2], levels=np.linspace(-top, top, 15), **heights
        )
    dots = axes.scatter(
        *places[:, :2].T, c=moved[:, 2], s=_dot(places), edgecolor=GREY, linewidth=0.3, **heights
    )
    figure.colorbar(
        dots, ax=axes, label="out of the plane, away from the camera (mm)", pad=0.02, shrink=0.9, aspect=32
    )
    magnification = round_magnification(np.hypot(*moved[:, :2].T), diagonal, share=LONG_ARROW_SHARE)
    axes.quiver(
        *places[:, :2].T, *moved[:, :2].T, color=INK, width=0.0026, zorder=3, **true_to_scale(magnification)
    )
    key = axes.get_xlim()[0] + 0.01 * diagonal, axes.get_ylim()[1] - 0.035 * diagonal
    draw_key(axes, key, diagonal, magnification, _key_words(magnification, pixels_per_metre))
    return figure


def _key_words(magnification: float, pixels_per_metre: float) -> str:
    scale = f"; 1 mm is {1e-3 * pixels_per_metre:.2g} px" if np.isfinite(pixels_per_metre) else ""
    return f"{{:g}} mm   (in the plane, magnified {magnification:g} times{scale})"


def _dot(places: Float[ndarray, "n 3"]) -> float:
    """The area of a dot, points squared: smaller where there are many."""
    return float(np.clip(9000.0 / len(places), 8.0, 90.0))


def _empty_board(points: ndarray, words: str) -> Figure:
    figure, axes, _ = _board(points)
    axes.scatter(*(1e3 * points[:, :2]).T, s=6, color="#D5D9DE", linewidth=0)
    note(axes, words)
    return figure


def _board(points: Float[ndarray, "m 3"]) -> tuple[Figure, Axes, float]:
    """A figure of column width whose axes are the target's plane, and the diagonal of the board,
    millimetres.
    """
    plane = 1e3 * points[:, :2]
    low, high = plane.min(0), plane.max(0)
    diagonal = max(float(np.hypot(*(high - low))), 1e-9)
    low, high = low - DRAWN_MARGIN_SHARE * diagonal, high + DRAWN_MARGIN_SHARE * diagonal
    tall = min(max((COLUMN_WIDTH - 1.1) * (high - low)[1] / (high - low)[0], 2.2), 5.2)
    figure = Figure(figsize=(COLUMN_WIDTH, tall + 0.75))
    axes = figure.add_subplot()
    axes.set(
        xlim=(low[0], high[0]),
        ylim=(high[1], low[1]),
        aspect="equal",
        xlabel="x on the target (mm)",
        ylabel="y on the target (mm)",
    )
    axes.spines[:].set_visible(True)
    return figure, axes, diagonal
