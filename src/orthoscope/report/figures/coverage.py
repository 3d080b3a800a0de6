"""Where corners were seen, and where none was.

The cells are those whose share the evaluation calls coverage. A camera may be trusted where corners were
seen; elsewhere its lens formula only extrapolates.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from orthoscope.evaluation.coverage import COVERAGE_GRID, cells_with_rays
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Bool, ndarray
from orthoscope.geometry.cells import Cells
from orthoscope.report.figures.style import BLUE, DENSE_MARKS, EMPTY_COLOUR, RED, frame_figure, styled

__all__ = ["coverage"]

MISSING = {"facecolor": "#FBE9DF", "edgecolor": RED, "alpha": 0.8, "hatch": "////", "linewidth": 0.0}
NO_RAY = {"facecolor": EMPTY_COLOUR, "linewidth": 0.0}


@styled
def coverage(calibration: Calibration) -> Figure:
    """All corners over the frame, pixels; cells of the frame where there are none are hatched, those without
    any ray grey.
    """
    detections = calibration.detections
    figure, axes = frame_figure(detections.image_size)
    pixels = (
        np.concatenate([view.pixels for view in detections.views]) if detections.views else np.empty((0, 2))
    )
    cells = Cells(detections.image_size, *COVERAGE_GRID)
    empty = cells.count(pixels) == 0
    reached = cells_with_rays(calibration.camera)
    _fill(axes, cells, empty & reached, MISSING)
    _fill(axes, cells, empty & ~reached, NO_RAY)
    axes.set_xticks(cells.x_edges, minor=True)
    axes.set_yticks(cells.y_edges, minor=True)
    axes.grid(which="minor")
    axes.tick_params(which="minor", length=0)
    many = len(pixels) > DENSE_MARKS
    axes.scatter(
        *pixels.T, s=3 if many else 7, color=BLUE, alpha=0.35 if many else 0.6, linewidth=0, rasterized=many
    )
    _legend(axes, int((empty & reached).sum()), int((empty & ~reached).sum()), empty.size)
    return figure


def _fill(axes: Axes, cells: Cells, which: Bool[ndarray, "rows columns"], look: dict) -> None:
    """A patch over each of these cells."""
    for row, column in np.argwhere(which):
        (left, right), (top, bottom) = cells.x_edges[column : column + 2], cells.y_edges[row : row + 2]
        axes.add_patch(Rectangle((left, top), right - left, bottom - top, **look))


def _legend(axes: Axes, missing: int, dark: int, total: int) -> None:
    """What the cells mean, with their numbers, above the frame."""
    keys = [Patch(**MISSING) if missing else Patch(facecolor="white", edgecolor=BLUE)]
    labels = [
        (
            f"no corner: {missing} of {total} cells"
            if missing
            else f"corners in {'all other' if dark else f'all {total}'} cells"
        )
    ]
    if dark:
        keys, labels = [*keys, Patch(**NO_RAY)], [*labels, f"no ray: {dark} cells"]
    axes.legend(keys, labels, loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2, ncols=2)
