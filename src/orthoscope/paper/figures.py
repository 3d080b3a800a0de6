"""NCE of every entry, on training and on test data side by side.

Data in, Figure out, in the report's style. The paper's three are thick, with their standard error as a band;
ours are thin, each with dashes and a marker of its own. Errors span from rounding noise to tens of pixels, so
the axis is logarithmic, and linear below LINEAR_NCE.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from orthoscope.geometry.arrays import ndarray
from orthoscope.paper.curves import Curve, Curves
from orthoscope.paper.entries import FCCM, MLDC, NMLDC
from orthoscope.report.figures.style import BLUE, GREY, INK, ORANGE, RED, SKY, note, styled

__all__ = ["nce_figure"]

# The axis is linear below this NCE; no one needs to see less than 0.004 px.
LINEAR_NCE = 0.01
PAPER_LOOK = {FCCM: (BLUE, "o"), NMLDC: (ORANGE, "s"), MLDC: (RED, "^")}
# Colour (the rest of Okabe and Ito's, and the paper's again for readings of its methods), dashes and marker
# of ours.
OUR_LOOKS = (
    (RED, (0, (5, 1.5)), "v"),
    ("#CC79A7", (0, (1, 1.5)), "P"),
    (ORANGE, (0, (5, 1.5)), "D"),
    (SKY, (0, (5, 1.5)), "X"),
    (BLUE, (0, (5, 1.5)), "*"),
    ("#009E73", (0, (3, 1, 1, 1)), ""),
    (INK, (0, (1, 1)), ""),
)
# A figure has this width, inches.
FIGURE_WIDTH = 7.4
# The smallest text has so many points.
TEXT_SIZE = 9.0


@styled
def nce_figure(curves: Curves, *, level: str, even: bool = False, height: float = 4.0) -> Figure:
    """Training and test NCE against the level.

    Args:
        level: the axis's words, with unit.
        even: levels at equal distances, whatever they are.
        height: inches.
    """
    figure = Figure(figsize=(FIGURE_WIDTH, height))
    left, right = figure.subplots(1, 2, sharey=True)
    levels = np.unique(np.concatenate([curve.levels for curve in curves.values()])) if curves else np.empty(0)
    ours = iter(OUR_LOOKS * (1 + len(curves) // len(OUR_LOOKS)))
    looks = {
        name: (PAPER_LOOK[name][0], "-", PAPER_LOOK[name][1]) if name in PAPER_LOOK else next(ours)
        for name in curves
    }
    for axes, title, of in ((left, "training data", "training_nce"), (right, "test data", "test_nce")):
        axes.set_title(title, loc="left", fontweight="bold", fontsize=TEXT_SIZE)
        axes.set_xlabel(level, fontsize=TEXT_SIZE)
        axes.tick_params(labelsize=TEXT_SIZE)
        axes.grid()
        for name, curve in curves.items():
            _draw(axes, curve, getattr(curve, of), levels, *looks[name], even=even, band=of == "test_nce")
        if not any(np.isfinite(getattr(curve, of)).any() for curve in curves.values()):
            note(axes, "no method gave a camera")
        if even:
            axes.set_xticks(range(len(levels)), [f"{level:g}" for level in levels])
    _errors_axis(left, curves)
    if curves:
        figure.legend(
            *left.get_legend_handles_labels(),
            loc="outside upper left",
            ncols=4,
            fontsize=TEXT_SIZE,
            handlelength=2.2,
            columnspacing=1.4,
        )
    return figure


def _draw(
    axes: Axes,
    curve: Curve,
    nce: ndarray,
    levels: ndarray,
    colour: str,
    dashes: Any,
    marker: str,
    *,
    even: bool,
    band: bool,
) -> None:
    x = np.searchsorted(levels, curve.levels) if even else curve.levels
    thick = curve.name in PAPER_LOOK
    if band and thick:
        axes.fill_between(
            x, nce - curve.test_error, nce + curve.test_error, color=colour, alpha=0.18, linewidth=0
        )
    axes.plot(
        x,
        nce,
        color=colour,
        lw=1.8 if thick else 1.1,
        ls=dashes,
        marker=marker or None,
        ms=4.5 if thick else 4.0,
        label=curve.name,
        zorder=3 if thick else 2.5,
    )


def _errors_axis(axes: Axes, curves: Curves) -> None:
    """NCE upwards, logarithmic above LINEAR_NCE; a line where rounding to whole pixels is."""
    errors = np.concatenate(
        [np.concatenate([curve.training_nce, curve.test_nce]) for curve in curves.values()] or [np.empty(0)]
    )
    errors = errors[np.isfinite(errors)]
    highest = max(float(errors.max(initial=0.0)), 1.2)
    axes.set_yscale("symlog", linthresh=LINEAR_NCE, linscale=0.6)
    lowest = float(errors.min(initial=1.0))
    axes.set_ylim(0.7 * lowest if lowest > LINEAR_NCE else 0.0, 1.5 * highest)
    axes.set_ylabel("NCE", fontsize=TEXT_SIZE)
    steps = (
        (1.0, 2.0, 5.0) if lowest > 0.03 * highest else (1.0,)
    )  # numbers between the powers of ten where there are few of these
    axes.yaxis.set_major_locator(FixedLocator([0.0, *np.outer(10.0 ** np.arange(-2, 9), steps).ravel()]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for each in axes.figure.axes:
        each.axhline(1.0, color=GREY, lw=0.9, ls=(0, (1, 2)), zorder=1)
        each.annotate(
            "rounding to whole pixels",
            (1.0, 1.0),
            xycoords=("axes fraction", "data"),
            xytext=(-2, 2.5),
            textcoords="offset points",
            ha="right",
            va="bottom",
            fontsize=TEXT_SIZE,
            color=GREY,
        )
