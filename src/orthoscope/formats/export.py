"""A camera as the file of another tool, a formula exactly or not at all: `EXPORTERS` says which tools.

The tools named here put pixel (0, 0) where we do, so no number changes; none of them has a skew or a lens
frame. All three files are YAML, of a kind so plain that it is written as text.

opencv   what cv2.FileStorage reads: camera_matrix and distortion_coefficients of cv2.calibrateCamera (5, 8,
12, 14) or cv2.fisheye (4).
ros      camera_info as camera_calibration_parsers reads it: plumb_bob (5), rational_polynomial (8),
equidistant (4).
kalibr   camchain: pinhole with radtan (k1 k2 p1 p2), equidistant (4) or fov (w).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orthoscope.files.whole_files import write_text
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.methods.decoupled.step_two import nearest_formula
from orthoscope.models.camera import Camera
from orthoscope.models.difference import frame_grid
from orthoscope.models.free_lens import FreeLens
from orthoscope.models.lens import Lens
from orthoscope.models.lenses import Brown, Fov, KannalaBrandt, Rational, lens_name

__all__ = ["EXPORTERS", "OPENCV_ORDER", "Exportable", "export", "exportable", "opencv_coefficients"]

OPENCV_ORDER = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y")
LENGTHS = (5, 8, 12, 14)


class _Model(NamedTuple):
    """A tool's name for a lens, and the coefficients in the tool's order."""

    name: str
    coefficients: list[float]


def export(camera: Camera, path: str | Path, format_name: str) -> None:
    """Writes a camera for another tool, one of EXPORTERS.

    Raises InputError for a tool that is not there, a lens, skew or lens frame that it does not have, and
    where the file cannot be written.
    """
    if format_name not in EXPORTERS:
        raise InputError(
            f"no file for {format_name!r} can be written; expected one of {', '.join(EXPORTERS)}."
        )
    if camera.intrinsics.skew != 0.0:
        raise InputError(
            f"{format_name} has no skew, and this camera's is {camera.intrinsics.skew:g} px. Calibrate"
            " without skew."
        )
    if camera.lens_frame is not None:
        raise InputError(
            f"{format_name} has no distortion centre of its own, and this camera has. Fit a lens about the"
            " principal point."
        )
    write_text(path, EXPORTERS[format_name].text(camera))


class Exportable(NamedTuple):
    """A camera that a tool can hold, and how far its images are from those of the camera that was asked for:
    on average, at most, where.
    """

    camera: Camera
    apart_px: float
    farthest_px: float
    where: str


def exportable(camera: Camera, format_name: str, *, made_from: Calibration | None = None) -> Exportable:
    """The camera itself, or, where its lens is a free one, the nearest formula that the tool has.

    made_from: the calibration of the camera; the nearest is then judged where its corners were seen,
    otherwise over the frame. Raises InputError for a tool that is not there, CalibrationError where none of
    its formulas sees so far from the axis.
    """
    if format_name not in EXPORTERS:
        raise InputError(
            f"no file for {format_name!r} can be written; expected one of {', '.join(EXPORTERS)}."
        )
    if not isinstance(camera.lens, FreeLens):
        return Exportable(camera, 0.0, 0.0, "over the frame")
    pixels = (
        frame_grid(camera.image_size)
        if made_from is None
        else np.concatenate([view.pixels for view in made_from.detections.views])
    )
    rays = camera.unproject(pixels)
    rays = rays[np.isfinite(rays).all(1)]
    other = nearest_formula(camera, rays, EXPORTERS[format_name].lenses)
    apart = np.hypot(*(other.project(rays) - camera.project(rays)).T)
    where = "over the frame" if made_from is None else "where corners were seen"
    return Exportable(other, float(apart.mean()), float(apart.max()), where)


def opencv_coefficients(lens: Brown | Rational) -> list[float]:
    """The coefficients in OpenCV's order: as few of 5, 8, 12 or 14 as hold them all."""
    known = dict(zip(lens.names(), lens.coefficients.tolist(), strict=True))
    values = [known.get(name, 0.0) for name in OPENCV_ORDER]
    used = max((i + 1 for i, value in enumerate(values) if value), default=0)
    shortest = 8 if isinstance(lens, Rational) else 5
    return values[: next(length for length in LENGTHS if length >= max(used, shortest))]


def _opencv(camera: Camera) -> str:
    lens = camera.lens
    if isinstance(lens, Brown | Rational):
        model = _Model("opencv", opencv_coefficients(lens))
    elif isinstance(lens, KannalaBrandt):
        model = _Model("opencv_fisheye", lens.coefficients.tolist())
    else:
        raise _no_such_lens(lens, "opencv", "brown, rational and kannala_brandt")
    width, height = camera.image_size
    return (
        f"%YAML:1.0\n---\nimage_width: {width}\nimage_height: {height}\n"
        "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data:"
        f" {_numbers(camera.intrinsics.matrix)}\n"
        f'distortion_model: "{model.name}"\n'
        f"distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: {len(model.coefficients)}\n  "
        " dt: d\n"
        f"   data: {_numbers(model.coefficients)}\n"
    )


def _ros(camera: Camera) -> str:
    lens = camera.lens
    if isinstance(lens, KannalaBrandt):
        model = _Model("equidistant", lens.coefficients.tolist())
    elif isinstance(lens, Brown | Rational) and len(coefficients := opencv_coefficients(lens)) <= 8:
        model = _Model("plumb_bob" if len(coefficients) == 5 else "rational_polynomial", coefficients)
    else:
        raise _no_such_lens(lens, "ros", "brown and rational without prism and tilt, and kannala_brandt")
    width, height = camera.image_size
    matrix = camera.intrinsics.matrix

    def block(name: str, values: ndarray) -> str:
        return f"{name}:\n  rows: {values.shape[0]}\n  cols: {values.shape[1]}\n  data: {_numbers(values)}\n"

    return (
        f"image_width: {width}\nimage_height: {height}\ncamera_name: camera\n"
        + block("camera_matrix", matrix)
        + f"distortion_model: {model.name}\n"
        + block("distortion_coefficients", np.array([model.coefficients]))
        + block("rectification_matrix", np.eye(3))
        + block("projection_matrix", np.hstack([matrix, np.zeros((3, 1))]))
    )


def _kalibr(camera: Camera) -> str:
    lens = camera.lens
    if isinstance(lens, KannalaBrandt):
        model = _Model("equidistant", lens.coefficients.tolist())
    elif isinstance(lens, Fov):
        model = _Model("fov", [lens.w])
    elif isinstance(lens, Brown) and not any(opencv_coefficients(lens)[4:]):
        model = _Model("radtan", opencv_coefficients(lens)[:4])
    else:
        raise _no_such_lens(
            lens,
            "kalibr",
            "brown with k1, k2, p1 and p2 only (--lens brown:k1,k2,p1,p2), kannala_brandt and fov",
        )
    return (
        "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs:"
        f" {_numbers(model.coefficients)}\n  distortion_model: {model.name}\n  intrinsics:"
        f" {_numbers(camera.intrinsics.as_tuple()[:4])}\n  resolution: [{camera.image_size[0]},"
        f" {camera.image_size[1]}]\n  rostopic: /cam0/image_raw\n"
    )


class Exporter(NamedTuple):
    """How a tool's file is written, and the lenses that it can hold as they are freed by a calibration for
    it.
    """

    text: Callable[[Camera], str]
    lenses: tuple[str, ...]


EXPORTERS: dict[str, Exporter] = {
    "opencv": Exporter(_opencv, ("brown", "rational", "kannala_brandt")),
    "ros": Exporter(_ros, ("brown", "rational", "kannala_brandt")),
    "kalibr": Exporter(_kalibr, ("brown:k1,k2,p1,p2", "kannala_brandt", "fov")),
}


def _numbers(values: ndarray | Iterable[float]) -> str:
    """YAML list; each number with a point and the digits that read back as the same."""
    return "[" + ", ".join(_number(value) for value in np.ravel(list(values)).tolist()) + "]"


def _number(value: float) -> str:
    text = repr(value)  # 1e-05 is a string to YAML 1.1; 1.0e-05 is a number
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _no_such_lens(lens: Lens, tool: str, can: str) -> InputError:
    return InputError(
        f"{tool} cannot hold this {lens_name(lens)} lens exactly; it has {can}. Calibrate with one of these."
    )
