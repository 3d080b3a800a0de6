"""orthoscope: photographs of a flat target in, a camera that can be trusted out.

    >>> import orthoscope
    >>> detections = orthoscope.detect("photos/", "chessboard:9x6:25mm")
    >>> calibration = orthoscope.calibrate(detections)
    >>> evaluation = orthoscope.evaluate(calibration)
    >>> orthoscope.save(calibration, "calibration.json")

What is public is what stands in `__all__` here; everything else may move. Names are loaded when they are
first used, so that `import orthoscope` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from orthoscope.version import __version__ as __version__

if TYPE_CHECKING:
    from orthoscope.detection.detect import detect as detect
    from orthoscope.evaluation.camera_check import CameraCheck as CameraCheck
    from orthoscope.evaluation.camera_check import check_camera as check_camera
    from orthoscope.evaluation.comparison.compare import Comparison as Comparison
    from orthoscope.evaluation.comparison.compare import compare as compare
    from orthoscope.evaluation.evaluate import Evaluation as Evaluation
    from orthoscope.evaluation.evaluate import UnseenError as UnseenError
    from orthoscope.evaluation.evaluate import evaluate as evaluate
    from orthoscope.evaluation.evaluate import evaluate_on as evaluate_on
    from orthoscope.evaluation.metrics import normalised_calibration_error as normalised_calibration_error
    from orthoscope.files.images import read_image as read_image
    from orthoscope.files.images import write_image as write_image
    from orthoscope.fitting.calibration import Calibration as Calibration
    from orthoscope.fitting.calibration import Uncertainty as Uncertainty
    from orthoscope.fitting.resection import resect as resect
    from orthoscope.fitting.unseen.held_out import held_out as held_out
    from orthoscope.formats.export import export as export
    from orthoscope.formats.load import load_camera as load_camera
    from orthoscope.formats.own.json import load as load
    from orthoscope.formats.own.json import load_calibration as load_calibration
    from orthoscope.formats.own.json import load_detections as load_detections
    from orthoscope.formats.own.json import load_evaluation as load_evaluation
    from orthoscope.formats.own.json import save as save
    from orthoscope.formats.table import FORMATS as FORMATS
    from orthoscope.geometry.arrays import CalibrationError as CalibrationError
    from orthoscope.geometry.arrays import InputError as InputError
    from orthoscope.geometry.pose import Pose as Pose
    from orthoscope.methods import METHODS as METHODS
    from orthoscope.methods import calibrate as calibrate
    from orthoscope.models.camera import Camera as Camera
    from orthoscope.models.difference import image_difference as image_difference
    from orthoscope.models.intrinsics import Intrinsics as Intrinsics
    from orthoscope.models.lenses.lens import Lens as Lens
    from orthoscope.models.lenses.table import LENSES as LENSES
    from orthoscope.models.target_shape import TargetShape as TargetShape
    from orthoscope.report.page import write_report as write_report
    from orthoscope.simulation.render import render as render
    from orthoscope.simulation.scene import Scene as Scene
    from orthoscope.simulation.scene import random_views as random_views
    from orthoscope.simulation.scene import simulate_detections as simulate_detections
    from orthoscope.straight.undistort import undistort as undistort
    from orthoscope.targets.detections import Detections as Detections
    from orthoscope.targets.detections import Outlier as Outlier
    from orthoscope.targets.detections import SetAside as SetAside
    from orthoscope.targets.detections import View as View
    from orthoscope.targets.table import parse_target as parse_target
    from orthoscope.targets.target import Target as Target
    from orthoscope.targets.target import chessboard as chessboard

ROOMS = {
    "detection.detect": ("detect",),
    "evaluation.camera_check": ("CameraCheck", "check_camera"),
    "evaluation.comparison.compare": ("Comparison", "compare"),
    "evaluation.evaluate": ("Evaluation", "UnseenError", "evaluate", "evaluate_on"),
    "evaluation.metrics": ("normalised_calibration_error",),
    "files.images": ("read_image", "write_image"),
    "fitting.calibration": ("Calibration", "Uncertainty"),
    "fitting.unseen.held_out": ("held_out",),
    "fitting.resection": ("resect",),
    "formats.export": ("export",),
    "formats.load": ("load_camera",),
    "formats.own.json": ("load", "load_calibration", "load_detections", "load_evaluation", "save"),
    "formats.table": ("FORMATS",),
    "geometry.arrays": ("CalibrationError", "InputError"),
    "geometry.pose": ("Pose",),
    "methods": ("METHODS", "calibrate"),
    "models.camera": ("Camera",),
    "models.difference": ("image_difference",),
    "models.intrinsics": ("Intrinsics",),
    "models.lenses.lens": ("Lens",),
    "models.lenses.table": ("LENSES",),
    "models.target_shape": ("TargetShape",),
    "report.page": ("write_report",),
    "simulation.render": ("render",),
    "simulation.scene": ("Scene", "random_views", "simulate_detections"),
    "straight.undistort": ("undistort",),
    "targets.detections": ("Detections", "Outlier", "SetAside", "View"),
    "targets.table": ("parse_target",),
    "targets.target": ("Target", "chessboard"),
}
_ROOM_OF = {name: room for room, names in ROOMS.items() for name in names}

__all__ = sorted([*_ROOM_OF, "__version__"])  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _ROOM_OF:
        raise AttributeError(f"orthoscope has no {name!r}; it has {', '.join(__all__)}")
    try:
        return getattr(importlib.import_module(f"orthoscope.{_ROOM_OF[name]}"), name)
    except ModuleNotFoundError as error:
        from orthoscope.machine.missing import how_to_install

        if (told := how_to_install(error)) is None:
            raise
        raise ModuleNotFoundError(told, name=error.name) from error


def __dir__() -> list[str]:
    return __all__
