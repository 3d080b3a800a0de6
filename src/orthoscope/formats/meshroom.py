"""Meshroom's (AliceVision's) .sfm: intrinsics as text in JSON, with a focal length in millimetres.

From version 1.2.1 of the file the principal point is an offset from the image's middle, before it was a
place. The focal length in pixels is the one in millimetres times width over sensorWidth; before 1.2 it stood
as pxFocalLength.
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

__all__ = ["MESHROOM"]

# The version of the file from which the principal point is an offset.
OFFSET_FROM = (1, 2, 1)
VERSION = ("1", "2", "3")
SENSOR_WIDTH_MM = 36.0


def _recognises(document: Document) -> bool:
    table = document.json
    return (
        isinstance(table, dict)
        and "sfm_data_version" not in table
        and isinstance(table.get("intrinsics"), list)
        and any(isinstance(entry, dict) and "intrinsicId" in entry for entry in table["intrinsics"])
    )


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    table = document.json
    version = numbers(table.get("version", list(VERSION)), "version", document)
    cameras = {}
    for entry in table["intrinsics"]:
        if isinstance(entry, dict):
            name = str(entry.get("intrinsicId"))
            cameras[name] = Contents(_camera(entry, version, document, image_size), name=name)
    return cameras


def _camera(
    entry: dict[str, Any], version: list[float], document: Document, image_size: tuple[int, int] | None
) -> Camera:
    size = image_size or (
        whole_number(entry.get("width"), "width", document),
        whole_number(entry.get("height"), "height", document),
    )
    fx, fy = _focal(entry, size, document)
    cx, cy = numbers(entry.get("principalPoint"), "principalPoint", document, count=2)
    if tuple(version) >= OFFSET_FROM:
        cx, cy = cx + 0.5 * size[0], cy + 0.5 * size[1]
    coefficients = entry.get("distortionParams") or []
    lens = MESHROOM.lens(
        str(entry.get("type")), numbers(coefficients, "distortionParams", document), document
    )
    return Camera(size, Intrinsics(fx, fy, cx, cy), lens)


def _focal(entry: dict[str, Any], size: tuple[int, int], document: Document) -> tuple[float, float]:
    if "pxFocalLength" in entry:
        values = numbers([entry["pxFocalLength"]], "pxFocalLength", document)
        return values[0], values[-1]
    ratio = number(entry.get("pixelRatio", 1.0), "pixelRatio", document)
    if ratio != 1.0:
        raise document.refuse(f"has pixels that are not square (pixelRatio {ratio:g}); expected 1")
    sensor = number(entry.get("sensorWidth"), "sensorWidth", document)
    if not sensor > 0:
        raise document.refuse(f"has a sensorWidth of {sensor:g} mm; expected a positive one")
    focal = number(entry.get("focalLength"), "focalLength", document) * size[0] / sensor
    return focal, focal


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = MESHROOM.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    width, height = camera.image_size
    fx, _, cx, cy, _ = camera.intrinsics.as_tuple()
    entry = {
        "intrinsicId": "1",
        "width": str(width),
        "height": str(height),
        "sensorWidth": repr(SENSOR_WIDTH_MM),
        "sensorHeight": repr(SENSOR_WIDTH_MM * height / width),
        "serialNumber": contents.name,
        "type": holding.word,
        "initializationMode": "calibrated",
        "initialFocalLength": "-1",
        "focalLength": repr(fx * SENSOR_WIDTH_MM / width),
        "pixelRatio": "1",
        "pixelRatioLocked": "true",
        "principalPoint": [repr(cx - 0.5 * width), repr(cy - 0.5 * height)],
        "distortionInitializationMode": "none",
        "distortionParams": [repr(value) for value in holding.values(camera.lens)],
        "locked": "true",
    }
    return {place: json.dumps({"version": list(VERSION), "intrinsics": [entry]}, indent=4) + "\n"}


MESHROOM = Format(
    name="meshroom",
    title="Meshroom (AliceVision) .sfm",
    suffixes=(".sfm", ".json"),
    holdings=(
        Holding("brown", "brown", ("k1", "k2", "k3", "p1", "p2")),
        Holding("kannala_brandt", "fisheye4", ("k1", "k2", "k3", "k4"), farthest_deg=90.0),
        Holding("brown", "radial3", ("k1", "k2", "k3"), written=False),
        Holding("brown", "radial1", ("k1",), written=False),
        Holding("brown", "pinhole", (), written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    two_focals=False,
    remarks="Written for file version 1.2.3, with a made-up sensor of 36 mm; poses are not written.",
)
