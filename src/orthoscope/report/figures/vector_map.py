"""A vector at every place of the frame: its length as colour and contours, its direction as arrows.

The field is a function of pixels, sampled as finely as each of the three needs; NaN where it has no value.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.report.figures.style import EMPTY_COLOUR, note

__all__ = ["vector_map"]

Field = Callable[[Float[ndarray, "n 2"]], Float[ndarray, "n 2"]]


def vector_map(
    figure: Figure, axes: Axes, image_size: tuple[int, int], *, field: Field, label: str, empty: str
) -> None:
    """Draw a field over the frame. label: of the colours, with the unit. empty: what to say where the field
    has no value anywhere.
    """
    axes.set_facecolor(EMPTY_COLOUR)
    x, y, vectors = _sampled(image_size, field, 240)
    size = np.hypot(vectors[..., 0], vectors[..., 1])
    if not np.isfinite(size).any():
        note(axes, empty)
        return
    shown = axes.pcolormesh(
        x, y, np.ma.masked_invalid(size), cmap="cividis", vmin=0.0, shading="nearest", rasterized=True
    )
    figure.colorbar(shown, ax=axes, label=label, pad=0.02, shrink=0.9, aspect=32)
    if np.nanmax(size) > 1e-9:
        _contours(axes, *_sampled(image_size, field, 80))
        _arrows(axes, *_sampled(image_size, field, 13))


def _contours(axes: Axes, x: ndarray, y: ndarray, vectors: ndarray) -> None:
    """Lines of equal length, labelled in pixels."""
    size = np.ma.masked_invalid(np.hypot(vectors[..., 0], vectors[..., 1]))
    lines = axes.contour(x, y, size, levels=7, colors="white", linewidths=0.7, alpha=0.9)
    axes.clabel(lines, fmt="%g px", fontsize=7)


def _arrows(axes: Axes, x: ndarray, y: ndarray, vectors: ndarray) -> None:
    """Directions, the longest as long as a step of the grid; the contours say how far."""
    longest = float(np.nanmax(np.hypot(vectors[..., 0], vectors[..., 1]), initial=0.0))
    if longest > 0:
        scale = {"angles": "xy", "scale_units": "xy", "scale": longest / (x[1] - x[0])}
        axes.quiver(
            x, y, *np.moveaxis(vectors, -1, 0), pivot="mid", color="white", alpha=0.75, width=0.003, **scale
        )


def _sampled(
    image_size: tuple[int, int], field: Field, samples: int
) -> tuple[ndarray, ndarray, Float[ndarray, "rows columns 2"]]:
    """x and y of an even grid over the frame, pixels, and the field there. samples: along the frame's longer
    side.
    """
    width, height = image_size
    columns, rows = (max(2, round(samples * side / max(image_size))) for side in image_size)
    x = (np.arange(columns) + 0.5) / columns * width - 0.5
    y = (np.arange(rows) + 0.5) / rows * height - 0.5
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return x, y, field(pixels).reshape(rows, columns, 2)
