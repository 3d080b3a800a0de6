"""The camera in the words of the tool that it is used with next, to be copied from the page.

A lens that a tool does not have is given as the nearest that it has, with what that costs.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from orthoscope.fitting.calibration import Calibration
from orthoscope.formats.export import Exportable, exportable
from orthoscope.formats.record import Contents, shifted
from orthoscope.formats.table import tool as record_of
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.geometry.numbers import pixels
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.table import KannalaBrandt

__all__ = ["Snippet", "snippets"]

# These formats are shown under the tools' own names.
TOOL_NAMES = {"opencv": "OpenCV", "ros": "ROS"}
OWN = 'import orthoscope\n\ncamera = orthoscope.load_camera("calibration.json")\n'


class Snippet(NamedTuple):
    """A text to copy.

    Attributes:
        tool: whose it is.
        text: what to copy.
        remark: what it costs, or why there is none; may be empty.
    """

    tool: str
    text: str
    remark: str = ""


def snippets(calibration: Calibration) -> list[Snippet]:
    """For OpenCV, ROS and Python, in this order."""
    told, held = [], {}
    for name, title in TOOL_NAMES.items():
        try:
            held[name] = exportable(calibration.camera, name, made_from=calibration)
            told.append(Snippet(title, _file(name, held[name].camera), _cost(held[name])))
        except (InputError, CalibrationError) as error:
            told.append(Snippet(title, "", str(error)))
    found = held.get("opencv")
    python = Snippet("Python", _arrays(found.camera), _cost(found)) if found else Snippet("Python", OWN)
    return [*told, python]


def _file(name: str, camera: Camera) -> str:
    """What the tool's usual file would hold."""
    record = record_of(name)
    path = Path(f"camera{record.suffixes[0]}")
    content = record.write(Contents(shifted(camera, record.pixel_origin)), path)[path]
    return content if isinstance(content, str) else content.decode()


def _arrays(camera: Camera) -> str:
    """K and the coefficients as cv2 takes them."""
    K, dist = camera.opencv()
    rows = ",\n              ".join(str(row) for row in K.tolist())
    fisheye = ".fisheye" if isinstance(camera.lens, KannalaBrandt) else ""
    return (
        f"import numpy as np\n\nK = np.array([{rows}])\n"
        f"dist = np.array({dist.tolist()})  # of cv2{fisheye}\n"
        f"size = {tuple(camera.image_size)}  # width, height\n"
    )


def _cost(held: Exportable) -> str:
    if not held.lacks:
        return ""
    return (
        f"The nearest that this tool can hold: {pixels(held.apart_px)} px off on average where corners were"
        f" seen, {pixels(held.farthest_px)} px at most."
    )
