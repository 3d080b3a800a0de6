"""Kalibr's camchain: YAML with a camera for each of cam0, cam1, ...; the pin-hole with radtan, equidistant or
fov, and the models that need no distortion: ds, eucm and omni.

radtan is k1 k2 p1 p2 of OpenCV, equidistant its fisheye, fov one angle. The coefficients of ds and eucm stand
before fu fv pu pv among the intrinsics. omni (xi) is eucm with alpha = xi / (1 + xi), beta = 1 and focal
lengths smaller by 1 + xi; it is only read, and only without distortion. Of a chain each camera is read by its
name; its transformations between cameras are not.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, numbers, whole_number, yaml_list
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics

__all__ = ["KALIBR"]

# Camera models with coefficients of their own, and how many of these stand before the focal lengths.
BEFORE_FOCAL = {"ds": 2, "eucm": 2, "omni": 1}


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
    if model not in ("pinhole", *BEFORE_FOCAL):
        raise document.refuse(
            f"has {name} with camera_model {model[:40]!r}; known are pinhole, {', '.join(BEFORE_FOCAL)}",
            "Calibrate with one of these.",
        )
    own = BEFORE_FOCAL.get(model, 0)
    values = numbers(camera.get("intrinsics"), f"intrinsics of {name}", document, count=own + 4)
    first, (fx, fy, cx, cy) = values[:own], values[own:]
    coefficients = numbers(camera.get("distortion_coeffs", []), f"distortion_coeffs of {name}", document)
    word = str(camera.get("distortion_model", "none"))
    stretch = 1.0
    if model == "pinhole":
        lens = KALIBR.lens("radtan" if word == "none" else word, coefficients or [0.0] * 4, document)
    elif any(coefficients):
        raise document.refuse(
            f"has {name} with {model} and a distortion {word[:40]!r} on top; expected none",
            f"Calibrate with {model}-none, ds-none or pinhole-equi.",
        )
    elif model == "omni":
        stretch += first[0]
        if stretch <= 0.0:
            raise document.refuse(f"has {name} with xi {first[0]:g}; expected more than -1")
        lens = KALIBR.lens("eucm", [first[0] / stretch, 1.0], document)
    else:
        lens = KALIBR.lens(model, first, document)
    if image_size is None:
        resolution = numbers(camera.get("resolution"), f"resolution of {name}", document, count=2)
        sides = [whole_number(side, f"resolution of {name}", document) for side in resolution]
        image_size = (sides[0], sides[1])
    return Camera(image_size, Intrinsics(fx / stretch, fy / stretch, cx, cy), lens)


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = KALIBR.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    values, focal = holding.values(camera.lens), camera.intrinsics.as_tuple()[:4]
    if holding.word in BEFORE_FOCAL:
        model, word, coefficients, intrinsics = holding.word, "none", [], [*values, *focal]
    else:
        model, word, coefficients, intrinsics = "pinhole", holding.word, values, focal
    return {
        place: f"cam0:\n  cam_overlaps: []\n  camera_model: {model}\n  distortion_coeffs:"
        f" {yaml_list(coefficients)}\n  distortion_model: {word}\n  intrinsics:"
        f" {yaml_list(intrinsics)}\n  resolution: [{camera.image_size[0]},"
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
        Holding("double_sphere", "ds", ("xi", "alpha")),
        Holding("eucm", "eucm", ("alpha", "beta")),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    remarks="Its pin-hole drops every ray that is not in front of the camera; ds and eucm do not.",
)
