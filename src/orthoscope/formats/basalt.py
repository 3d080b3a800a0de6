"""basalt's calibration (JSON of cereal): cameras by number, kb4, ds, eucm, ucm, pinhole and pinhole-radtan8.

The file holds the inertial sensor too; what is not known of it is written as basalt's defaults, for a camera
that stands in the sensor's frame.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, number, numbers, whole_number
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.opencv_order import OPENCV_ORDER

__all__ = ["BASALT"]

FOCAL = ("fx", "fy", "cx", "cy")


def _recognises(document: Document) -> bool:
    table = document.json
    return (
        isinstance(table, dict) and isinstance(table.get("value0"), dict) and "intrinsics" in table["value0"]
    )


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    table = document.json["value0"]
    cameras, sizes = table["intrinsics"], table.get("resolution", [])
    if not isinstance(cameras, list) or not isinstance(sizes, list):
        raise document.refuse("has no list of intrinsics; expected basalt's calibration")
    return {
        f"cam{i}": Contents(_camera(camera, i, sizes, document, image_size), name=f"cam{i}")
        for i, camera in enumerate(cameras)
    }


def _camera(
    camera: Any, i: int, sizes: list[Any], document: Document, image_size: tuple[int, int] | None
) -> Camera:
    values = camera.get("intrinsics") if isinstance(camera, dict) else None
    if not isinstance(values, dict):
        raise document.refuse(f"has no intrinsics of camera {i}; expected fx, fy, cx, cy and coefficients")
    word = str(camera.get("camera_type"))
    names = next((holding.coefficients for holding in BASALT.holdings if holding.word == word), ())
    lens = BASALT.lens(word, [number(values.get(name), name, document) for name in names], document)
    if image_size is None:
        size = numbers(sizes[i] if i < len(sizes) else None, f"resolution of camera {i}", document, count=2)
        image_size = whole_number(size[0], "width", document), whole_number(size[1], "height", document)
    return Camera(image_size, Intrinsics(*(number(values.get(name), name, document) for name in FOCAL)), lens)


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = BASALT.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    values = dict(zip(FOCAL, camera.intrinsics.as_tuple()[:4], strict=True))
    values |= dict(zip(holding.coefficients, holding.values(camera.lens), strict=True))
    if holding.word == "pinhole-radtan8":
        values["rpmax"] = 0.0
    table = {
        "T_imu_cam": [{"px": 0.0, "py": 0.0, "pz": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}],
        "intrinsics": [{"camera_type": holding.word, "intrinsics": values}],
        "resolution": [list(camera.image_size)],
        "calib_accel_bias": [0.0] * 9,
        "calib_gyro_bias": [0.0] * 12,
        "imu_update_rate": 200.0,
        "accel_noise_std": [0.016] * 3,
        "gyro_noise_std": [0.000282] * 3,
        "accel_bias_std": [0.001] * 3,
        "gyro_bias_std": [0.0001] * 3,
        "cam_time_offset_ns": 0,
        "vignette": [],
    }
    return {place: json.dumps({"value0": table}, indent=2) + "\n"}


BASALT = Format(
    name="basalt",
    title="basalt calibration JSON",
    suffixes=(".json",),
    holdings=(
        Holding("brown", "pinhole", ()),
        Holding("brown", "pinhole-radtan8", OPENCV_ORDER[:8]),
        Holding("rational", "pinhole-radtan8", OPENCV_ORDER[:8]),
        Holding("kannala_brandt", "kb4", ("k1", "k2", "k3", "k4")),
        Holding("double_sphere", "ds", ("xi", "alpha")),
        Holding("eucm", "eucm", ("alpha", "beta")),
        Holding("eucm", "ucm", ("alpha",), written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    remarks="The inertial sensor's numbers are basalt's defaults, the camera stands in its frame.",
)
