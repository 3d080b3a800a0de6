"""OpenMVG's sfm_data.json: intrinsics with one focal length, and the photographs' poses.

Distortion of pinhole_brown_t2 is k1 k2 k3 t1 t2, t1 and t2 being OpenCV's p1 and p2; fisheye has the four
coefficients of the angle. A pose is a rotation, camera from world, and the camera's centre in the world.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, number, numbers, whole_number
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics

__all__ = ["OPENMVG"]

# Where a model's coefficients stand in the file.
FIELDS = {
    "pinhole_radial_k1": "disto_k1",
    "pinhole_radial_k3": "disto_k3",
    "pinhole_brown_t2": "disto_t2",
    "fisheye": "fisheye",
}
# Marks of cereal, the library that writes these files: an object seen for the first time, of a named or plain
# kind.
FIRST, PLAIN = 0x80000000, 0x40000000


def _recognises(document: Document) -> bool:
    return isinstance(document.json, dict) and "sfm_data_version" in document.json


def _entries(table: Any, name: str) -> list[tuple[str, dict[str, Any]]]:
    """Key and value of a cereal map's entries."""
    entries = table.get(name)
    return [
        (str(entry.get("key")), entry["value"])
        for entry in (entries if isinstance(entries, list) else [])
        if isinstance(entry, dict) and isinstance(entry.get("value"), dict)
    ]


def _data(value: dict[str, Any]) -> dict[str, Any]:
    """The fields of an object, those of its base classes (value0) among them."""
    wrapper = value.get("ptr_wrapper")
    data = wrapper.get("data") if isinstance(wrapper, dict) else None
    flat: dict[str, Any] = {}
    while isinstance(data, dict):
        flat = {**data, **flat}
        data = data.get("value0")
    return flat


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    words, cameras = {}, {}
    poses = _poses(document)
    for key, value in _entries(document.json, "intrinsics"):
        if "polymorphic_name" in value:
            words[number(value.get("polymorphic_id"), "polymorphic_id", document) % FIRST] = str(
                value["polymorphic_name"]
            )
        word = words.get(number(value.get("polymorphic_id"), "polymorphic_id", document) % FIRST, "?")
        data = _data(value)
        size = image_size or (
            whole_number(data.get("width"), "width", document),
            whole_number(data.get("height"), "height", document),
        )
        focal = number(data.get("focal_length"), "focal_length", document)
        cx, cy = numbers(data.get("principal_point"), "principal_point", document, count=2)
        coefficients = numbers(data.get(FIELDS.get(word, ""), []), "distortion", document)
        camera = Camera(size, Intrinsics(focal, focal, cx, cy), OPENMVG.lens(word, coefficients, document))
        cameras[key] = Contents(camera, poses, name=key)
    if not cameras:
        raise document.refuse("has no intrinsics; expected at least one camera")
    return cameras


def _poses(document: Document) -> dict[str, Pose]:
    images = {}
    for _, value in _entries(document.json, "views"):
        data = _data(value)
        images[str(data.get("id_pose"))] = str(data.get("filename"))
    poses = {}
    for key, value in _entries(document.json, "extrinsics"):
        rotation = np.array(
            numbers(value.get("rotation"), f"rotation {key[:20]}", document, count=9)
        ).reshape(3, 3)
        centre = np.array(numbers(value.get("center"), f"center {key[:20]}", document, count=3))
        try:
            poses[images.get(key, key)] = Pose(rotation, -rotation @ centre)
        except InputError as error:
            raise document.refuse(f"has a rotation that is none: {error}") from error
    return poses


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = OPENMVG.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    width, height = camera.image_size
    data: dict[str, Any] = {
        "width": width,
        "height": height,
        "focal_length": camera.intrinsics.fx,
        "principal_point": [camera.intrinsics.cx, camera.intrinsics.cy],
    }
    if holding.word in FIELDS:
        data[FIELDS[holding.word]] = holding.values(camera.lens)
    table = {
        "sfm_data_version": "0.3",
        "root_path": "",
        "views": [_view(i, image, camera.image_size) for i, image in enumerate(contents.poses)],
        "intrinsics": [
            {
                "key": 0,
                "value": {
                    "polymorphic_id": FIRST + 1,
                    "polymorphic_name": holding.word,
                    "ptr_wrapper": {"id": FIRST + 1 + len(contents.poses), "data": data},
                },
            }
        ],
        "extrinsics": [
            {
                "key": i,
                "value": {"rotation": pose.rotation.tolist(), "center": pose.inverse().translation.tolist()},
            }
            for i, pose in enumerate(contents.poses.values())
        ],
        "structure": [],
        "control_points": [],
    }
    return {place: json.dumps(table, indent=1) + "\n"}


def _view(i: int, image: str, size: tuple[int, int]) -> dict[str, Any]:
    data = {
        "local_path": "",
        "filename": image,
        "width": size[0],
        "height": size[1],
        "id_view": i,
        "id_intrinsic": 0,
        "id_pose": i,
    }
    return {"key": i, "value": {"polymorphic_id": PLAIN, "ptr_wrapper": {"id": FIRST + 1 + i, "data": data}}}


OPENMVG = Format(
    name="openmvg",
    title="OpenMVG sfm_data.json",
    suffixes=(".json",),
    holdings=(
        Holding("brown", "pinhole_brown_t2", ("k1", "k2", "k3", "p1", "p2")),
        Holding("kannala_brandt", "fisheye", ("k1", "k2", "k3", "k4"), farthest_deg=90.0),
        Holding("brown", "pinhole", (), written=False),
        Holding("brown", "pinhole_radial_k1", ("k1",), written=False),
        Holding("brown", "pinhole_radial_k3", ("k1", "k2", "k3"), written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    two_focals=False,
    poses=True,
    remarks="Spherical cameras are not read.",
)
