"""A method of one's own in the paper's figures: OpenCV's calibrateCamera beside FCCM, NMLDC and MLDC.

A method is a function that takes detections and returns a calibration, nothing more. It stands at the head
of a module, so that every process that runs trials can import it. From the command line the same is

    orthoscope paper --only fig4 --with OpenCV=own_method:opencv_calibration

and a package that declares it as an entry point of the group `orthoscope.methods` has it in every verb:

    [project.entry-points."orthoscope.methods"]
    opencv = "own_method:opencv_calibration"
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from orthoscope.fitting.calibration import Calibration, Uncertainty
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.paper.documents import documents
from orthoscope.paper.entries import PaperEntry
from orthoscope.paper.section4 import Plan, run
from orthoscope.targets.detections import Detections


def opencv_calibration(detections: Detections) -> Calibration:
    """Five coefficients by cv2.calibrateCamera."""
    points = [detections.target.points[view.ids].astype(np.float32) for view in detections.views]
    pixels = [view.pixels.astype(np.float32) for view in detections.views]
    _, K, distortion, turns, places = cv2.calibrateCamera(points, pixels, detections.image_size, None, None)
    k1, k2, p1, p2, k3 = distortion.ravel()[:5].tolist()
    return Calibration(
        camera=Camera(
            detections.image_size,
            Intrinsics(K[0, 0], K[1, 1], K[0, 2], K[1, 2]),
            Brown(k1=k1, k2=k2, p1=p1, p2=p2, k3=k3),
        ),
        camera_from_target=tuple(
            Pose(cv2.Rodrigues(turn)[0], place.ravel()) for turn, place in zip(turns, places, strict=True)
        ),
        detections=detections,
        method="opencv",
        settings={},
        uncertainty=Uncertainty((), np.empty((0, 0))),
        status="as OpenCV left it",
        steps=0,
        version=cv2.__version__,
    )


def main() -> None:
    """Run fig. 4 with it and write the page and the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one trial on few corners")
    parser.add_argument("--out", type=Path, default=Path("paper"))
    told = parser.parse_args()
    mine = PaperEntry("OpenCV", opencv_calibration, {})
    plan = Plan.quick(trials=1) if told.quick else Plan(trials=5, points=((3, 4), (7, 10), (14, 20)))
    plan = replace(plan, only=("fig4",), own=(mine,))
    with ProcessPoolExecutor(2) as executor:
        made = documents(run(plan, executor=executor))
    told.out.mkdir(parents=True, exist_ok=True)
    for name, text in made.texts.items():
        (told.out / name).write_text(text)
    print(made.headline)


if __name__ == "__main__":
    main()
