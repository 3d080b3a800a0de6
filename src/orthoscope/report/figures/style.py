"""How every figure looks: palette, type, the image frame as axes, and the way to SVG.

Figures are made with matplotlib's objects alone (no pyplot, no current figure). Settings hold only while a
figure is drawn or saved and start from matplotlib's defaults, so that a user's matplotlibrc neither changes a
figure nor is changed. Colours: M. Okabe and K. Ito, Color universal design, 2002; maps: cividis and viridis,
which keep their order for colour-blind readers and in grey print.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec

from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orthoscope.files.printable import printable

__all__ = [
    "BLUE",
    "DENSE_MARKS",
    "GREY",
    "INK",
    "ORANGE",
    "RED",
    "SKY",
    "frame_axes",
    "frame_figure",
    "named",
    "note",
    "styled",
    "to_svg",
]

BLUE, SKY, ORANGE, RED, GREY, INK = "#0072B2", "#56B4E9", "#E69F00", "#D55E00", "#8A9199", "#20262D"
# Places without data have this colour.
EMPTY_COLOUR = "#F1F2F4"

# More marks than this are drawn as an image inside the SVG, which keeps the page small.
DENSE_MARKS = 1500
# Marks that are drawn as an image have so many dots an inch.
IMAGE_DPI = 180
# A column of the page is so many inches wide.
COLUMN_WIDTH = 5.8

STYLE = {
    "figure.constrained_layout.use": True,
    "figure.facecolor": "white",
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#A7AEB6",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "text.color": INK,
    "grid.color": "#E4E7EB",
    "grid.linewidth": 0.6,
    "xtick.color": "#A7AEB6",
    "ytick.color": "#A7AEB6",
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "axes3d.xaxis.panecolor": "white",
    "axes3d.yaxis.panecolor": "white",
    "axes3d.zaxis.panecolor": "white",
    "hatch.linewidth": 0.6,
    "image.cmap": "cividis",
    "svg.fonttype": "none",  # text stays text: it can be searched, and takes the page's typeface
    "svg.hashsalt": "orthoscope",  # ids in the SVG are hashes; without a salt of our own they are random
}

P = ParamSpec("P")


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """The figure function, drawn in the project's style and leaving matplotlib's settings as they were."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with style.context(["default", STYLE]):
            return draw(*args, **kwargs)

    return drawn


def frame_figure(image_size: tuple[int, int]) -> tuple[Figure, Axes]:
    """A figure of column width whose axes are the photograph's frame, pixels, y down."""
    width, height = image_size
    tall = min(max((COLUMN_WIDTH - 1.1) * height / width, 2.2), 5.2)
    figure = Figure(figsize=(COLUMN_WIDTH, tall + 0.75))
    axes = figure.add_subplot()
    frame_axes(axes, image_size)
    return figure, axes


def frame_axes(axes: Axes, image_size: tuple[int, int]) -> None:
    """Axes that show the whole photograph, to the outer edges of its pixels."""
    width, height = image_size
    axes.set(
        xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal", xlabel="x (px)", ylabel="y (px)"
    )
    axes.spines[:].set_visible(True)


def note(axes: Axes, text: str) -> None:
    """A sentence in the middle of axes that have nothing to show."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY)


def named(text: str) -> str:
    """A name out of a file as matplotlib's texts take it: no formula, nothing that cannot be seen."""
    return printable(text).replace("$", r"\$")


def to_svg(figure: Figure, name: str) -> str:
    """The figure as an SVG element to be put into a page; its ids begin with `name`, so that two figures do
    not share any.

    The same figure gives the same text: no dates, no random ids. Text names the family `var(--sans)`, which
    the page defines.
    """
    buffer = io.StringIO()
    with style.context(["default", STYLE]):
        figure.savefig(
            buffer, format="svg", dpi=IMAGE_DPI, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type"))
        )
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :].replace("'DejaVu Sans'", "var(--sans)")
    svg = re.sub(r"<style.*?</style>", "", svg, count=1, flags=re.DOTALL)  # it would hold for the whole page
    return re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", svg)
