"""OpenCV's calibration files: YAML, XML or JSON of cv2.FileStorage.

OpenCV's own sample, its interactive tool and our export name the same things differently; all of these are
read. Coefficients stand in OpenCV's order, 4, 5, 8, 12 or 14 of cv2.calibrateCamera or 4 of cv2.fisheye, as
few as hold them all. `fisheye_model` is what OpenCV's sample looks for, `distortion_model` what our older
files have. The files are read without cv2.FileStorage, which ends the process on some damaged ones.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, matrix, number, whole_number, yaml_list
from orthoscope.geometry.arrays import ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.opencv_order import OPENCV_ORDER

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

__all__ = ["OPENCV"]

# Names by which a camera's matrix and coefficients go in OpenCV's samples, tools and tutorials.
MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "intrinsic_matrix", "mtx", "K", "M1")
COEFFICIENTS = (
    "distortion_coefficients",
    "dist_coeffs",
    "distCoeffs",
    "Distortion_Coefficients",
    "dist_coeff",
    "dist",
    "D",
    "D1",
)
WIDTH, HEIGHT = ("image_width", "image_Width"), ("image_height", "image_Height")
FISHEYE = ("opencv_fisheye", "fisheye", "equidistant")


def _recognises(document: Document) -> bool:
    if document.xml is not None:
        return document.xml.tag == "opencv_storage"
    if document.json is not None:
        return b'"opencv-matrix"' in document.content
    text = document.text or ""
    return text.startswith("%YAML:1.0") or "!!opencv-matrix" in text


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    table = _table_of(document.xml) if document.xml is not None else document.table
    if not isinstance(table, dict) or not table:
        raise document.refuse("cannot be read; expected YAML, XML or JSON as cv2.FileStorage writes it")
    intrinsics = _first_matrix(table, MATRIX, document)
    if intrinsics is None or intrinsics.shape != (3, 3):
        raise document.refuse(
            f"has no 3x3 matrix named {' or '.join(MATRIX[:2])}; expected a file of OpenCV's calibration"
        )
    if abs(intrinsics[0, 1]) > 0:
        raise document.refuse(
            f"has a skew of {intrinsics[0, 1]:g} px, which OpenCV itself leaves out",
            "Set it to 0 to read what OpenCV sees.",
        )
    coefficients = _first_matrix(table, COEFFICIENTS, document)
    if coefficients is None and "distortion_model" in table:
        raise document.refuse("names a distortion and has no coefficients of it; expected both")
    values = [] if coefficients is None else coefficients.ravel().tolist()
    lens = OPENCV.lens("cv2.fisheye" if _is_fisheye(table, document) else "cv2", values, document)
    size = image_size or _size(table, document)
    fx, fy, cx, cy = intrinsics[0, 0], intrinsics[1, 1], intrinsics[0, 2], intrinsics[1, 2]
    return {"camera": Contents(Camera(size, Intrinsics(fx, fy, cx, cy), lens))}


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = OPENCV.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    fields: dict[str, Any] = {
        "image_width": camera.image_size[0],
        "image_height": camera.image_size[1],
        "fisheye_model": int(holding.word == "cv2.fisheye"),
        "distortion_model": "opencv_fisheye" if holding.word == "cv2.fisheye" else "opencv",
        "camera_matrix": camera.intrinsics.matrix,
        "distortion_coefficients": np.array([holding.values(camera.lens)]),
    }
    return {place: WRITERS.get(place.suffix.lower(), _as_yaml)(fields)}


def _as_yaml(fields: dict[str, Any]) -> str:
    def line(name: str, value: Any) -> str:
        if isinstance(value, ndarray):
            rows, columns = value.shape
            return (
                f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data:"
                f" {yaml_list(value)}\n"
            )
        return f'{name}: "{value}"\n' if isinstance(value, str) else f"{name}: {value}\n"

    return "%YAML:1.0\n---\n" + "".join(line(name, value) for name, value in fields.items())


def _as_xml(fields: dict[str, Any]) -> str:
    def element(name: str, value: Any) -> str:
        if isinstance(value, ndarray):
            rows, columns = value.shape
            data = " ".join(repr(entry) for entry in value.ravel().tolist())
            return (
                f'<{name} type_id="opencv-matrix">\n  <rows>{rows}</rows>\n  <cols>{columns}</cols>\n'
                f"  <dt>d</dt>\n  <data>\n    {data}</data></{name}>\n"
            )
        return f"<{name}>{value}</{name}>\n"

    body = "".join(element(name, value) for name, value in fields.items())
    return f'<?xml version="1.0"?>\n<opencv_storage>\n{body}</opencv_storage>\n'


def _as_json(fields: dict[str, Any]) -> str:
    def plain(value: Any) -> Any:
        if isinstance(value, ndarray):
            rows, columns = value.shape
            data = value.ravel().tolist()
            return {"type_id": "opencv-matrix", "rows": rows, "cols": columns, "dt": "d", "data": data}
        return value

    return json.dumps({name: plain(value) for name, value in fields.items()}, indent=4) + "\n"


WRITERS = {".xml": _as_xml, ".json": _as_json}


def _table_of(root: Element) -> dict[str, Any]:
    """XML as what YAML and JSON give: elements by name, matrices as objects, the rest as text."""
    return {
        element.tag: {part.tag: (part.text or "").strip() for part in element}
        if len(element)
        else element.text
        for element in root
    }


def _first_matrix(table: dict[str, Any], names: tuple[str, ...], document: Document) -> ndarray | None:
    """The first matrix of these names."""
    name = next((name for name in names if table.get(name) is not None), None)
    return None if name is None else matrix(table[name], name, document)


def _is_fisheye(table: dict[str, Any], document: Document) -> bool:
    flag, model = table.get("fisheye_model"), table.get("distortion_model")
    flagged = flag is not None and number(flag, "fisheye_model", document) != 0
    return flagged or (isinstance(model, str) and model.strip('" ') in FISHEYE)


def _size(table: dict[str, Any], document: Document) -> tuple[int, int]:
    sides = []
    for names in (WIDTH, HEIGHT):
        name = next((name for name in names if name in table), None)
        if name is None:
            raise document.refuse(
                "does not say how large its images are (image_width, image_height)",
                "Hand in image_size (--image-size 640x480).",
            )
        sides.append(whole_number(table[name], name, document))
    return sides[0], sides[1]


OPENCV = Format(
    name="opencv",
    title="OpenCV (cv2.FileStorage)",
    suffixes=(".yaml", ".yml", ".xml", ".json"),
    holdings=(
        Holding("brown", "cv2", OPENCV_ORDER[:5]),
        Holding("rational", "cv2", OPENCV_ORDER[:8]),
        Holding(
            "kannala_brandt",
            "cv2.fisheye",
            ("k1", "k2", "k3", "k4"),
            farthest_deg=90.0,
            note="its coefficients are those of cv2.fisheye, not of cv2.undistort",
        ),
        Holding("brown", "cv2", OPENCV_ORDER[:12]),
        Holding("rational", "cv2", OPENCV_ORDER[:12]),
        Holding("brown", "cv2", OPENCV_ORDER),
        Holding("rational", "cv2", OPENCV_ORDER),
        Holding("brown", "cv2", OPENCV_ORDER[:4], written=False),
        Holding("brown", "cv2", (), written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    remarks="cv2.fisheye takes a ray from behind the camera for one in front of it.",
)
