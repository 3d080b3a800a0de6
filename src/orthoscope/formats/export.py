"""A camera to the file of another tool: exactly where the tool can hold it, else the nearest that it can
hold.

Nearest is by least squares in pixels over the rays of the corners that the camera was made from (over the
frame where only the camera is known), K and the coefficients free, the orientation fixed, so that poses stay
what they are. What that costs is said, and above LIMIT_PX nothing is written unless one insists.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orthoscope.files.whole_files import write_bytes
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.lens_fit import FOCAL, Pairs, about_principal_point, fit_pairs
from orthoscope.formats.record import Contents, Format, Holding, share_beyond, shifted
from orthoscope.formats.table import tool as record_of
from orthoscope.geometry.arrays import CalibrationError, Float, InputError, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.difference import frame_grid
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import lens_name, parse_lens
from orthoscope.simulation.scene import Scene
from orthoscope.solve.least_squares import Options
from orthoscope.targets.detections import Detections

__all__ = ["LIMIT_PX", "Exportable", "Exported", "export", "exportable"]

# A formula that is farther than this from the camera, on average, is another camera.
LIMIT_PX = 1.0
# Corners that are as good as all of them to fit a formula to.
ENOUGH_CORNERS = 4000
# Which lens is nearest is plain before the last digits, which only that one needs.
ROUGH_OPTIONS = Options(tolerance=1e-5)


class Exportable(NamedTuple):
    """A camera that a tool can hold, and how far its images are from those of the camera that was asked for.

    Attributes:
        camera: as the tool holds it, in our pixels.
        apart_px: distance on average.
        farthest_px: distance at most.
        where: of which pixels that is said, in words.
        lacks: what of the camera the tool cannot hold; empty where it is held exactly.
        beyond: share of the frame's pixels with rays so far from the axis that the tool has no image for
            them.
    """

    camera: Camera
    apart_px: float
    farthest_px: float
    where: str
    lacks: str = ""
    beyond: float = 0.0


class Exported(NamedTuple):
    """What was written.

    Attributes:
        tool: the record of the tool.
        held: the camera that stands in the file, and what it costs.
        files: that were written.
    """

    tool: Format
    held: Exportable
    files: tuple[Path, ...]

    def remarks(self) -> tuple[str, ...]:
        """What one must know of the file, a sentence each; none where it is the camera itself."""
        held, told = self.held, []
        holding = self.tool.holding(held.camera.lens)
        assert holding is not None, "the camera is one that the tool holds"
        if holding.note:
            told.append(f"{lens_name(held.camera.lens)}: {holding.note}")
        if held.lacks:
            told.append(
                f"{lens_name(held.camera.lens)}, since {self.tool.name} cannot hold {held.lacks}:"
                f" {held.apart_px:.2g} px apart on average {held.where}, {held.farthest_px:.2g} px at most"
            )
        if held.beyond > 0:
            told.append(
                f"{100 * held.beyond:.2g} % of the frame looks farther than {holding.farthest_deg:g} degrees"
                f" from the axis, where {self.tool.name} has no image or a wrong one"
            )
        return tuple(told)


def export(
    source: Calibration | Camera | Scene | Contents,
    path: str | Path,
    tool: str,
    *,
    name: str = "camera",
    anyway: bool = False,
) -> Exported:
    """Writes a camera for another tool, and what it costs where the tool cannot hold it exactly.

    Args:
        source: a calibration is better than its camera: its corners say where the camera is known, its poses
            go along where the tool takes them.
        path: of the file; where the tool has several kinds, its suffix says which.
        tool: a name in FORMATS, such as `opencv`.
        name: of the camera, where the tool names cameras.
        anyway: write also what is farther from the camera than LIMIT_PX.
    Raises:
        InputError: the tool is not known, cannot come near enough, or the place cannot be written.
        CalibrationError: no lens of the tool sees as far from the axis.
    """
    record = record_of(tool)
    _check_suffix(record, Path(path))
    camera = source if isinstance(source, Camera) else source.camera
    made_from = source if isinstance(source, Calibration) else None
    held = exportable(camera, tool, made_from=made_from)
    if held.apart_px > LIMIT_PX and not anyway:
        raise InputError(
            f"{tool} cannot hold {held.lacks}: the nearest that it can is {held.apart_px:.2g} px away on"
            f" average"
            f" {held.where} ({held.farthest_px:.2g} px at most); expected at most {LIMIT_PX:g} px. Choose"
            f" another"
            " tool, calibrate with a lens that it has, or insist (--anyway)."
        )
    contents = Contents(
        shifted(held.camera, record.pixel_origin),
        poses=_poses(source),
        name=_checked_name(name),
        trusted=None if made_from is None else _corners(made_from.detections) + record.pixel_origin,
    )
    files = record.write(contents, Path(path))
    for place, content in files.items():
        write_bytes(place, content.encode() if isinstance(content, str) else content)
    return Exported(record, held, tuple(files))


def _check_suffix(record: Format, path: Path) -> None:
    """The suffix says which of a tool's files is meant.

    Raises:
        InputError: the tool has several and this is none of them.
    """
    if path.suffix and len(record.suffixes) > 1 and path.suffix.lower() not in record.suffixes:
        raise InputError(
            f"{path} does not say which file of {record.title} is meant; expected a name that ends in"
            f" {' or '.join(record.suffixes)}. Name it so."
        )


def exportable(camera: Camera, tool: str, *, made_from: Calibration | None = None) -> Exportable:
    """The camera itself where a tool can hold it, else the nearest that it can hold.

    Args:
        tool: a name in FORMATS.
        made_from: the calibration of the camera; the nearest is then judged where its corners were seen,
            otherwise over the frame.
    Raises:
        InputError: the tool is not known.
        CalibrationError: none of the tool's lenses sees so far from the axis.
    """
    record = record_of(tool)
    lacks = record.lacks(camera)
    where = "over the frame" if made_from is None else "where corners were seen"
    if not lacks:
        holding = record.holding(camera.lens)
        assert holding is not None, "nothing is lacking"
        beyond = share_beyond(camera, holding.farthest_deg)
        return Exportable(camera, 0.0, 0.0, where, "", beyond)
    seen = made_from and made_from.detections
    other, holding = _nearest(camera, seen, record)
    rays, wanted = _seen(camera, seen)
    apart = np.hypot(*(other.project(rays) - wanted).T)
    beyond = share_beyond(other, holding.farthest_deg)
    return Exportable(other, float(apart.mean()), float(apart.max()), where, lacks, beyond)


def _nearest(camera: Camera, seen: Detections | None, record: Format) -> tuple[Camera, Holding]:
    """The camera of the tool whose image of what was seen is nearest to this camera's, in pixels."""
    focal = (*(FOCAL if record.two_focals else ("fx=fy", "cx", "cy")), *(("skew",) if record.skew else ()))
    near: list[_Near] = []
    for lens in record.lenses:
        try:
            other = _fitted(camera, seen, lens, focal)
        except CalibrationError:
            continue
        if np.isfinite(other.apart) and record.holding(other.camera.with_unit_scale().lens):
            near.append(other)
    if not near:
        raise CalibrationError(
            f"none of {', '.join(record.lenses)} sees as far from the axis as this camera does. Use a tool"
            f" with a"
            " lens of the angle."
        )
    other = _exact(min(near, key=lambda other: other.apart))
    holding = record.holding(other.lens)
    assert holding is not None, "it was held before the last steps"
    return other, holding


class _Near(NamedTuple):
    """A camera with another lens, how far its images are apart from those it was fitted to (squares summed),
    and the problem of that fit.
    """

    camera: Camera
    apart: float
    problem: Pairs


@lru_cache(maxsize=16)
def _fitted(camera: Camera, seen: Detections | None, lens: str, focal: tuple[str, ...]) -> _Near:
    """The camera with this lens that is nearest, but for the last digits; found once for all tools that have
    the lens.

    Args:
        seen: corners by which it is judged; the frame where there are none.
        focal: the parameters of K that move.
    Raises:
        CalibrationError: the lens does not see so far.
    """
    rays, wanted = _seen(camera, seen)
    frame = camera.lens_frame or camera.intrinsics
    fy, skew = frame.fy if "fy" in focal else frame.fx, frame.skew if "skew" in focal else 0.0
    plain = replace(camera, intrinsics=Intrinsics(frame.fx, fy, frame.cx, frame.cy, skew), lens_frame=None)
    kind, free = parse_lens(lens)
    problem = about_principal_point(rays, wanted, (*focal, *free))
    starts = [replace(plain, lens=kind(**start)) for start in kind.starts]
    other = fit_pairs(problem, starts, options=ROUGH_OPTIONS).unknowns
    return _Near(other, float(((other.project(rays) - wanted) ** 2).sum()), problem)


@lru_cache(maxsize=4)
def _exact(near: _Near) -> Camera:
    """The same to the last digits."""
    return fit_pairs(near.problem, [near.camera]).unknowns.with_unit_scale()


@lru_cache(maxsize=2)
def _seen(camera: Camera, seen: Detections | None) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 2"]]:
    """Rays by which cameras are compared, and their pixels: of corners, or over the frame.

    Raises:
        CalibrationError: the camera sees nothing.
    """
    rays = camera.unproject(frame_grid(camera.image_size) if seen is None else _corners(seen))
    rays = rays[np.isfinite(rays).all(1)]
    if not len(rays):
        raise CalibrationError(
            "the lens has no image within the frame: no camera is like it. Mend its numbers."
        )
    return rays, camera.project(rays)


def _corners(detections: Detections) -> Float[ndarray, "n 2"]:
    """The pixels of corners that the camera was made from, evenly picked where they are many."""
    pixels = np.concatenate([view.pixels for view in detections.views])
    return pixels[:: max(1, len(pixels) // ENOUGH_CORNERS)]


def _poses(source: Calibration | Camera | Scene | Contents) -> Mapping[str, Pose]:
    """camera_from_target by the photograph's name, where they are known."""
    if isinstance(source, Calibration):
        images = [view.image for view in source.detections.views]
        return dict(zip(images, source.camera_from_target, strict=True))
    if isinstance(source, Scene):
        return dict(zip(source.images, source.camera_from_target, strict=True))
    return source.poses if isinstance(source, Contents) else {}


def _checked_name(name: str) -> str:
    if not name or not all(letter.isalnum() or letter in "_-/." for letter in name):
        raise InputError(
            f"camera name {name!r} cannot stand in a tool's file; expected letters, digits, _, -, / and dots."
        )
    return name
