"""Halves of real sets of photographs: how far apart are their cameras, and how far were they said to be?

    ORTHOSCOPE_DATASETS=photographs python -m benchmarks.studies.halves [--splits 4] [detections.json ...]

Views are dealt into two halves at random; each is calibrated by itself, as a user would.  The two cameras
share target and camera and nothing else, so the rms difference of their images over the part that both saw,
over the root of the sum of the squares of what each was said to be off by, is 1 in the mean where the
prediction is right; what halves share (what a target and a lens hide from every view) they cannot show.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.real_sets import SETS, babel_cube, classic_corners, datasets
from orthoscope import CalibrationError, Detections, load_detections
from orthoscope.evaluation.camera_error import rms_difference, seen_places
from orthoscope.evaluation.evaluate import examine
from orthoscope.evaluation.verdict.facts import situation_of
from orthoscope.methods import calibrate
from orthoscope.models.camera import Camera

__all__ = ["Split", "split"]

# Sets of fewer views have halves that are too small to say anything.
FEWEST_VIEWS = 14


class Split(NamedTuple):
    """Two halves.

    Args:
        apart_px: rms difference of the two cameras' images over the part that was seen.
        said_px: root of the sum of the squares of what each was said to be off by.
    """

    apart_px: float
    said_px: float


def split(detections: Detections, seed: int) -> Split | None:
    """What two halves of the views give; None where one gives no camera.

    Args:
        seed: of how views are dealt.
    """
    order = np.random.default_rng(seed).permutation(len(detections.views))
    try:
        (one, first_px), (other, second_px) = (
            _judged(detections.only(np.sort(half))) for half in np.array_split(order, 2)
        )
    except CalibrationError:
        return None
    seen = seen_places(np.concatenate([view.pixels for view in detections.views]))
    return Split(rms_difference(other, one, seen), float(np.hypot(first_px, second_px)))


def _judged(detections: Detections) -> tuple[Camera, float]:
    """The camera of these views, and how far it is said to be off."""
    calibration = calibrate(detections)
    return calibration.camera, situation_of(examine(calibration)).error_px


def _sets(files: Sequence[Path]) -> Iterator[tuple[str, Detections]]:
    """Real sets with views enough."""
    folder = datasets()
    if folder:
        yield from ((name, classic_corners(folder, name)) for name in SETS)
        cube, training = babel_cube(folder)
        yield "babel-cube", cube.only(np.arange(training))
    yield from ((path.stem, load_detections(path)) for path in files)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each set, and the figures over all of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", type=Path, nargs="*", help="corner tables of further sets")
    parser.add_argument("--splits", type=int, default=4)
    asked = parser.parse_args(arguments)
    print("| set | views a half | apart, px | said, px | apart over said, rms |\n|---|---|---|---|---|")
    ratios = []
    for name, detections in _sets(asked.files):
        if len(detections.views) < FEWEST_VIEWS:
            continue
        found = [s for seed in range(asked.splits) if (s := split(detections, seed))]
        apart, said = (np.sqrt(np.mean(np.square(column))) for column in zip(*found, strict=True))
        ratios.append(float(np.sqrt(np.mean([(s.apart_px / s.said_px) ** 2 for s in found]))))
        half = len(detections.views) // 2
        print(f"| {name} | {half} | {apart:.2f} | {said:.2f} | {ratios[-1]:.2f} |", flush=True)
    over_all = np.sqrt(np.mean(np.square(ratios)))
    print(f"\n{len(ratios)} sets, {asked.splits} splits each: {over_all:.2f}, the worst {max(ratios):.2f}")


if __name__ == "__main__":
    main()
