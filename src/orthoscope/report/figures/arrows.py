"""Arrows that are true to scale: magnified by a round number, with a key that says by how much.

The unit of the axes is that of the arrows: pixels over a photograph, millimetres over a target.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from orthoscope.geometry.arrays import ndarray
from orthoscope.report.figures.style import INK

__all__ = ["draw_key", "frame_key", "round_below", "round_magnification", "true_to_scale"]


def round_magnification(size: ndarray, diagonal: float, *, share: float) -> float:
    """A round number that draws a long arrow (the ninth in ten) at about `share` of the diagonal.

    Args:
        size: of the arrows, in the diagonal's unit.
    """
    typical = float(np.quantile(size, 0.9))
    return round_below(share * diagonal / typical) if typical > 1e-12 else 1.0


def round_below(value: float) -> float:
    """The largest of ..., 1, 2, 5, 10, 20, ... not above value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(m * power for m in (1.0, 2.0, 5.0) if m * power <= value * (1 + 1e-12)))


def true_to_scale(magnification: float) -> dict[str, Any]:
    """What makes quiver draw vectors in the unit of the axes, in their directions."""
    return {"angles": "xy", "scale_units": "xy", "scale": 1.0 / magnification, "pivot": "tail"}


def frame_key(axes: Axes, image_size: tuple[int, int], magnification: float, words: str) -> None:
    """The scale above a photograph's frame, pixels."""
    width, height = image_size
    diagonal = float(np.hypot(width, height))
    draw_key(
        axes,
        (0.01 * width, -0.035 * height),
        diagonal,
        magnification,
        f"{{:g}} px   ({words}, magnified {magnification:g} times)",
    )


def draw_key(
    axes: Axes, place: tuple[float, float], diagonal: float, magnification: float, words: str
) -> None:
    """An arrow of a round length, up to a tenth of the diagonal, at a place, and beside it the words with
    that length in them.

    Not by `quiverkey`, which before matplotlib 3.9 draws as many arrows as the figure has.
    """
    x, y = place
    length = round_below(0.1 * diagonal / magnification)
    axes.quiver(
        [x], [y], [length], [0.0], color=INK, width=0.003, clip_on=False, **true_to_scale(magnification)
    )
    axes.text(x + magnification * length + 0.012 * diagonal, y, words.format(length), va="center")
