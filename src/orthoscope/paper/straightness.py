"""How straight a camera makes the rows and columns of a target: what Fig. 7 shows to the eye, as a number.

The corners are taken back through the lens and a line is fitted to each row and column; the distances from
it, rms, are in pixels of the photograph: each line is measured by its length there, so that a straight image
that is small gains nothing.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.observations import Observations
from orthoscope.geometry.projective import fitted_lines
from orthoscope.methods.mldc.lines_in_views import SeenLines
from orthoscope.models.camera import Camera
from orthoscope.targets.detections import Detections

__all__ = ["bent_px"]


def bent_px(camera: Camera, detections: Detections) -> float:
    """Rms distance of the straightened corners from their lines; NaN where the target has no lines."""
    if not detections.target.lines:
        return float("nan")
    observations = Observations.of(detections)
    lines = SeenLines.of(observations, detections.target)
    detected = observations.pixels()[lines.row[:, None], lines.column]
    straight = np.zeros_like(detected)
    straight[lines.present] = camera.undistort_pixels(detected[lines.present])
    present = lines.present & np.isfinite(straight).all(-1)
    straight[~present] = 0.0
    weights = present.astype(float)
    photographed, corrected = fitted_lines(detected, weights), fitted_lines(straight, weights)
    lengths = [np.sqrt((line.along**2 * weights).sum(1)) for line in (photographed, corrected)]
    off = corrected.across * (lengths[0] / np.maximum(lengths[1], 1e-12))[:, None]
    return float(np.sqrt((off[present] ** 2).mean()))
