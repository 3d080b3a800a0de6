"""ROS's camera_info as camera_calibration_parsers reads it: YAML with camera, distortion, rectification,
projection.

plumb_bob has 5 coefficients, rational_polynomial 8, equidistant the 4 of cv2.fisheye. A topic's message as
`rostopic echo` prints it (K, D) is read by foxglove.py, which has the same fields.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, matrix, whole_number, yaml_list
from orthoscope.geometry.arrays import ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.opencv_order import OPENCV_ORDER

__all__ = ["ROS", "camera_of_matrix"]


def _recognises(document: Document) -> bool:
    return (
        document.xml is None
        and "camera_matrix" in document.table
        and bool({"image_width", "projection_matrix", "distortion_model"} & document.table.keys())
    )


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    table = document.table
    model = str(table.get("distortion_model", "plumb_bob"))
    if "distortion_coefficients" not in table:
        raise document.refuse("has no distortion_coefficients; expected ROS's camera_info")
    values = matrix(table["distortion_coefficients"], "distortion_coefficients", document).ravel().tolist()
    if model == "plumb_bob" and len(values) == 4:
        values = [*values, 0.0]
    size = image_size or (
        whole_number(table.get("image_width"), "image_width", document),
        whole_number(table.get("image_height"), "image_height", document),
    )
    lens = ROS.lens(model, values, document) if values else ROS.lens("plumb_bob", [0.0] * 5, document)
    intrinsics = camera_of_matrix(matrix(table["camera_matrix"], "camera_matrix", document), document)
    name = str(table.get("camera_name", "camera"))
    return {name: Contents(Camera(size, intrinsics, lens), name=name)}


def camera_of_matrix(values: ndarray, document: Document) -> Intrinsics:
    """The pin-hole of a 3x3 matrix.

    Raises:
        InputError: it is no such matrix, or has a skew.
    """
    if values.size != 9:
        raise document.refuse(f"has a camera matrix of {values.size} numbers; expected 3 by 3")
    (fx, skew, cx), (low, fy, cy), last = values.reshape(3, 3).tolist()
    if skew != 0.0 or low != 0.0 or last != [0.0, 0.0, 1.0]:
        raise document.refuse("has a camera matrix with more than fx, fy, cx and cy; expected no skew")
    return Intrinsics(fx, fy, cx, cy)


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = ROS.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    width, height = camera.image_size
    intrinsics = camera.intrinsics.matrix

    def block(name: str, values: ndarray) -> str:
        return f"{name}:\n  rows: {values.shape[0]}\n  cols: {values.shape[1]}\n  data: {yaml_list(values)}\n"

    return {
        place: f"image_width: {width}\nimage_height: {height}\ncamera_name: {contents.name}\n"
        + block("camera_matrix", intrinsics)
        + f"distortion_model: {holding.word}\n"
        + block("distortion_coefficients", np.array([holding.values(camera.lens)]))
        + block("rectification_matrix", np.eye(3))
        + block("projection_matrix", np.hstack([intrinsics, np.zeros((3, 1))]))
    }


ROS = Format(
    name="ros",
    title="ROS camera_info",
    suffixes=(".yaml", ".yml"),
    holdings=(
        Holding("brown", "plumb_bob", OPENCV_ORDER[:5]),
        Holding("rational", "rational_polynomial", OPENCV_ORDER[:8]),
        Holding("kannala_brandt", "equidistant", ("k1", "k2", "k3", "k4"), farthest_deg=90.0),
        Holding("kannala_brandt", "fisheye", ("k1", "k2", "k3", "k4"), written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    remarks="Its nodes straighten with cv2.fisheye, which ends at 90 degrees.",
)
