"""Vectors over the frame: what the lens does to an ideal image, and where another camera sees the same.

The ideal image of a ray is its place in the lens's own chart through K: a pin-hole's image for lenses of the
plane, an equidistant one (r = f theta) for lenses of the angle. A field is sampled at the centres of cells of
the frame, row by row, in thousandths of a pixel; the page draws what lies between.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.cells import cells_for
from orthoscope.models.camera import Camera
from orthoscope.models.difference import image_difference
from orthoscope.report.data.rounded import RESIDUAL_UNITS, whole

__all__ = ["difference", "displacement", "ideal_image", "lens_misfit_data"]

# The frame has about so many cells.
FIELD_CELLS = 1200


def displacement(evaluation: Evaluation) -> dict[str, Any] | str:
    """How far the lens moves each place of the frame from its ideal image."""
    camera = evaluation.calibration.camera
    return _field(
        camera.image_size,
        lambda pixels: pixels - ideal_image(camera, camera.unproject(pixels)),
        "No pixel of the frame has a ray.",
    )


def difference(evaluation: Evaluation) -> dict[str, Any] | str:
    """Where the chosen formula sees what the free lens sees, a common rotation apart."""
    calibration = evaluation.calibration
    free = calibration.free_camera
    if free is None:
        return "The lens is not a formula that was chosen in the place of a free lens."
    return _field(
        free.image_size,
        lambda pixels: image_difference(free, calibration.camera, pixels),
        "No pixel has a ray in both lenses.",
    )


def lens_misfit_data(evaluation: Evaluation) -> dict[str, Any] | str:
    """What the views agree on at each place of the image."""
    misfit = evaluation.misfit.lens
    if np.isnan(misfit.test.f):
        return "Too few photographs to tell what they agree on."
    if not np.nanmax(np.abs(misfit.residuals), initial=0.0) > 0.0:
        return "Photographs agree on nothing at the same places of the image: what is left is noise."
    told = _cells(misfit.cells.columns, misfit.cells.rows, misfit.residuals.reshape(-1, 2))
    return told | {"noise": round(misfit.test.noise_px, 5)}


def ideal_image(camera: Camera, rays: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2"]:
    """Pixels that the chart alone gives rays."""
    return camera.intrinsics.to_pixels(np.stack(camera.lens.chart.flatten(*rays.T), axis=-1))


def _field(
    image_size: tuple[int, int],
    field: Callable[[Float[ndarray, "n 2"]], Float[ndarray, "n 2"]],
    empty: str,
) -> dict[str, Any] | str:
    cells = cells_for(image_size, FIELD_CELLS)
    vectors = field(cells.centres.reshape(-1, 2))
    return _cells(cells.columns, cells.rows, vectors) if np.isfinite(vectors).any() else empty


def _cells(columns: int, rows: int, vectors: Float[ndarray, "n 2"]) -> dict[str, Any]:
    x, y = (whole(vectors[:, i], RESIDUAL_UNITS) for i in range(2))
    return {"columns": columns, "rows": rows, "x": x, "y": y}
