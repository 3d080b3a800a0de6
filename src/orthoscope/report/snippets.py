"""The camera in the words of the tool that it is used with next, to be copied from the page.

A lens that a tool does not have is given as the nearest formula that it has, with what that costs. Where that
would be more than the calibration itself is off, the page says so.
"""

from __future__ import annotations

from typing import NamedTuple

from orthoscope.fitting.calibration import Calibration
from orthoscope.formats.export import EXPORTERS, exportable
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.geometry.numbers import pixels
from orthoscope.models.camera import Camera
from orthoscope.models.lenses import KannalaBrandt

__all__ = ["Snippet", "snippets"]

TOOLS = {"opencv": "OpenCV", "ros": "ROS"}  # of EXPORTERS, as they call themselves


class Snippet(NamedTuple):
    """A text to copy.

    Args:
        tool: whose it is.
        text: what to copy.
        remark: what it costs, or why there is none; may be empty.
    """

    tool: str
    text: str
    remark: str = ""


def snippets(calibration: Calibration) -> list[Snippet]:
    """For OpenCV, ROS and Python, in this order."""
    told = [_of_tool(calibration, name, title) for name, title in TOOLS.items()]
    return [*told, _python(calibration)]


def _of_tool(calibration: Calibration, name: str, title: str) -> Snippet:
    try:
        found = exportable(calibration.camera, name, made_from=calibration)
        return Snippet(title, EXPORTERS[name].text(found.camera), _cost(found.apart_px, found.farthest_px))
    except (InputError, CalibrationError) as error:
        return Snippet(title, "", str(error))


def _python(calibration: Calibration) -> Snippet:
    """K and the coefficients as arrays, in OpenCV's order where OpenCV has the lens; else by our own package."""
    try:
        found = exportable(calibration.camera, "opencv", made_from=calibration)
        text = _arrays(found.camera)
    except (InputError, CalibrationError):
        text = 'import orthoscope\n\ncamera = orthoscope.load_camera("calibration.json")\n'
        return Snippet("Python", text)
    return Snippet("Python", text, _cost(found.apart_px, found.farthest_px))


def _arrays(camera: Camera) -> str:
    K, dist = camera.opencv()
    rows = ",\n              ".join(str(row) for row in K.tolist())
    fisheye = ".fisheye" if isinstance(camera.lens, KannalaBrandt) else ""
    return (
        f"import numpy as np\n\nK = np.array([{rows}])\n"
        f"dist = np.array({dist.tolist()})  # of cv2{fisheye}\n"
        f"size = {tuple(camera.image_size)}  # width, height\n"
    )


def _cost(apart_px: float, farthest_px: float) -> str:
    if not apart_px > 0.0:
        return ""
    return (
        f"The nearest formula that this tool has; {pixels(apart_px)} px off on average where corners were"
        f" seen, {pixels(farthest_px)} px at most."
    )
