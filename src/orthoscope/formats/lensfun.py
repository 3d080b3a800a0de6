"""lensfun's database (XML): a polynomial of the radius that is about one image, not about a focal length.

The radius is measured, before (r_u) and after (r_d) distortion, in halves of the shorter side (between the
centres of the first and the last pixel) of an image with the diagonal of this one and the lens's own aspect
ratio, 3:2 where it says none:

    poly3   r_d = r_u (1 - k1 + k1 r_u^2)
    poly5   r_d = r_u (1 + k1 r_u^2 + k2 r_u^4)
    ptlens  r_d = r_u (a r_u^3 + b r_u^2 + c r_u + 1 - a - b - c)

Its straight image keeps the radius 1 where that is (ptlens, poly3), so its focal length F is another than the
camera's at the centre, f = F (1 - a - b - c); `focal` says F for a frame 36 mm wide. The database does not
say how large images are, nor that pixels may be oblong. lensfun manual, lens calibration;
libs/lensfun/mod-coord.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document, number
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, Pfet

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

__all__ = ["LENSFUN"]

FRAME_MM = (36.0, 24.0)
# Lenses of one database that are looked at; the shipped ones have some hundreds.
MOST_LENSES = 10_000
# No frame is so many times longer than wide.
MOST_OBLONG = 100.0


def _recognises(document: Document) -> bool:
    return document.xml is not None and document.xml.tag == "lensdatabase"


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    root = document.xml
    assert root is not None, "recognised"
    if image_size is None:
        raise document.refuse(
            "does not say how large its images are", "Hand in image_size (--image-size 640x480)."
        )
    cameras = {}
    for lens in root.findall("lens")[:MOST_LENSES]:
        for distortion in lens.iter("distortion"):
            name = f"{(lens.findtext('model') or 'lens').strip()}@{distortion.get('focal', '?')}"
            cameras[name] = Contents(_camera(lens, distortion, image_size, document), name=name)
    if not cameras:
        raise document.refuse("has no distortion in it; expected a lens with a calibration")
    return cameras


def _camera(lens: Element, distortion: Element, size: tuple[int, int], document: Document) -> Camera:
    def value(name: str) -> float:
        return number(distortion.get(name, "0"), name, document)

    focal = _focal_px(lens, distortion, size, document)
    middle, ratio = 0.5 * (np.array(size) - 1.0), focal / _unit(lens, size, document)
    centre = lens.find("center")
    if centre is not None:
        middle = middle + _half(size) * np.array(
            [number(centre.get(name, "0"), name, document) for name in "xy"]
        )
    word = distortion.get("model", "")
    if word == "poly5":
        made = Brown(k1=value("k1") * ratio**2, k2=value("k2") * ratio**4)
        scale = 1.0
    elif word == "poly3":
        scale = 1.0 - value("k1")
        made = Brown(k1=value("k1") * ratio**2 / scale) if scale > 0 else None
    elif word == "ptlens":
        a, b, c = value("a"), value("b"), value("c")
        scale = 1.0 - a - b - c
        made = (
            Pfet(a2=c * ratio / scale, a3=b * ratio**2 / scale, a4=a * ratio**3 / scale)
            if scale > 0
            else None
        )
    else:
        raise document.refuse(f"has a distortion {word[:40]!r}; expected poly3, poly5 or ptlens")
    if made is None:
        raise document.refuse(
            f"has a {word} that turns the image inside out; expected coefficients with a sum below 1"
        )
    fx = scale * focal
    return Camera(size, Intrinsics(fx, fx, float(middle[0]), float(middle[1])), made)


def _focal_px(lens: Element, distortion: Element, size: tuple[int, int], document: Document) -> float:
    focal = number(distortion.get("real-focal", distortion.get("focal")), "focal", document)
    crop = number(lens.findtext("cropfactor", "1"), "cropfactor", document)
    if not (focal > 0 and crop > 0):
        raise document.refuse(
            f"has a focal length of {focal:g} mm and a crop factor of {crop:g}; expected more than 0"
        )
    return focal * crop * math.hypot(*size) / math.hypot(*FRAME_MM)


def _half(size: tuple[int, int]) -> float:
    """Half of the shorter side, pixels: the unit of the centre's shift."""
    return 0.5 * max(min(size) - 1, 1)


def _unit(lens: Element, size: tuple[int, int], document: Document) -> float:
    """The unit of the radius, pixels."""
    words = (lens.findtext("aspect-ratio") or "3:2").split(":")
    across, down = (number(word, "aspect-ratio", document) for word in (*words, "1")[:2])
    if not (across > 0 and down > 0 and 1.0 / MOST_OBLONG < across / down < MOST_OBLONG):
        raise document.refuse(f"has an aspect ratio of {':'.join(words)[:40]!r}; expected one such as 3:2")
    return 0.5 * math.hypot(*_sides(size)) / math.hypot(across / down, 1.0)


def _sides(size: tuple[int, int]) -> tuple[int, int]:
    """Between the centres of the first and the last pixel, the longer one first."""
    return max(max(size) - 1, 1), max(min(size) - 1, 1)


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = LENSFUN.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    fx, _, cx, cy, _ = camera.intrinsics.as_tuple()
    half, lens = _half(camera.image_size), camera.lens
    if isinstance(lens, Pfet):
        s = _radius_at(camera, half)
        focal = half / s
        coefficients = {
            "a": fx / half * lens.a4 * s**4,
            "b": fx / half * lens.a3 * s**3,
            "c": fx / half * lens.a2 * s**2,
        }
    else:
        focal = fx
        k1, k2 = holding.values(lens)
        coefficients = {"k1": k1 * (half / fx) ** 2, "k2": k2 * (half / fx) ** 4}
    mm = focal * math.hypot(*FRAME_MM) / math.hypot(*camera.image_size)
    dx, dy = (np.array([cx, cy]) - 0.5 * (np.array(camera.image_size) - 1.0)) / half
    attributes = " ".join(f'{name}="{value!r}"' for name, value in coefficients.items())
    across, down = _sides(camera.image_size)  # so that its unit is half of the shorter side
    return {
        place: '<lensdatabase version="1">\n  <lens>\n    <maker>orthoscope</maker>\n'
        f"    <model>{escape(contents.name)}</model>\n    <mount>{escape(contents.name)}</mount>\n"
        f"    <cropfactor>1</cropfactor>\n    <aspect-ratio>{across}:{down}</aspect-ratio>\n"
        f'    <center x="{float(dx)!r}" y="{float(dy)!r}"/>\n    <calibration>\n'
        f'      <distortion model="{holding.word}" focal="{mm!r}" {attributes}/>\n'
        "    </calibration>\n  </lens>\n"
        "</lensdatabase>\n"
    }


def _radius_at(camera: Camera, half: float) -> float:
    """The undistorted radius, in the lens's plane, whose image is half the shorter side from the centre."""
    s = float(camera.lens.invert_curve(np.array([half / camera.intrinsics.fx]))[0])
    return s if np.isfinite(s) and s > 0 else half / camera.intrinsics.fx


LENSFUN = Format(
    name="lensfun",
    title="lensfun database XML",
    suffixes=(".xml",),
    holdings=(
        Holding("brown", "poly5", ("k1", "k2")),
        Holding("pfet", "ptlens", ("a2", "a3", "a4")),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    two_focals=False,
    knows_size=False,
    remarks="poly3 is read too; the frame is taken for 36 mm by 24 mm over its crop factor, by the diagonal.",
)
