"""Fig. 1: the detected corners of a photograph and the corrected ones.

The photograph whose corners lie farthest out; without photographs, a view of the first trial in the high
distortion, rendered. The corrected points are those of both steps repeated.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orthoscope.files.images import read_image
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.mldc.mldc import mldc
from orthoscope.paper.section4 import PAPER_NOISE_PX, SCENES, Results
from orthoscope.paper.trials import TRAINING_VIEWS, papers_scene, simulated
from orthoscope.simulation.render import Renderer
from orthoscope.targets.detections import Detections

__all__ = ["FirstFigure", "farthest_out", "first_figure"]


class FirstFigure(NamedTuple):
    """What is drawn.

    Attributes:
        name: of the photograph.
        photograph: uint8, grey or BGR.
        detected, corrected: (n,2) pixels.
        rendered: whether the photograph is made up.
    """

    name: str
    photograph: ndarray
    detected: Float[ndarray, "n 2"]
    corrected: Float[ndarray, "n 2"]
    rendered: bool


def first_figure(results: Results, files: Mapping[str, Path]) -> FirstFigure:
    """Fig. 1 of a run.

    Args:
        results: of the run, with its photographs' corners where there are any.
        files: where the photographs are, by name.
    Raises:
        CalibrationError: the corners cannot tell the camera.
    """
    detections = results.detections
    if detections and any(view.image in files for view in detections.views):
        chosen = farthest_out(detections, [v.image for v in detections.views if v.image in files])
        name = detections.views[chosen].image
        return _drawn(detections, chosen, name, read_image(files[name]), rendered=False)
    condition = results.plan.condition(PAPER_NOISE_PX)
    training, _ = simulated(SCENES[-1], condition, seed=results.plan.seed, trial=0)
    chosen = farthest_out(training, [view.image for view in training.views])
    scene = papers_scene(SCENES[-1], condition, seed=results.plan.seed, trial=0)
    assert chosen < TRAINING_VIEWS
    rng = np.random.default_rng(results.plan.seed)
    photograph = Renderer(scene.camera).photograph(scene.target, scene.camera_from_target[chosen], rng=rng)
    return _drawn(training, chosen, training.views[chosen].image, photograph, rendered=True)


def farthest_out(detections: Detections, among: list[str]) -> int:
    """The view among these whose corners are farthest from the image's middle on average."""
    middle = 0.5 * (np.array(detections.image_size) - 1.0)
    out = [
        float(np.hypot(*(view.pixels - middle).T).mean()) if view.image in among else -1.0
        for view in detections.views
    ]
    return int(np.argmax(out))


def _drawn(
    detections: Detections, chosen: int, name: str, photograph: ndarray, *, rendered: bool
) -> FirstFigure:
    """Both kinds of points of a view, of the corners that have both."""
    made = mldc(detections)
    names = [view.image for view in made.detections.views]
    seen, straight = made.detections.views[names.index(name)], made.corrected().views[names.index(name)]
    both = np.isin(seen.ids, straight.ids)
    return FirstFigure(name, photograph, seen.pixels[both], straight.pixels, rendered)
