"""Agisoft Metashape's camera calibration (XML), projections frame and fisheye.

u = w/2 + cx + f x_d + b1 x_d + b2 y_d, v = h/2 + cy + f y_d, the centre of the first pixel being (0.5, 0.5).
Its p1 is OpenCV's p2 and its p2 OpenCV's p1. For the fish-eye the polynomial is that of the angle. Older
files (PhotoScan) have fx, fy and cx, cy from the corner instead. Metashape Professional manual, appendix on
camera models.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, number, whole_number
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics

__all__ = ["METASHAPE"]

# The tool's names of its coefficients, in the order of the holdings below.
NAMES = ("k1", "k2", "k3", "k4", "p1", "p2")


def _recognises(document: Document) -> bool:
    return document.xml is not None and document.xml.tag == "calibration"


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    root = document.xml
    assert root is not None, "recognised"
    fields = {element.tag: (element.text or "").strip() for element in root}

    def value(name: str) -> float:
        return number(fields.get(name, "0"), name, document)

    for name in ("p3", "p4"):
        if value(name):
            raise document.refuse(
                f"has a coefficient {name}, which no lens here has", "Calibrate without it."
            )
    size = image_size or (
        whole_number(fields.get("width"), "width", document),
        whole_number(fields.get("height"), "height", document),
    )
    lens = METASHAPE.lens(fields.get("projection", "frame"), [value(name) for name in NAMES], document)
    if "fx" in fields:
        intrinsics = Intrinsics(value("fx"), value("fy"), value("cx"), value("cy"), value("skew"))
    else:
        intrinsics = Intrinsics(
            value("f") + value("b1"),
            value("f"),
            0.5 * size[0] + value("cx"),
            0.5 * size[1] + value("cy"),
            value("b2"),
        )
    return {"camera": Contents(Camera(size, intrinsics, lens))}


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = METASHAPE.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    width, height = camera.image_size
    fx, fy, cx, cy, skew = camera.intrinsics.as_tuple()
    fields: dict[str, object] = {
        "projection": holding.word,
        "width": width,
        "height": height,
        "f": fy,
        "cx": cx - 0.5 * width,
        "cy": cy - 0.5 * height,
        "b1": fx - fy,
        "b2": skew,
        **dict(zip(NAMES, holding.values(camera.lens), strict=True)),
    }
    body = "".join(f"  <{name}>{value!s}</{name}>\n" for name, value in fields.items())
    return {place: f'<?xml version="1.0" encoding="UTF-8"?>\n<calibration>\n{body}</calibration>\n'}


METASHAPE = Format(
    name="metashape",
    title="Agisoft Metashape calibration XML",
    suffixes=(".xml",),
    holdings=(
        Holding("brown", "frame", ("k1", "k2", "k3", "k4", "p2", "p1")),
        Holding("kannala_brandt", "fisheye", ("k1", "k2", "k3", "k4", "p2", "p1"), farthest_deg=90.0),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    skew=True,
    pixel_origin=0.5,
    remarks="A k4 of the frame camera (its 8th power) is in no lens here and is refused where a file has it.",
)
