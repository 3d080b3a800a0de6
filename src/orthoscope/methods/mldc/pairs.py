"""Pairs of detected and corrected points, as rays: what step 2 is fitted to."""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.observations import Poses
from orthoscope.fitting.starts.initial_camera import StartingCameras
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["pairs_of"]


def pairs_of(bases: StartingCameras, poses: Poses) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 2"]]:
    """The rays of all corners, which K takes to the corrected points, and where the corners were detected."""
    observations = bases.observations
    present = observations.present > 0
    points = bases.points[observations.ids] @ np.swapaxes(poses.rotation, 1, 2) + poses.translation[:, None]
    return points[present], observations.pixels()[present]
