"""mrcal's .cameramodel: a Python dictionary of plain values, with comments.

LENSMODEL_OPENCV4, 5, 8 and 12 are OpenCV's, LENSMODEL_PINHOLE has no coefficients, nor has
LENSMODEL_STEREOGRAPHIC, 2 tan(theta / 2); a centre as ours. The camera stands in the reference frame (no
extrinsics). valid_intrinsics_region is the hull of the corners that the camera was made from: beyond it the
camera is not known.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, numbers, whole_number
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.opencv_order import OPENCV_ORDER

__all__ = ["MRCAL"]


def _recognises(document: Document) -> bool:
    text = document.text if document.json is None else None
    return text is not None and "'lensmodel'" in text.replace('"', "'") and "LENSMODEL_" in text


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    table = document.python
    if not isinstance(table, dict):
        raise document.refuse("is not whole; expected mrcal's dictionary of plain values")
    values = numbers(table.get("intrinsics"), "intrinsics", document)
    if len(values) < 4:
        raise document.refuse(f"has {len(values)} intrinsics; expected fx, fy, cx, cy and coefficients")
    lens = MRCAL.lens(str(table.get("lensmodel")), values[4:], document)
    if image_size is None:
        sides = numbers(table.get("imagersize"), "imagersize", document, count=2)
        image_size = (
            whole_number(sides[0], "imagersize", document),
            whole_number(sides[1], "imagersize", document),
        )
    return {"camera": Contents(Camera(image_size, Intrinsics(*values[:4]), lens))}


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = MRCAL.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    values = [*camera.intrinsics.as_tuple()[:4], *holding.values(camera.lens)]
    lines = [
        f"    'lensmodel':  '{holding.word}',",
        f"    'intrinsics': [ {', '.join(map(repr, values))} ],",
        "    'extrinsics': [ 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 ],",
        f"    'imagersize': [ {camera.image_size[0]}, {camera.image_size[1]} ],",
    ]
    if contents.trusted is not None:
        hull = _hull(contents.trusted)
        corners = ", ".join(f"[ {x!r}, {y!r} ]" for x, y in [*hull.tolist(), hull[0].tolist()])
        lines.append(f"    'valid_intrinsics_region': [ {corners} ],")
    return {place: "{\n" + "\n".join(lines) + "\n}\n"}


def _hull(points: Float[ndarray, "n 2"]) -> Float[ndarray, "m 2"]:
    """The corners of the convex hull, in order (Andrew's chains)."""
    ordered = points[np.lexsort(points.T[::-1])]

    def chain(points: ndarray) -> list[ndarray]:
        kept: list[ndarray] = []
        for point in points:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0:
                kept.pop()
            kept.append(point)
        return kept[:-1]

    return np.array([*chain(ordered), *chain(ordered[::-1])])


def _turn(a: ndarray, b: ndarray, c: ndarray) -> float:
    """Positive where a, b, c turn from x towards y."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


MRCAL = Format(
    name="mrcal",
    title="mrcal .cameramodel",
    suffixes=(".cameramodel",),
    holdings=(
        Holding("brown", "LENSMODEL_OPENCV5", OPENCV_ORDER[:5]),
        Holding("rational", "LENSMODEL_OPENCV8", OPENCV_ORDER[:8]),
        Holding("brown", "LENSMODEL_OPENCV12", OPENCV_ORDER[:12]),
        Holding("rational", "LENSMODEL_OPENCV12", OPENCV_ORDER[:12]),
        Holding("stereographic", "LENSMODEL_STEREOGRAPHIC", ()),
        Holding("brown", "LENSMODEL_OPENCV4", OPENCV_ORDER[:4], written=False),
        Holding("brown", "LENSMODEL_PINHOLE", (), written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    remarks="valid_intrinsics_region is the hull of the corners; its splined models and CAHVOR are not read.",
)
