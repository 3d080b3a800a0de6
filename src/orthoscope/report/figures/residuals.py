"""Where the camera misses the corners: over the frame, by place, by photograph.

A residual is predicted minus detected, pixels; an arrow starts at the detected corner and points to the
predicted one. Corners that the camera gives no image (NaN) are left out.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.cells import cells_for
from orthoscope.report.figures.arrows import frame_key, round_magnification, true_to_scale
from orthoscope.report.figures.style import (
    BLUE,
    DENSE_MARKS,
    EMPTY_COLOUR,
    INK,
    ORANGE,
    RED,
    frame_figure,
    named,
    note,
    styled,
)

__all__ = ["lens_misfit", "residual_vectors", "residuals_by_place", "residuals_by_view"]

# With more photographs the axis carries their numbers instead of names.
NAMED_PHOTOGRAPHS = 60
# The mean of a cell with fewer corners says nothing.
FEWEST_CELL_CORNERS = 4


@styled
def residual_vectors(calibration: Calibration) -> Figure:
    """Every residual as an arrow over the frame, magnified, coloured by its length in pixels."""
    figure, axes = frame_figure(calibration.camera.image_size)
    pixels, residuals = _finite(calibration, calibration.residuals())
    if not len(pixels):
        note(axes, "no corner has an image")
        return figure
    size = np.hypot(*residuals.T)
    order = np.argsort(size, kind="stable")  # the longest on top
    top = max(float(np.quantile(size, 0.98)), 1e-12)
    many = len(pixels) > DENSE_MARKS
    magnification = round_magnification(size, _diagonal(calibration), share=0.02 if many else 0.03)
    arrows = axes.quiver(
        *pixels[order].T,
        *residuals[order].T,
        size[order],
        cmap="viridis_r",
        clim=(0.0, top),
        width=0.0016 if many else 0.0022,
        **true_to_scale(magnification),
        rasterized=many,
    )
    figure.colorbar(arrows, ax=axes, label="residual (px)", extend="max", pad=0.02, shrink=0.9, aspect=32)
    frame_key(axes, calibration.camera.image_size, magnification, "each residual")
    return figure


@styled
def residuals_by_place(evaluation: Evaluation) -> Figure:
    """Cells of the frame coloured by their rms residual, with the mean residual as an arrow; of held-out
    residuals where there are any.
    """
    calibration = evaluation.calibration
    figure, axes = frame_figure(calibration.camera.image_size)
    kind, pixels, residuals = _fairest(evaluation)
    cells = cells_for(calibration.camera.image_size, int(np.clip(len(pixels) / 8, 24, 300)))
    told = cells.count(pixels) >= FEWEST_CELL_CORNERS
    if not told.any():
        note(axes, f"no place has {FEWEST_CELL_CORNERS} corners")
        return figure
    spread = np.where(told, np.sqrt(cells.mean(pixels, (residuals**2).sum(-1))), np.nan)
    axes.set_facecolor(EMPTY_COLOUR)
    shown = axes.pcolormesh(
        cells.x_edges,
        cells.y_edges,
        np.ma.masked_invalid(spread),
        cmap="viridis_r",
        vmin=0.0,
        edgecolors="face",
        linewidth=0.2,
    )
    figure.colorbar(shown, ax=axes, label=f"{kind} rms (px per point)", pad=0.02, shrink=0.9, aspect=32)
    means = np.stack([cells.mean(pixels, residuals[:, i])[told] for i in range(2)], axis=-1)
    _mean_arrows(axes, calibration, cells.centres[told], means, "mean residual")
    return figure


@styled
def lens_misfit(evaluation: Evaluation) -> Figure:
    """What the views agree on at each place of the image, whatever corner is there, px: what the formula
    cannot follow.
    """
    misfit, image_size = evaluation.misfit.lens, evaluation.calibration.camera.image_size
    figure, axes = frame_figure(image_size)
    axes.set_facecolor(EMPTY_COLOUR)
    size = np.hypot(misfit.residuals[..., 0], misfit.residuals[..., 1])
    if np.isnan(misfit.test.f):
        note(axes, "too few views to tell")
        return figure
    if not np.nanmax(size, initial=0.0) > 0.0:
        note(axes, "the views agree on nothing: only noise")
        return figure
    x, y = misfit.cells.x_edges, misfit.cells.y_edges
    top = max(float(np.nanmax(size)), misfit.test.noise_px)  # what noise hides looks pale
    shown = axes.pcolormesh(
        x,
        y,
        np.ma.masked_invalid(size),
        cmap="viridis_r",
        vmin=0.0,
        vmax=top,
        edgecolors="face",
        linewidth=0.2,
    )
    figure.colorbar(shown, ax=axes, label="systematic residual (px)", pad=0.02, shrink=0.9, aspect=32)
    told = np.isfinite(size)
    _mean_arrows(
        axes,
        evaluation.calibration,
        misfit.cells.centres[told],
        misfit.residuals[told],
        "systematic residual",
    )
    return figure


@styled
def residuals_by_view(evaluation: Evaluation) -> Figure:
    """The rms of each photograph as a bar, its held-out rms as a dot; suspects stand out and are named."""
    figure = Figure(figsize=(11.9, 3.4))
    axes = figure.add_subplot()
    views = evaluation.views
    place = np.arange(len(views))
    train = np.array([view.rms_px for view in views])
    held_out = np.array([view.held_out_rms_px for view in views])
    suspects = dict(evaluation.suspects)
    odd = np.array([view.image in suspects for view in views], dtype=bool)
    axes.bar(place[~odd], train[~odd], width=0.72, color=BLUE, label="in the calibration")
    if odd.any():
        axes.bar(place[odd], train[odd], width=0.72, color=RED, label="suspect")
    if np.isfinite(held_out).any():
        axes.scatter(
            place, held_out, s=16, color=ORANGE, edgecolor="white", linewidth=0.5, zorder=3, label="held out"
        )
    for value, colour, words in (
        (evaluation.rms_px, BLUE, "all"),
        (evaluation.held_out_rms_px, ORANGE, "all held out"),
    ):
        if np.isfinite(value):
            axes.axhline(
                value, color=colour, lw=0.9, ls=(0, (4, 3)), zorder=0, label=f"{words}, {value:.3g} px"
            )
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, borderaxespad=0.2, handlelength=1.6)
    axes.set(ylabel="rms residual (px per point)", xlim=(-0.7, max(len(views), 6) - 0.3))
    axes.set_ylim(bottom=0.0)
    axes.grid(axis="y")
    _name_views(axes, [view.image for view in views], odd, np.fmax(train, held_out))
    return figure


def _name_views(axes: Axes, names: list[str], odd: ndarray, tops: ndarray) -> None:
    """Names below the bars, or numbers where there are many and names above the suspects' bars (`tops`, px)
    only.
    """
    if len(names) <= NAMED_PHOTOGRAPHS:
        axes.set_xticks(
            np.arange(len(names)), [_shortened(name) for name in names], rotation=90 if len(names) > 8 else 0
        )
        axes.set_xlabel("photograph (name)")
        labels = axes.get_xticklabels()
        for i in np.flatnonzero(odd):
            labels[i].set(color=RED, fontweight="bold")
        return
    step = int(np.ceil(len(names) / 30))
    axes.set_xticks(np.arange(0, len(names), step), [str(i + 1) for i in range(0, len(names), step)])
    axes.set_xlabel("photograph (number in the table below)")
    for i in np.flatnonzero(odd & np.isfinite(tops)):
        place = (float(i), float(tops[i]))
        axes.annotate(
            _shortened(names[i]),
            place,
            (0, 5),
            textcoords="offset points",
            rotation=90,
            ha="center",
            color=RED,
            fontsize=7,
        )
    if odd.any():
        axes.set_ylim(top=1.35 * axes.get_ylim()[1])  # room for the names


def _shortened(name: str) -> str:
    return named(name if len(name) <= 16 else f"…{name[-15:]}")


def _finite(
    calibration: Calibration, residuals: tuple[ndarray, ...]
) -> tuple[Float[ndarray, "n 2"], Float[ndarray, "n 2"]]:
    """Detected pixels and residuals of all views together, without those that are NaN."""
    if not residuals:
        return np.empty((0, 2)), np.empty((0, 2))
    pixels = np.concatenate([view.pixels for view in calibration.detections.views])
    stacked = np.concatenate(residuals)
    usable = np.isfinite(stacked).all(-1)
    return pixels[usable], stacked[usable]


def _fairest(evaluation: Evaluation) -> tuple[str, Float[ndarray, "n 2"], Float[ndarray, "n 2"]]:
    """Held-out residuals where there are any, else those of the training; which they are, pixels,
    residuals.
    """
    pixels, residuals = _finite(evaluation.calibration, evaluation.held_out_residuals)
    if len(pixels):
        return "held-out", pixels, residuals
    return "training", *_finite(evaluation.calibration, evaluation.calibration.residuals())


def _mean_arrows(axes: Axes, calibration: Calibration, places: ndarray, means: ndarray, words: str) -> None:
    """White arrows (n,2) at places (n,2), pixels, with their key."""
    magnification = round_magnification(np.hypot(*means.T), _diagonal(calibration), share=0.035)
    arrows = axes.quiver(*places.T, *means.T, color="white", width=0.0045, **true_to_scale(magnification))
    arrows.set(edgecolor=INK, linewidth=0.35)
    frame_key(axes, calibration.camera.image_size, magnification, words)


def _diagonal(calibration: Calibration) -> float:
    return float(np.hypot(*calibration.camera.image_size))
