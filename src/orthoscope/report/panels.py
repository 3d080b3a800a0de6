"""The page's figures in their order: what each is called, how to read it, and the numbers that it shows.

A panel's `data` is what the script draws under the panel's name, or a sentence that says why there is nothing
to draw; the page then has the sentence in the place of the figure.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.report.data.boards import boards
from orthoscope.report.data.choice import choice
from orthoscope.report.data.frame_fields import difference, displacement, lens_misfit_data
from orthoscope.report.data.lens_curve import curve
from orthoscope.report.data.target import target_misfit_data, target_shape_data
from orthoscope.report.data.trust import without_each

__all__ = ["PANELS", "Panel"]

Data = dict[str, Any] | str


class Panel(NamedTuple):
    """A figure of the page.

    Attributes:
        name: in the script, and the element's id.
        title, caption: what it shows, and how to take it.
        label: what it shows, for readers who hear the page.
        data: its numbers, or why there are none; empty where it draws the views alone.
        wide: it spans both columns.
    """

    name: str
    title: str
    caption: str
    label: str
    data: Callable[[Evaluation], Data] = lambda evaluation: {}
    wide: bool = False


PANELS = (
    Panel(
        "by-view",
        "Residuals by photograph",
        "Bars: rms in the calibration; dots: held out. Far above the others: blurred, moved or misread. High"
        " only when held out: it shows something that no other photograph does.",
        "Bar chart of the rms residual of each photograph",
        wide=True,
    ),
    Panel(
        "without-each",
        "Without each photograph",
        "How far the camera's image moves, over the part that was seen, where one photograph is left out. Far"
        " above the others: the camera rests on this one; take more like it.",
        "Bar chart of how far the camera moves without each photograph",
        without_each,
        wide=True,
    ),
    Panel(
        "vectors",
        "Residual vectors",
        "From each detected corner to where the camera predicts it. Disorder is good; long arrows side by"
        " side mean a bad photograph.",
        "Arrows over the frame, one for each corner",
    ),
    Panel(
        "by-place",
        "Residuals by place",
        "Arrows that agree with their neighbours are what the lens formula cannot follow. Places with fewer"
        " than four corners are empty.",
        "Map of the rms residual over the frame, with mean residuals as arrows",
    ),
    Panel(
        "poses",
        "Boards in space",
        "The camera and every board where it was. Tilts in different directions fix the focal length. Drag or"
        " use the arrow keys to turn.",
        "Boards and camera in three dimensions",
        boards,
    ),
    Panel(
        "target-shape",
        "Shape of the target",
        "Where the corners were found to be, displacements magnified: the calibration has taken this into"
        " account.",
        "The target's corners in three dimensions",
        target_shape_data,
    ),
    Panel(
        "target-misfit",
        "Misfit of the target",
        "Where corners seem to be against where they are taken to be, as far as photographs agree. A pattern"
        " is a bent or badly printed target.",
        "The target's corners in three dimensions, with displacements that the calibration has not followed",
        target_misfit_data,
    ),
    Panel(
        "lens-misfit",
        "Misfit of the lens",
        "What stays the same at a place of the image, whichever corner is there: what the lens formula cannot"
        " follow.",
        "Map over the frame of what photographs agree on",
        lens_misfit_data,
    ),
    Panel(
        "curve",
        "Distortion curve",
        "From the optical axis outwards; the band spans all directions around it. Beyond the farthest corner"
        " seen the lens is extrapolated.",
        "Distance from the principal point against the angle from the axis",
        curve,
    ),
    Panel(
        "displacement",
        "Displacement over the frame",
        "How far, and whereto, the lens moves each place from its ideal image. Empty places have no ray.",
        "Map of the lens's displacement over the frame",
        displacement,
    ),
    Panel(
        "difference",
        "Formula against free lens",
        "How far the chosen formula sees from where the lens does that no formula limits, a common rotation"
        " apart: what the formula costs.",
        "Map of the difference between two lenses over the frame",
        difference,
    ),
    Panel(
        "choice",
        "What was tried",
        "Held-out error of each model, ± one standard error. The simplest that is as good as the best is"
        " taken.",
        "Dot chart of the held-out error of each model",
        choice,
    ),
)
