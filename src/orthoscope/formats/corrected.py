"""The corrected points of a calibration beside the detected ones: the pairs of the paper's step 2, a table.

    image,corner,detected_x,detected_y,corrected_x,corrected_y
    left01.jpg,0,244.4,94.1,238.9,86.6

A line for each corner that has both, pixels, four decimals. As detections of a straight photograph
(`Calibration.corrected`) they are a file of our own.
"""

from __future__ import annotations

import csv
import io

from orthoscope.fitting.calibration import Calibration

__all__ = ["corrected_csv"]

COLUMNS = ("image", "corner", "detected_x", "detected_y", "corrected_x", "corrected_y")


def corrected_csv(calibration: Calibration) -> str:
    """The table as text, lines in the order of the views and their corners."""
    writer = csv.writer(text := io.StringIO(), lineterminator="\n")
    writer.writerow(COLUMNS)
    for detected, corrected in zip(calibration.detections.views, calibration.corrected().views, strict=True):
        places = dict(zip(corrected.ids.tolist(), corrected.pixels.tolist(), strict=True))
        for corner, pixel in zip(detected.ids.tolist(), detected.pixels.tolist(), strict=True):
            if corner in places:
                numbers = (f"{value:.4f}" for value in (*pixel, *places[corner]))
                writer.writerow((detected.image, corner, *numbers))
    return text.getvalue()
