"""Methods and lenses side by side: the error of each, and what each loses against the best.

Both axes are logarithmic where errors differ by more than WIDE_RATIO; that of the losses is then linear up to
where losses matter.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from orthoscope.evaluation.comparison.compare import Comparison, Standing
from orthoscope.report.figures.style import BLUE, GREY, INK, ORANGE, named, note, styled

__all__ = ["comparison_errors"]

# The figure is as wide as the page's two columns, inches.
FIGURE_WIDTH = 11.9
# Each entry takes so many inches.
ENTRY_HEIGHT = 0.36
# Titles and axes take so many inches.
HEIGHT_AROUND = 1.1
# Axes are logarithmic where errors differ by more than this factor.
WIDE_RATIO = 4.0
# Bars reach as far as so many standard errors: what they leave out is hardly chance.
BAR_ERRORS = 2.0
# Losses below this share of the best's error are drawn to scale.
LINEAR_SHARE = 0.2


@styled
def comparison_errors(comparison: Comparison) -> Figure:
    """Left, rms px per point on photographs held out and on those used, best on top; right, the loss against
    the best, paired by view.
    """
    standings = comparison.standings
    figure = Figure(figsize=(FIGURE_WIDTH, HEIGHT_AROUND + ENTRY_HEIGHT * max(len(standings), 3)))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    _errors(left, comparison)
    _losses(right, comparison)
    left.set_yticks(range(len(standings)), [named(standing.entry.name) for standing in standings])
    left.set_ylim(max(len(standings), 1) - 0.4, -0.6)
    for axes in (left, right):
        axes.grid(axis="x")
        axes.tick_params(axis="y", length=0)
    for row, standing in enumerate(standings):
        if not np.isfinite(standing.held_out_px):
            place = {"transform": left.get_yaxis_transform(), "va": "center", "color": GREY}
            left.text(0.01, row, "no camera" if standing.camera is None else "not in every view", **place)
    return figure


def _errors(axes: Axes, comparison: Comparison) -> None:
    axes.set_xlabel("error (px per point)")
    if not (judged := _rows(comparison)):
        note(axes, "nobody could be judged")
        return
    rows, standings = zip(*judged, strict=True)
    held_out, used = (
        np.array([getattr(standing, of) for standing in standings]) for of in ("held_out_px", "rms_px")
    )
    bars = BAR_ERRORS * np.nan_to_num([standing.error_px for standing in standings])
    axes.scatter(used, rows, s=26, color=BLUE, label="on photographs that were used", zorder=5)
    marks = {"fmt": "o", "color": ORANGE, "ms": 5.5, "lw": 1.4, "label": "held out, ± 2 standard errors"}
    axes.errorbar(held_out, rows, xerr=np.minimum(bars, 0.9 * held_out), **marks, zorder=4)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2, handletextpad=0.4)
    _scale(axes, float(held_out.min()), float(held_out.max()))


def _scale(axes: Axes, least: float, most: float) -> None:
    if least > 0 and most > WIDE_RATIO * least:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_xlim(left=0.0)


def _losses(axes: Axes, comparison: Comparison) -> None:
    axes.set_xlabel("loses against the best (px)")
    if not (judged := _rows(comparison)):
        return
    rows, standings = zip(*judged, strict=True)
    losses = np.array([standing.loses_px for standing in standings])
    bars = BAR_ERRORS * np.nan_to_num([standing.loses_error_px for standing in standings])
    best = standings[0].held_out_px
    if best > 0 and losses.max() > WIDE_RATIO * LINEAR_SHARE * best:
        axes.set_xscale("symlog", linthresh=LINEAR_SHARE * best, linscale=1.0)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.axvline(0.0, color=GREY, lw=0.9, zorder=1)
    axes.errorbar(losses, rows, xerr=bars, fmt="o", color=INK, ms=4.5, lw=1.2, zorder=3)
    axes.set_title("± 2 standard errors of the difference, paired by view", loc="left", fontsize=7.5)


def _rows(comparison: Comparison) -> list[tuple[int, Standing]]:
    """Those with an error, and in which row they stand."""
    return [
        (row, standing)
        for row, standing in enumerate(comparison.standings)
        if np.isfinite(standing.held_out_px)
    ]
