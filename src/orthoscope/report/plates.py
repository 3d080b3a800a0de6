"""The report's figures in the order of the page, with title and caption.

Importing this loads matplotlib; page.py does so only when a page is made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.fitting.calibration import Calibration
from orthoscope.report import figures

__all__ = ["PLATES", "Plate"]


@dataclass(frozen=True)
class Plate:
    """One figure of the page: its name (also the prefix of its ids), title, caption, how it is drawn, and for
    which evaluations.

    Attributes:
        wide: spans both columns.
    """

    name: str
    title: str
    caption: str
    draw: Callable[[Evaluation], Figure]
    wide: bool = False
    suits: Callable[[Evaluation], bool] = lambda _: True


PLATES = (
    Plate(
        "by-view",
        "Residuals by photograph",
        "Far above the others: blurred, moved or misread. High only when held out: it shows something that no"
        " other photograph does.",
        figures.residuals_by_view,
        wide=True,
    ),
    Plate(
        "vectors",
        "Residual vectors",
        "From each detected corner to where the camera predicts it. Disorder is good; long arrows side by"
        " side mean a bad photograph.",
        lambda evaluation: figures.residual_vectors(evaluation.calibration),
    ),
    Plate(
        "by-place",
        "Residuals by image place",
        "White arrows that agree with their neighbours are what the lens formula cannot follow. Grey places"
        " have fewer than four corners.",
        figures.residuals_by_place,
    ),
    Plate(
        "target-misfit",
        "Target misfit",
        "Where corners seem to be against where they are said to be, as far as views agree. A pattern is a"
        " bent or badly printed target.",
        figures.target_misfit,
    ),
    Plate(
        "lens-misfit",
        "Lens misfit",
        "What stays the same at a place of the image, whichever corner is there: the part of the lens that"
        " its formula cannot follow.",
        figures.lens_misfit,
    ),
    Plate(
        "target-shape",
        "Shape of the target",
        "Where the corners were found to be against where they are said to be: the calibration has taken this"
        " into account.",
        lambda evaluation: figures.target_shape(evaluation.calibration),
        suits=lambda evaluation: evaluation.calibration.target_shape.kind != "flat",
    ),
    Plate(
        "coverage",
        "Coverage",
        "Where corners were seen. In hatched cells the lens is only extrapolated: photograph the target there"
        " next.",
        lambda evaluation: figures.coverage(evaluation.calibration),
    ),
    Plate(
        "poses",
        "Boards in space",
        "The camera at the origin, every board where it was, numbered as in the table. Tilts in different"
        " directions fix the focal length.",
        figures.board_poses,
    ),
    Plate(
        "curve",
        "Distortion curve",
        "From the optical axis outwards. The band spans all directions around the axis; tinted angles lie"
        " beyond the farthest corner seen.",
        lambda evaluation: figures.distortion_curve(evaluation.calibration),
    ),
    Plate(
        "displacement",
        "Displacement over the frame",
        "How far the lens moves each place from its ideal image; arrows show whereto, not to scale. Grey"
        " places have no ray.",
        lambda evaluation: figures.displacement_map(evaluation.calibration),
    ),
    Plate(
        "difference",
        "Formula against free lens",
        "How far the chosen formula sees from where the lens does that no formula limits, a common rotation"
        " apart: what the formula costs.",
        lambda evaluation: _formula_against_free(evaluation.calibration),
        suits=lambda evaluation: evaluation.calibration.free_camera is not None,
    ),
)


def _formula_against_free(calibration: Calibration) -> Figure:
    assert calibration.free_camera is not None  # the plate does not suit others
    return figures.lens_difference(calibration.free_camera, calibration.camera)
