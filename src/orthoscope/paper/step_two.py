"""Step 2 by itself (the paper's 3.2): the polynomial's degree, and from how many images the lens is fitted.

The pin-hole and the corrected points are those of both steps repeated; what varies is step 2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.methods.mldc.lens_about_centre import fit_centred_lens
from orthoscope.methods.mldc.mldc import mldc
from orthoscope.paper.entries import PaperEntry
from orthoscope.targets.detections import Detections

__all__ = [
    "DEGREES",
    "IMAGES",
    "PAPER_DEGREE",
    "lens_from_images",
    "name_of_degree",
    "name_of_images",
    "of_step_two",
]

# Degrees of the polynomial that are tried; the paper takes the last.
DEGREES = (2, 3, 4, 5)
PAPER_DEGREE = 5
# The lens is fitted to the pairs of so many images, the first; all of them otherwise.
IMAGES = (1, 2, 5)


def name_of_degree(degree: int) -> str:
    """How an entry is called."""
    return f"degree {degree}"


def name_of_images(images: int) -> str:
    """How an entry is called."""
    return f"lens from {images} image{'' if images == 1 else 's'}"


def of_step_two() -> tuple[PaperEntry, ...]:
    """An entry for each degree and for each number of images."""
    powers = {degree: ",".join(f"a{t}" for t in range(1, degree + 1)) for degree in DEGREES}
    return (
        *(
            PaperEntry(name_of_degree(degree), "mldc", {"lens": f"pfet:{powers[degree]}"})
            for degree in DEGREES
        ),
        *(PaperEntry(name_of_images(count), lens_from_images, {"images": count}) for count in IMAGES),
    )


def lens_from_images(detections: Detections, *, images: int) -> Calibration:
    """The calibration of both steps repeated, its lens fitted anew to the pairs of the first images alone.

    Args:
        detections: all of them; the pin-hole is that of all.
        images: how many the lens is fitted to.
    Raises:
        CalibrationError: the views cannot tell the camera.
    """
    whole = mldc(detections)
    points, views = whole.target_points, whole.detections.views[:images]
    poses = whole.camera_from_target[:images]
    rays = np.concatenate([pose.apply(points[view.ids]) for pose, view in zip(poses, views, strict=True)])
    pixels = np.concatenate([view.pixels for view in views])
    fit = fit_centred_lens(rays, pixels, pinhole=whole.camera, lens="pfet")
    return replace(whole, camera=fit.unknowns)
