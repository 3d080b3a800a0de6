"""NCE of every entry, on training or on test data.

Data in, Figure out, in the report's style. The paper's three are thick, with their standard error as a
band; ours are thin, each with dashes and a marker of its own; the page's legend tells them apart. Errors span
from rounding noise to tens of pixels, so the axis is logarithmic, and linear below LINEAR_NCE.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from orthoscope.geometry.arrays import ndarray
from orthoscope.paper.curves import Curve, Curves
from orthoscope.paper.entries import FCCM, MLDC, NMLDC
from orthoscope.report.figures.style import BLUE, GREY, INK, ORANGE, RED, SKY, note, styled

__all__ = ["Look", "looks", "nce_figure"]

# The axis is linear below this NCE; no one needs to see less than 0.004 px.
LINEAR_NCE = 0.01
PAPER_LOOK = {FCCM: (BLUE, "o"), NMLDC: (ORANGE, "s"), MLDC: (RED, "^")}
# Colour, marker and dashes of ours: the rest of Okabe and Ito's colours, and the paper's for other
# readings of its methods. No two have the colour and one of the others in common.
OUR_LOOKS: tuple[tuple[str, str, tuple[float, ...]], ...] = (
    (RED, "v", (5, 1.5)),
    ("#CC79A7", "P", (1, 1.5)),
    (ORANGE, "D", (5, 1.5)),
    (SKY, "X", (5, 1.5)),
    (BLUE, "*", (3, 1, 1, 1)),
    ("#009E73", "h", (3, 1, 1, 1)),
    (INK, "d", (1, 1)),
    ("#8A5A00", ">", (7, 2)),
    ("#7A5195", "<", (4, 1, 1, 1, 1, 1)),
    (GREY, "p", (2, 2)),
)


class Look(NamedTuple):
    """How a curve is drawn.

    Attributes:
        name: of the curve.
        colour: of line and marker.
        marker: as matplotlib has it.
        dashes: on and off in turn, in widths of the line; None for a whole line.
        thick: whether it is one of the paper's.
    """

    name: str
    colour: str
    marker: str
    dashes: tuple[float, ...] | None
    thick: bool


# A figure has this width, inches: that of a telephone's screen, where it stands alone.
FIGURE_WIDTH = 3.3
# The smallest text has so many points.
TEXT_SIZE = 9.0


@styled
def nce_figure(
    curves: Curves, *, of: str, title: str, level: str, even: bool = False, height: float = 3.6
) -> Figure:
    """One kind of NCE against the level.

    Args:
        curves: to draw; axes span all their errors, so that figures of other kinds compare.
        of: a number of `Curve`, such as `test_nce`.
        title: what it is an error of.
        level: the axis's words, with unit.
        even: levels at equal distances, whatever they are.
        height: inches.
    """
    figure = Figure(figsize=(FIGURE_WIDTH, height))
    axes = figure.subplots()
    levels = np.unique(np.concatenate([curve.levels for curve in curves.values()])) if curves else np.empty(0)
    axes.set_title(title, loc="left", fontweight="bold", fontsize=TEXT_SIZE)
    axes.set_xlabel(level, fontsize=TEXT_SIZE)
    axes.tick_params(labelsize=TEXT_SIZE)
    axes.grid()
    for look in looks(tuple(curves)):
        curve = curves[look.name]
        _draw(axes, curve, getattr(curve, of), levels, look, even=even, band=of == "test_nce")
    if not any(np.isfinite(getattr(curve, of)).any() for curve in curves.values()):
        note(axes, "no method gave a camera")
    if even:
        axes.set_xticks(range(len(levels)), [f"{level:g}" for level in levels])
    _errors_axis(axes, curves)
    return figure


def looks(names: tuple[str, ...]) -> list[Look]:
    """How each curve is drawn: the paper's thick and whole, the others dashed, with a marker of their own."""
    ours = iter(OUR_LOOKS * (1 + len(names) // len(OUR_LOOKS)))
    return [
        Look(name, *PAPER_LOOK[name], None, True) if name in PAPER_LOOK else Look(name, *next(ours), False)
        for name in names
    ]


def _draw(
    axes: Axes, curve: Curve, nce: ndarray, levels: ndarray, look: Look, *, even: bool, band: bool
) -> None:
    x = np.searchsorted(levels, curve.levels) if even else curve.levels
    if band and look.thick:
        low, high = nce - curve.test_error, nce + curve.test_error
        axes.fill_between(x, low, high, color=look.colour, alpha=0.18, linewidth=0)
    axes.plot(
        x,
        nce,
        color=look.colour,
        lw=1.8 if look.thick else 1.1,
        ls=(0, look.dashes) if look.dashes else "-",
        marker=look.marker,
        ms=4.5 if look.thick else 4.0,
        label=curve.name,
        zorder=3 if look.thick else 2.5,
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
    axes.axhline(1.0, color=GREY, lw=0.9, ls=(0, (1, 2)), zorder=1)
