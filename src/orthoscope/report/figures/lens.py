"""What the lens does: its curve from the axis outwards, and how far it moves each place of the frame.

The ideal image of a ray is its place in the lens's own chart through K: a pin-hole's image for lenses of the
plane, an equidistant one (r = f theta) for lenses of the angle. Displacement is image minus ideal, pixels;
negative along the radius is barrel, positive is pincushion. All figures come from `project` and `unproject`
alone, so any lens can be shown.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.difference import image_difference
from orthoscope.models.lenses.charts import GNOMONIC
from orthoscope.report.data.frame_fields import ideal_image
from orthoscope.report.data.lens_curve import along_angles, angles_shown, marks
from orthoscope.report.figures.style import (
    BLUE,
    COLUMN_WIDTH,
    GREY,
    INK,
    ORANGE,
    RED,
    frame_figure,
    note,
    styled,
)
from orthoscope.report.figures.vector_map import vector_map

__all__ = ["displacement_map", "distortion_curve", "lens_difference"]

# The curve has so many samples.
PRINTED_CURVE_SAMPLES = 240
# What is marked on the curve has these colours.
MARK_COLOURS = {"seen": ORANGE, "edge": INK, "end": RED}


@styled
def distortion_curve(calibration: Calibration) -> Figure:
    """Distance from the principal point and radial displacement (px) against the angle from the axis
    (degrees).

    Bands span all directions around the axis. Marked: the farthest corner that was seen, the frame's farthest
    pixel, the lens's end.
    """
    camera = calibration.camera
    figure = Figure(figsize=(COLUMN_WIDTH, 4.9))
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1.0))
    above.set_ylabel("distance from principal point (px)")
    below.set(xlabel="angle from the optical axis (°)", ylabel="radial displacement (px)")
    angles = angles_shown(camera, PRINTED_CURVE_SAMPLES)
    if not len(angles):
        note(above, "no pixel of the frame's border or inside has a ray")
        return figure
    radius, displacement = along_angles(camera, angles)
    _band(above, angles, radius, "this lens")
    _ideals(above, camera, angles, float(np.nanmax(radius)))
    _band(below, angles, displacement, "")
    below.axhline(0.0, color=GREY, lw=0.9, ls=(0, (4, 3)))
    for axes in (above, below):
        axes.grid()
        _marks(axes, calibration, angles[-1])
    above.set(xlim=(0.0, np.rad2deg(angles[-1])), ylim=(0.0, 1.25 * float(np.nanmax(radius))))
    figure.legend(
        *above.get_legend_handles_labels(),
        loc="outside upper left",
        ncols=3,
        handlelength=1.8,
        columnspacing=1.2,
    )
    return figure


@styled
def displacement_map(calibration: Calibration) -> Figure:
    """How far, and whereto, the lens moves each place of the frame from its ideal image (px); grey where no
    ray falls.
    """
    camera = calibration.camera
    ideal = "pin-hole" if camera.lens.chart is GNOMONIC else "equidistant"
    figure, axes = frame_figure(camera.image_size)
    vector_map(
        figure,
        axes,
        camera.image_size,
        field=lambda pixels: pixels - ideal_image(camera, camera.unproject(pixels)),
        label=f"displacement from the {ideal} image (px)",
        empty="no pixel of the frame has a ray",
    )
    _principal_point(axes, camera)
    return figure


@styled
def lens_difference(camera: Camera, other: Camera) -> Figure:
    """How far, and whereto, `other` sees what `camera` sees at each place of its frame (px), a common
    rotation apart.
    """
    figure, axes = frame_figure(camera.image_size)
    vector_map(
        figure,
        axes,
        camera.image_size,
        field=lambda pixels: image_difference(camera, other, pixels),
        label="difference between the two (px)",
        empty="no pixel has a ray in both",
    )
    _principal_point(axes, camera)
    return figure


def _principal_point(axes: Axes, camera: Camera) -> None:
    axes.plot(
        camera.intrinsics.cx, camera.intrinsics.cy, "+", color=ORANGE, ms=10, mew=1.6, label="principal point"
    )
    axes.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2)


def _band(axes: Axes, angles: ndarray, values: Float[ndarray, "a d"], label: str) -> None:
    """The mean over the directions as a line inside the band of all of them, as far as every direction has an
    image.
    """
    whole = np.isfinite(values).all(-1)
    degrees, values = np.rad2deg(angles[whole]), values[whole]
    axes.fill_between(
        degrees, values.min(-1), values.max(-1), color=BLUE, alpha=0.22, linewidth=0, label=None
    )
    axes.plot(degrees, values.mean(-1), color=BLUE, lw=1.7, label=label)


def _ideals(axes: Axes, camera: Camera, angles: ndarray, top: float) -> None:
    """The pin-hole's and the equidistant lens's curves for the same focal length."""
    focal = float(np.sqrt(camera.intrinsics.fx * camera.intrinsics.fy))
    front = angles < np.pi / 2 - 1e-3
    pin_hole = focal * np.tan(angles[front])
    shown = pin_hole < 2 * top
    axes.plot(
        np.rad2deg(angles[front][shown]),
        pin_hole[shown],
        color=GREY,
        lw=1.0,
        ls=(0, (4, 3)),
        label="pin-hole, f tan θ",
    )
    axes.plot(
        np.rad2deg(angles), focal * angles, color=GREY, lw=1.0, ls=(0, (1, 2)), label="equidistant, f θ"
    )


def _marks(axes: Axes, calibration: Calibration, last: float) -> None:
    """Vertical lines: how far corners were seen, where the frame ends, where the lens ends."""
    for kind, angle, words in marks(calibration):
        if np.isfinite(angle) and angle <= last:
            axes.axvline(
                np.rad2deg(angle),
                color=MARK_COLOURS[kind],
                lw=1.1,
                label=f"{words}, {np.rad2deg(angle):.1f}°",
            )
        if kind == "seen" and np.isfinite(angle):
            axes.axvspan(np.rad2deg(angle), np.rad2deg(last), color=ORANGE, alpha=0.09, linewidth=0)
