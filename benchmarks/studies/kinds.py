"""Every kind of target on rendered photographs: corner error, time, and the camera that it gives.

    python -m benchmarks.studies.kinds                  the table of docs/targets.md, eight photographs each
    python -m benchmarks.studies.kinds --cameras        also cameras from three times eight, against the truth

Photographs are 1280x960, lens `brown` (k1 = -.25), blur .7 px, noise 2 grey levels, tilts to 52 degrees.
Errors are rms distances from the truth over all corners found, of discs from the centre of the outline;
beside them stand OpenCV's finders on the same pictures. Times are of the process, a photograph in the mean. A
camera is `fccm` with the lens that took the photographs; its error is the largest of fx, fy, cx and cy over
three sets, and the rms of all of these in their own standard errors, of which the largest of a set alone is
beyond two in one of eight.
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.studies.opencv_finders import FINDERS, apart
from benchmarks.studies.true_places import margin_of, true_places
from orthoscope.detection.detect import detect
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods import calibrate
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer
from orthoscope.simulation.scene import random_views
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

__all__ = ["KINDS", "camera_error", "photographs_of"]

CAMERA = Camera((1280, 960), Intrinsics(900.0, 898.0, 643.0, 477.0), Brown(k1=-0.25, k2=0.06))
TILTS = (0.0, 0.9)
# A camera is made of each of these sets of photographs, by their seeds.
CAMERA_SETS = (1, 2, 3)


class Photograph(NamedTuple):
    """A picture, and where each corner, or the centre of each disc's outline, truly is."""

    picture: ndarray
    truth: Float[ndarray, "m 2"]


def photographs_of(target: Target, count: int, *, seed: int = 0, camera: Camera = CAMERA) -> list[Photograph]:
    """So many photographs of a target, all of it in each."""
    rng, renderer = np.random.default_rng(seed), Renderer(camera)
    views = random_views(
        camera, target, count, rng=rng, tilt=TILTS, fill=(0.6, 0.9), margin=margin_of(target)
    )
    found = []
    for pose in views:
        truth = true_places(camera, target, pose)
        found.append(Photograph(renderer.photograph(target, pose, rng=rng), truth))
    return found


KINDS = (
    "chessboard:9x6:25mm",
    "marked:14x9:25mm",
    "charuco:10x7:25mm:18mm:DICT_5X5_100",
    "aprilgrid:6x5:30mm:0.3",
    "aruco:6x5:30mm:10mm:DICT_5X5_100",
    "circles:4x11:20mm:asymmetric",
    "circles:4x11:20mm:asymmetric:14mm",
    "circles:9x7:20mm:symmetric:10mm",
)


def _told(spec: str, count: int) -> str:
    target = parse_target(spec)
    shown = photographs_of(target, count)
    ours, spent, errors = 0, 0.0, []
    theirs, their_time, their_errors = 0, 0.0, []
    for picture, truth in shown:
        before = time.process_time()
        sight = see(picture, target)
        spent += time.process_time() - before
        if isinstance(sight, Sight):
            ways = [np.arange(len(truth)), *target.symmetries()]
            off = min((np.hypot(*(truth[way[sight.ids]] - sight.pixels).T) for way in ways), key=np.max)
            ours, errors = ours + len(off), [*errors, *off]
        before = time.process_time()
        found = FINDERS[target.kind](picture, target)
        their_time += time.process_time() - before
        off = apart(found, truth)
        theirs, their_errors = theirs + len(off), [*their_errors, *off]
    every = sum(len(truth) for _, truth in shown)
    return (
        f"| `{spec}` | **{_rms(errors):.3f} px** (worst {max(errors, default=np.nan):.2f}),"
        f" {ours} of {every}, {1e3 * spent / count:.0f} ms |"
        f" {_rms(their_errors):.3f} px, {theirs} of {every}, {1e3 * their_time / count:.0f} ms |"
    )


def _rms(errors: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else float("nan")


def camera_error(spec: str, count: int, *, camera: Camera = CAMERA) -> tuple[float, float]:
    """The largest error of fx, fy, cx and cy from photographs of a target, px, and their rms in standard
    errors, over some sets of so many.
    """
    target = parse_target(spec)
    off, in_errors = [], []
    for seed in CAMERA_SETS:
        shown = photographs_of(target, count, seed=seed, camera=camera)
        pictures = {f"{i:02d}": one.picture for i, one in enumerate(shown)}
        calibration = calibrate(detect(pictures, target, jobs=1), method="fccm", lens="brown:k1,k2")
        for name in ("fx", "fy", "cx", "cy"):
            off.append(abs(getattr(calibration.camera.intrinsics, name) - getattr(camera.intrinsics, name)))
            in_errors.append(off[-1] / calibration.uncertainty.deviations[name])
    return max(off), _rms(in_errors)


def main() -> None:
    """What the module's docstring says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cameras", action="store_true")
    parser.add_argument("--count", type=int, default=8)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    print("| target | orthoscope | OpenCV on the same pictures |\n|---|---|---|")
    for spec in KINDS:
        print(_told(spec, given.count), flush=True)
    for spec in KINDS if given.cameras else ():
        error, errors = camera_error(spec, 8)
        print(
            f"camera by {spec}: off by {error:.3f} px at most, {errors:.1f} standard errors rms", flush=True
        )


if __name__ == "__main__":
    main()
