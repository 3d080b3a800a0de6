"""From straightened corners to a calibration: the pin-hole on them, then a formula from pairs (paper, 3.2).

What corrects the corners may be anything; the formula is only what a file can hold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from orthoscope.fitting.calibration import Calibration, Uncertainty
from orthoscope.fitting.identifiability import check_known
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.starts.initial_camera import Assumptions, StartingCameras
from orthoscope.fitting.starts.pinhole import fit_pinhole
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.mldc.lens_about_centre import fit_centred_lens
from orthoscope.methods.mldc.pairs import pairs_of
from orthoscope.methods.mldc.repeated import in_gauge
from orthoscope.solve.block_system import shared_covariance
from orthoscope.targets.detections import Detections, View
from orthoscope.version import __version__

__all__ = ["calibration_of_corrected"]


def calibration_of_corrected(
    used: Detections,
    straightened: Callable[[Float[ndarray, "n 2"]], Float[ndarray, "n 2"]],
    centre: Float[ndarray, "2"],
    *,
    lens: str,
    method: str,
    settings: dict[str, Any],
    said: tuple[str, ...],
) -> Calibration:
    """The pin-hole that sees the corrected corners, and the lens that takes these to the detected ones.

    Args:
        used: the corners as they were detected.
        straightened: what corrects pixels.
        centre: of distortion, pixels.
        lens: as `parse_centred_lens` reads it.
        method, settings, said: what the calibration tells of how it was made.
    Raises:
        CalibrationError: no pin-hole sees the corrected corners.
    """
    views = tuple(View(view.image, view.ids, straightened(view.pixels)) for view in used.views)
    narrowing = Assumptions.of(len(used.views), skew=settings["skew"])
    corrected = Observations.of(replace(used, views=views))
    straight = StartingCameras(corrected, used.target.points, used.image_size, narrowing)
    pinhole = fit_pinhole(straight)
    check_known(pinhole, narrowing.free, shared_covariance(pinhole.sums, 2 * used.corners), used)
    bases = StartingCameras(Observations.of(used), used.target.points, used.image_size, narrowing)
    fit = fit_centred_lens(
        *pairs_of(bases, pinhole.unknowns.poses),
        pinhole=pinhole.unknowns.camera,
        lens=lens,
        centre=(float(centre[0]), float(centre[1])),
    )
    return Calibration(
        camera=in_gauge(fit.unknowns, narrowing.free),
        camera_from_target=bases.observations.poses_in_order(pinhole.unknowns.poses),
        detections=used,
        method=method,
        settings=settings,
        uncertainty=Uncertainty((), np.empty((0, 0))),
        status=fit.status.value,
        steps=pinhole.steps + fit.steps,
        version=__version__,
        assumptions=(*said, *narrowing.assumptions),
    )
