"""Kalibr's camchain: YAML with a camera for each of cam0, cam1, ...; the pin-hole with radtan, equidistant or
fov.

radtan is k1 k2 p1 p2 of OpenCV, equidistant its fisheye, fov one angle. Of a chain each camera is read by its
name; its transformations between cameras are not.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, numbers, whole_number, yaml_list
from orthoscope.models.camera import Camera, Intrinsics

__all__ = ["KALIBR"]


def _recognises(document: Document) -> bool:
    return any(
        re.fullmatch(r"cam\d+", name) and isinstance(camera, dict) and "intrinsics" in camera
        for name, camera in document.table.items()
    )


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    return {
        name: Contents(_camera(camera, name, document, image_size), name=name)
        for name, camera in document.table.items()
        if re.fullmatch(r"cam\d+", name) and isinstance(camera, dict)
    }


def _camera(camera: dict, name: str, document: Document, image_size: tuple[int, int] | None) -> Camera:
    model = str(camera.get("camera_model", "pinhole"))
    if model != "pinhole":
        raise document.refuse(
            f"has {name} with camera_model {model[:40]!r}; pinhole is known",
            "Calibrate with pinhole-radtan, pinhole-equi or pinhole-fov.",
        )
    fx, fy, cx, cy = numbers(camera.get("intrinsics"), f"intrinsics of {name}", document, count=4)
    values = numbers(camera.get("distortion_coeffs", []), f"distortion_coeffs of {name}", document)
    word = str(camera.get("distortion_model", "none"))
    lens = KALIBR.lens("radtan" if word == "none" else word, values or [0.0] * 4, document)
    if image_size is None:
        resolution = numbers(camera.get("resolution"), f"resolution of {name}", document, count=2)
        sides = [whole_number(side, f"resolution of {name}", document) for side in resolution]
        image_size = (sides[0], sides[1])
    return Camera(image_size, Intrinsics(fx, fy, cx, cy), lens)


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = KALIBR.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    return {
        place: "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs:"
        f" {yaml_list(holding.values(camera.lens))}\n  distortion_model: {holding.word}\n  intrinsics:"
        f" {yaml_list(camera.intrinsics.as_tuple()[:4])}\n  resolution: [{camera.image_size[0]},"
        f" {camera.image_size[1]}]\n  rostopic: /cam0/image_raw\n"
    }


KALIBR = Format(
    name="kalibr",
    title="Kalibr camchain",
    suffixes=(".yaml", ".yml"),
    holdings=(
        Holding("brown", "radtan", ("k1", "k2", "p1", "p2")),
        Holding("kannala_brandt", "equidistant", ("k1", "k2", "k3", "k4"), farthest_deg=90.0),
        Holding("fov", "fov", ("w",)),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    remarks="Its pin-hole drops every ray that is not in front of the camera.",
)
