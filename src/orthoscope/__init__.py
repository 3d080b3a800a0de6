"""orthoscope: photographs of a flat target in, a camera that can be trusted out.

    >>> import orthoscope
    >>> detections = orthoscope.detect("photos/", "chessboard:9x6:25mm")
    >>> calibration = orthoscope.calibrate(detections)
    >>> evaluation = orthoscope.evaluate(calibration)
    >>> orthoscope.save(calibration, "calibration.json")

Names are loaded when they are first used, so that `import orthoscope` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from orthoscope.version import __version__ as __version__

if TYPE_CHECKING:
    from orthoscope.evaluation.compare import Comparison as Comparison
    from orthoscope.evaluation.compare import compare as compare
    from orthoscope.evaluation.difference import image_difference as image_difference
    from orthoscope.evaluation.evaluate import Evaluation as Evaluation
    from orthoscope.evaluation.evaluate import evaluate as evaluate
    from orthoscope.evaluation.metrics import normalised_calibration_error as normalised_calibration_error
    from orthoscope.evaluation.render import render as render
    from orthoscope.evaluation.simulate import Scene as Scene
    from orthoscope.evaluation.simulate import simulate_detections as simulate_detections
    from orthoscope.geometry.arrays import CalibrationError as CalibrationError
    from orthoscope.geometry.arrays import InputError as InputError
    from orthoscope.geometry.pose import Pose as Pose
    from orthoscope.geometry.target import Detections as Detections
    from orthoscope.geometry.target import Target as Target
    from orthoscope.geometry.target import View as View
    from orthoscope.geometry.target import chessboard as chessboard
    from orthoscope.geometry.target import parse_target as parse_target
    from orthoscope.io.detect import detect as detect
    from orthoscope.io.export import export as export
    from orthoscope.io.images import read_image as read_image
    from orthoscope.io.images import write_image as write_image
    from orthoscope.io.own_json import load as load
    from orthoscope.io.own_json import load_camera as load_camera
    from orthoscope.io.own_json import save as save
    from orthoscope.io.undistort import undistort as undistort
    from orthoscope.methods import METHODS as METHODS
    from orthoscope.methods import calibrate as calibrate
    from orthoscope.methods.calibration import Calibration as Calibration
    from orthoscope.methods.held_out import held_out as held_out
    from orthoscope.methods.resection import resect as resect
    from orthoscope.models.camera import Camera as Camera
    from orthoscope.models.camera import Intrinsics as Intrinsics
    from orthoscope.models.lenses import LENSES as LENSES
    from orthoscope.models.target_shape import TargetShape as TargetShape
    from orthoscope.report.page import write_report as write_report

ROOMS = {
    "evaluation.compare": ("Comparison", "compare"),
    "evaluation.difference": ("image_difference",),
    "evaluation.evaluate": ("Evaluation", "evaluate"),
    "evaluation.metrics": ("normalised_calibration_error",),
    "evaluation.render": ("render",),
    "evaluation.simulate": ("Scene", "simulate_detections"),
    "geometry.arrays": ("CalibrationError", "InputError"),
    "geometry.pose": ("Pose",),
    "geometry.target": ("Detections", "Target", "View", "chessboard", "parse_target"),
    "io.detect": ("detect",),
    "io.export": ("export",),
    "io.images": ("read_image", "write_image"),
    "io.own_json": ("load", "load_camera", "save"),
    "io.undistort": ("undistort",),
    "methods": ("METHODS", "calibrate"),
    "methods.calibration": ("Calibration",),
    "methods.held_out": ("held_out",),
    "methods.resection": ("resect",),
    "models.camera": ("Camera", "Intrinsics"),
    "models.lenses": ("LENSES",),
    "models.target_shape": ("TargetShape",),
    "report.page": ("write_report",),
}
_ROOM_OF = {name: room for room, names in ROOMS.items() for name in names}

__all__ = sorted([*_ROOM_OF, "__version__"])  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _ROOM_OF:
        raise AttributeError(f"orthoscope has no {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(f"orthoscope.{_ROOM_OF[name]}"), name)


def __dir__() -> list[str]:
    return __all__
