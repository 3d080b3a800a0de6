"""The picture in README.md, made from what `orthoscope demo` writes: `make picture`.

Left a rendered photograph with the corners that were found, in the middle the same without its lens, right
how far the recovered camera is from the true one.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import orthoscope
from orthoscope.models.difference import frame_grid
from orthoscope.straight.undistort import Straightener

COLUMNS, ROWS = 81, 61


def picture(demo: Path) -> Figure:
    """The figure, from the folder that `orthoscope demo` wrote."""
    calibration, truth = (
        orthoscope.load(demo / "calibration.json"),
        orthoscope.load_camera(demo / "truth.json"),
    )
    camera = calibration.camera
    view = max(calibration.detections.views, key=lambda view: float(np.ptp(view.pixels, axis=0).prod()))
    photograph = orthoscope.read_image(demo / "photographs" / view.image, grey=True)
    straightener = Straightener(camera, keep="all")
    figure = Figure(figsize=(13, 3.5), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    for axes, image, pixels, title in (
        (left, photograph, view.pixels, "a photograph, and the corners found in it"),
        (
            middle,
            straightener(photograph),
            camera.undistort_pixels(view.pixels, straightener.intrinsics),
            "the same, without its lens",
        ),
    ):
        axes.imshow(image, cmap="gray", vmin=0, vmax=255)
        axes.scatter(*pixels.T, s=9, facecolor="none", edgecolor="#D55E00", linewidth=0.9)
        axes.set(title=title, xticks=[], yticks=[])
    apart = np.hypot(
        *orthoscope.image_difference(truth, camera, frame_grid(camera.image_size, COLUMNS, ROWS)).T
    ).reshape(ROWS, COLUMNS)
    drawn = right.imshow(
        apart,
        extent=(-0.5, camera.image_size[0] - 0.5, camera.image_size[1] - 0.5, -0.5),
        cmap="viridis",
        vmin=0,
    )
    right.set(title=f"off the true camera by {np.nanmean(apart):.3f} px on average", xticks=[], yticks=[])
    figure.colorbar(drawn, ax=right, label="px", shrink=0.8)
    return figure


if __name__ == "__main__":
    source, out = Path(sys.argv[1]), Path(sys.argv[2])
    picture(source).savefig(out, dpi=90, metadata={"Software": None})
