"""The report's figures: data in, Figure out.

With paper/figures.py the only place with matplotlib; importing this package loads it, so import it where a
figure is needed.
"""

from orthoscope.report.figures.board import target_misfit, target_shape
from orthoscope.report.figures.coverage import coverage
from orthoscope.report.figures.lens import displacement_map, distortion_curve, lens_difference
from orthoscope.report.figures.residuals import (
    lens_misfit,
    residual_vectors,
    residuals_by_place,
    residuals_by_view,
)
from orthoscope.report.figures.scene import board_poses
from orthoscope.report.figures.style import to_svg

__all__ = [
    "board_poses",
    "coverage",
    "displacement_map",
    "distortion_curve",
    "lens_difference",
    "lens_misfit",
    "residual_vectors",
    "residuals_by_place",
    "residuals_by_view",
    "target_misfit",
    "target_shape",
    "to_svg",
]
