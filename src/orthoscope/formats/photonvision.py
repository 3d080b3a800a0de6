"""PhotonVision's camera calibration (JSON): OpenCV's matrix and 5 or 8 coefficients, made by mrcal or OpenCV.

Older versions called the coefficients `cameraExtrinsics`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.ros import camera_of_matrix
from orthoscope.formats.syntax import Document, matrix, whole_number
from orthoscope.geometry.arrays import ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.opencv_order import OPENCV_ORDER

__all__ = ["PHOTONVISION"]

# This is OpenCV's number for a matrix of doubles.
DOUBLES_TYPE = 6


def _recognises(document: Document) -> bool:
    return isinstance(document.json, dict) and "cameraIntrinsics" in document.json


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    table = document.json
    coefficients = table.get("distCoeffs", table.get("cameraExtrinsics"))
    values = [] if coefficients is None else matrix(coefficients, "distCoeffs", document).ravel().tolist()
    resolution = table.get("resolution")
    if image_size is None:
        sides = resolution if isinstance(resolution, dict) else {}
        image_size = (
            whole_number(sides.get("width"), "width of the resolution", document),
            whole_number(sides.get("height"), "height of the resolution", document),
        )
    intrinsics = camera_of_matrix(matrix(table["cameraIntrinsics"], "cameraIntrinsics", document), document)
    return {"camera": Contents(Camera(image_size, intrinsics, PHOTONVISION.lens("opencv", values, document)))}


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = PHOTONVISION.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"

    def block(values: ndarray) -> dict[str, Any]:
        rows, columns = values.shape
        return {"rows": rows, "cols": columns, "type": DOUBLES_TYPE, "data": values.ravel().tolist()}

    width, height = camera.image_size
    table = {
        "resolution": {"width": float(width), "height": float(height)},
        "cameraIntrinsics": block(camera.intrinsics.matrix),
        "distCoeffs": block(np.array([holding.values(camera.lens)])),
        "calobjectWarp": [],
        "observations": [],
        "calobjectSize": {"width": 0.0, "height": 0.0},
        "calobjectSpacing": 0.0,
        "lensmodel": "LENSMODEL_OPENCV",
    }
    return {place: json.dumps(table, indent=2) + "\n"}


PHOTONVISION = Format(
    name="photonvision",
    title="PhotonVision calibration JSON",
    suffixes=(".json",),
    holdings=(
        Holding("brown", "opencv", OPENCV_ORDER[:5]),
        Holding("rational", "opencv", OPENCV_ORDER[:8]),
        Holding("brown", "opencv", OPENCV_ORDER[:4], written=False),
        Holding("brown", "opencv", (), written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    remarks="The corners that it keeps for its own display are not written.",
)
