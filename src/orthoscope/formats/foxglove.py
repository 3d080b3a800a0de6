"""Foxglove's CameraCalibration message (JSON), and ROS's camera_info as a topic prints it (JSON or YAML).

Both have width, height, distortion_model, D, K, R and P; ROS 2 writes the last four small.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.ros import camera_of_matrix
from orthoscope.formats.syntax import Document, numbers, whole_number
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.opencv_order import OPENCV_ORDER

__all__ = ["FOXGLOVE"]


def _recognises(document: Document) -> bool:
    return (
        document.xml is None
        and {"width", "height"} <= document.table.keys()
        and ({"K", "D"} <= document.table.keys() or {"k", "d"} <= document.table.keys())
    )


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    table = document.table
    size = image_size or (
        whole_number(table["width"], "width", document),
        whole_number(table["height"], "height", document),
    )
    model = str(table.get("distortion_model") or "plumb_bob")
    values = numbers(table.get("D", table.get("d")), "D", document) or [0.0] * 5
    intrinsics = numbers(table.get("K", table.get("k")), "K", document, count=9)
    lens = FOXGLOVE.lens(model, values, document)
    return {"camera": Contents(Camera(size, camera_of_matrix(np.array(intrinsics), document), lens))}


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = FOXGLOVE.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    width, height = camera.image_size
    table = {
        "timestamp": {"sec": 0, "nsec": 0},
        "frame_id": contents.name,
        "width": width,
        "height": height,
        "distortion_model": holding.word,
        "D": holding.values(camera.lens),
        "K": camera.intrinsics.matrix.ravel().tolist(),
        "R": np.eye(3).ravel().tolist(),
        "P": np.hstack([camera.intrinsics.matrix, np.zeros((3, 1))]).ravel().tolist(),
    }
    return {place: json.dumps(table, indent=2) + "\n"}


FOXGLOVE = Format(
    name="foxglove",
    title="Foxglove CameraCalibration",
    suffixes=(".json",),
    holdings=(
        Holding("brown", "plumb_bob", OPENCV_ORDER[:5]),
        Holding("rational", "rational_polynomial", OPENCV_ORDER[:8]),
        Holding("kannala_brandt", "kannala_brandt", ("k1", "k2", "k3", "k4"), farthest_deg=90.0),
        Holding("kannala_brandt", "equidistant", ("k1", "k2", "k3", "k4"), written=False),
        Holding("brown", "plumb_bob", OPENCV_ORDER[:4], written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    remarks="A message of ROS's topic camera_info is read too.",
)
