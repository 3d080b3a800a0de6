"""transforms.json of nerfstudio and instant-ngp: one camera, and a pose for each photograph.

The centre of the first pixel is (0.5, 0.5). A pose is world from camera with OpenGL's axes: x right, y up, z
back. Both tools know k1, k2, p1, p2 and four coefficients of the fish-eye; nerfstudio takes k3 and k4 for
further terms of the polynomial, so a rational lens must never stand in this file.
"""

from __future__ import annotations

import json
import math
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

__all__ = ["NERFSTUDIO"]

# OpenGL's camera frame in ours: y and z point the other way.
OURS_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])
COEFFICIENTS = {"OPENCV": ("k1", "k2", "p1", "p2", "k3"), "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4")}


def _recognises(document: Document) -> bool:
    table = document.json
    return isinstance(table, dict) and bool({"fl_x", "camera_angle_x"} & _first_camera(table).keys())


def _first_camera(table: dict[str, Any]) -> dict[str, Any]:
    """The object that has the camera's numbers: the file itself, or its first photograph."""
    frames = table.get("frames")
    if "fl_x" in table or "camera_angle_x" in table or not (isinstance(frames, list) and frames):
        return table
    return {**table, **frames[0]} if isinstance(frames[0], dict) else table


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    table = _first_camera(document.json)
    if image_size is None:
        if "w" not in table or "h" not in table:
            raise document.refuse(
                "does not say how large its images are (w, h)", "Hand in image_size (--image-size 640x480)."
            )
        image_size = whole_number(table["w"], "w", document), whole_number(table["h"], "h", document)
    width, height = image_size
    fl_x = _focal(table, "fl_x", "camera_angle_x", width, document)
    fl_y = _focal(table, "fl_y", "camera_angle_y", height, document) if _has_fl_y(table) else fl_x
    cx = number(table.get("cx", 0.5 * width), "cx", document)
    cy = number(table.get("cy", 0.5 * height), "cy", document)
    wide = table.get("camera_model") == "OPENCV_FISHEYE" or table.get("is_fisheye") is True
    word = "OPENCV_FISHEYE" if wide else "OPENCV"
    known = {
        name: number(table.get(name, 0.0), name, document) for name in ("k1", "k2", "k3", "k4", "p1", "p2")
    }
    if not wide and known["k4"]:
        raise document.refuse("has a term k4 of the 8th power, which no lens here has", "Fit it without k4.")
    lens = NERFSTUDIO.lens(word, [known[name] for name in COEFFICIENTS[word]], document)
    camera = Camera(image_size, Intrinsics(fl_x, fl_y, cx, cy), lens)
    return {"camera": Contents(camera, _poses(document))}


def _has_fl_y(table: dict[str, Any]) -> bool:
    return "fl_y" in table or "camera_angle_y" in table


def _focal(table: dict[str, Any], focal: str, angle: str, side: int, document: Document) -> float:
    if focal in table:
        return number(table[focal], focal, document)
    half = 0.5 * number(table.get(angle), angle, document)
    if not 0 < half < 0.5 * math.pi:
        raise document.refuse(f"has {2 * half:g} as {angle}; expected radians between 0 and pi")
    return 0.5 * side / math.tan(half)


def _poses(document: Document) -> dict[str, Pose]:
    """camera_from_world by photograph."""
    poses = {}
    frames = document.json.get("frames", [])
    for frame in frames if isinstance(frames, list) else []:
        if not isinstance(frame, dict) or "transform_matrix" not in frame:
            continue
        name = str(frame.get("file_path", f"frame{len(poses)}"))
        values = numbers(frame["transform_matrix"], f"transform_matrix of {name[:40]}", document)
        if len(values) not in (12, 16):
            raise document.refuse(f"has a transform_matrix of {len(values)} numbers; expected 4 by 4")
        world_from_opengl = np.array(values[:12]).reshape(3, 4)
        rotation = world_from_opengl[:, :3] @ OURS_FROM_OPENGL
        try:
            poses[name] = Pose(rotation, world_from_opengl[:, 3]).inverse()
        except InputError as error:
            raise document.refuse(f"has a transform_matrix that is no rigid motion: {error}") from error
    return poses


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = NERFSTUDIO.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    width, height = camera.image_size
    fx, fy, cx, cy, _ = camera.intrinsics.as_tuple()
    values = dict(zip(holding.coefficients, holding.values(camera.lens), strict=True))
    table: dict[str, Any] = {
        "camera_model": holding.word,
        "w": width,
        "h": height,
        "fl_x": fx,
        "fl_y": fy,
        "cx": cx,
        "cy": cy,
        **values,
    }
    if holding.word == "OPENCV_FISHEYE":
        table["is_fisheye"] = True
    table["frames"] = [
        {"file_path": image, "transform_matrix": _opengl_matrix(pose)}
        for image, pose in contents.poses.items()
    ]
    return {place: json.dumps(table, indent=2) + "\n"}


def _opengl_matrix(camera_from_world: Pose) -> list[list[float]]:
    world_from_camera = camera_from_world.inverse()
    rotation = world_from_camera.rotation @ OURS_FROM_OPENGL
    rows = np.hstack([rotation, world_from_camera.translation[:, None]]).tolist()
    return [*rows, [0.0, 0.0, 0.0, 1.0]]


NERFSTUDIO = Format(
    name="nerfstudio",
    title="nerfstudio and instant-ngp transforms.json",
    suffixes=(".json",),
    holdings=(
        Holding("brown", "OPENCV", ("k1", "k2", "p1", "p2")),
        Holding("brown", "OPENCV", ("k1", "k2", "p1", "p2", "k3"), written=False),
        Holding("kannala_brandt", "OPENCV_FISHEYE", ("k1", "k2", "k3", "k4")),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    pixel_origin=0.5,
    poses=True,
    remarks="instant-ngp knows no k3 of a lens of the plane, so none is written; nerfstudio's is read.",
)
