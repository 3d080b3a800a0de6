"""The paper's section 4.2 on photographs of the user's choice.

The paper has 20 photographs of one Axis 211 W, 15 to compute and 5 to test, and does not say which. Here
every fourth photograph is for testing, and all four such splits are made, so that every photograph is a test
once; errors are means over the splits, and the spread of a parameter over them says how well it is known.
Pixel axes may be oblique, as in the paper's Table 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orthoscope.files.images import read_image
from orthoscope.geometry.arrays import CalibrationError, Float, InputError, ndarray
from orthoscope.methods.plumb_line.photographs import lens_of_photographs
from orthoscope.models.camera import Camera
from orthoscope.paper.entries import OURS, PAPER, REPEATED, PaperEntry, with_skew
from orthoscope.paper.straightness import bent_px
from orthoscope.paper.subgrids import on_subgrid, subgrids
from orthoscope.paper.trials import Outcome, Trial, trial_judged
from orthoscope.straight.undistort import undistort
from orthoscope.targets.detections import Detections

__all__ = [
    "SPLIT_COUNT",
    "STUDY",
    "Straightened",
    "check_views",
    "grids_of",
    "obliqueness",
    "split",
    "split_outcomes",
    "straightened",
]

# One photograph in so many is for testing, as the paper's 5 of 20.
SPLIT_COUNT = 4
STUDY = "photographs"
# Fig. 7 shows these beside the paper's methods, and what edges alone give.
SHOWN_BESIDE = (
    next(entry for entry in OURS if entry.name == REPEATED),
    PaperEntry("hartley_kang", "hartley_kang", {}),
)
PLUMB_LINE = "plumb line, edges alone"
# With fewer photographs a split tests on a single one.
FEWEST_PHOTOGRAPHS = 8


class Straightened(NamedTuple):
    """Fig. 7: a photograph (uint8, grey or BGR) and what each method makes of it; the reason, a str, where it
    failed.
    """

    name: str
    photograph: ndarray
    pictures: tuple[tuple[str, ndarray | str], ...]


def check_views(detections: Detections) -> None:
    """Check that there are enough photographs to compute from some and to test on others.

    Raises:
        CalibrationError: there are too few.
    """
    if len(detections.views) < FEWEST_PHOTOGRAPHS:
        raise CalibrationError(
            f"the target was found in {len(detections.views)} photographs; the paper's comparison needs"
            f" {FEWEST_PHOTOGRAPHS} at least, of which one in four is for testing. Take more photographs."
        )


def grids_of(detections: Detections, count: int) -> tuple[tuple[int, int] | None, ...]:
    """Sub-grids of the photographed board; all corners alone where it is no grid."""
    return subgrids(detections.target.grid, count) if detections.target.grid else (None,)


def split(detections: Detections, turn: int) -> tuple[Detections, Detections]:
    """Training and test photographs: every fourth is for testing, a different one each turn."""
    tested = np.arange(len(detections.views)) % SPLIT_COUNT == SPLIT_COUNT - 1 - turn
    return detections.only(np.flatnonzero(~tested)), detections.only(np.flatnonzero(tested))


def split_outcomes(
    detections: Detections,
    turn: int,
    *,
    grids: tuple[tuple[int, int] | None, ...],
    entries: tuple[PaperEntry, ...],
) -> list[Outcome]:
    """Every entry on every sub-grid of the training photographs of a split; tested on all corners of the
    others.
    """
    training, test = split(detections, turn)
    return [
        Outcome(
            STUDY,
            STUDY,
            _points(detections, grid),
            entry.name,
            turn,
            trial_judged(entry, Trial(on_subgrid(training, grid), test, test)),
        )
        for grid in grids
        for entry in with_skew(entries)
    ]


def straightened(detections: Detections, files: Mapping[str, Path]) -> Straightened | None:
    """Fig. 7: the test photograph of the first split whose corners lie farthest out, straight by each method;
    None without photographs.
    """
    training, test = split(detections, 0)
    views = [view for view in test.views if view.image in files]
    if not views:
        return None
    middle = 0.5 * (np.array(detections.image_size) - 1.0)
    chosen = max(views, key=lambda view: float(np.hypot(*(view.pixels - middle).T).mean()))
    image = read_image(files[chosen.image], grey=False)
    pictures: list[tuple[str, ndarray | str]] = []
    makers: dict[str, Callable[[], Camera]] = {
        entry.name: partial(_camera_of, entry, training) for entry in with_skew((*PAPER, *SHOWN_BESIDE))
    }
    makers[PLUMB_LINE] = partial(
        _camera_of_edges, [files[v.image] for v in training.views if v.image in files]
    )
    for name, make in makers.items():
        try:
            camera = make()
            pictures.append(
                (f"{name}: {bent_px(camera, test):.3f} px off straight", undistort(image, camera))
            )
        except (CalibrationError, InputError) as error:
            pictures.append((name, str(error)))
    return Straightened(chosen.image, image, tuple(pictures))


def _camera_of(entry: PaperEntry, training: Detections) -> Camera:
    return entry.calibrate(training).camera


def _camera_of_edges(paths: list[Path]) -> Camera:
    """The plumb line's, which needs no corners: of the edges in photographs, whatever they show."""
    return lens_of_photographs(paths).camera


def obliqueness(fx: Float[ndarray, "*n"], skew: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
    """The paper's gamma: the angle between the pixel axes, degrees; 90 where the skew is 0."""
    return np.rad2deg(np.arctan2(fx, -skew))


def _points(detections: Detections, grid: tuple[int, int] | None) -> float:
    return float(np.prod(grid)) if grid else float(len(detections.target.points))
