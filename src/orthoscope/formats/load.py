"""A camera out of any tool's file, which is known by its content and not by its name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from orthoscope.files.whole_files import read_bytes
from orthoscope.fitting.calibration import Calibration
from orthoscope.formats.own.json import camera_in, load
from orthoscope.formats.own.tool import ORTHOSCOPE
from orthoscope.formats.record import Contents, Format, shifted
from orthoscope.formats.syntax import Document
from orthoscope.formats.table import FORMATS
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.simulation.scene import Scene

__all__ = ["format_of", "load_camera", "load_contents", "load_source"]

# No pin-hole has a larger number, pixels; a file that says so is damaged.
LARGEST_INTRINSIC = 1e9

# What stands between a file's name and that of a camera in it.
SEPARATOR = "#"


def load_camera(
    path: str | Path, *, image_size: tuple[int, int] | None = None, name: str | None = None
) -> Camera:
    """The camera of a file: one of ours (camera, calibration, scene), or of any tool in FORMATS.

    Args:
        path: the file; of several cameras in it `path#name` names one, such as `camchain.yaml#cam1`.
        image_size: (width, height), for a file that does not hold it.
        name: of the camera, instead of `#name`.
    Raises:
        InputError: the file is none that is known, is damaged, or holds several cameras and none was named.
    """
    return load_contents(path, image_size=image_size, name=name).camera


def load_source(
    path: str | Path, *, image_size: tuple[int, int] | None = None
) -> Calibration | Scene | Contents:
    """What `export` takes, with all that the file knows: a calibration or scene of ours, or a camera with
    poses.

    Args:
        path, image_size: as for `load_camera`.
    Raises:
        InputError: as `load_camera`.
    """
    if Path(path).is_file() and ORTHOSCOPE.recognises(Document(path)):
        thing = load(path)
        if isinstance(thing, Calibration | Scene):
            return thing
    return load_contents(path, image_size=image_size)


def load_contents(
    path: str | Path, *, image_size: tuple[int, int] | None = None, name: str | None = None
) -> Contents:
    """All that a file says of a camera: also its poses, where the tool keeps them there; as `load_camera`."""
    if name is None and SEPARATOR in str(path) and not Path(path).exists():
        path, _, name = str(path).rpartition(SEPARATOR)
    document = Document(path, read_bytes(path))
    record = format_of(document)
    contents = _named(record.read(document, image_size), name, document)
    largest = max(map(abs, contents.camera.intrinsics.as_tuple()))
    if largest > LARGEST_INTRINSIC:
        raise document.refuse(
            f"has {largest:g} px in its pin-hole; expected no more than {LARGEST_INTRINSIC:g}"
        )
    return replace(contents, camera=shifted(contents.camera, -record.pixel_origin))


def format_of(document: Document) -> Format:
    """The tool that a file is of.

    Raises:
        InputError: no tool knows it.
    """
    for record in FORMATS.values():
        if record.recognises(document):
            return record
    if document.content.lstrip()[:1] in (b"", b"{", b"["):
        camera_in(document.content, document.path)  # says what is wrong with this JSON
    titles = ", ".join(record.title for record in FORMATS.values())
    raise InputError(f"{document.path} holds no camera that is known here; expected a file of {titles}.")


def _named(cameras: Mapping[str, Contents], name: str | None, document: Document) -> Contents:
    """The camera that was asked for, or the only one."""
    known = ", ".join(list(cameras)[:10])
    if name is not None:
        if name in cameras:
            return cameras[name]
        raise document.refuse(f"has no camera {name!r}; it has {known}", "Name one of these.")
    if len(cameras) != 1:
        raise document.refuse(
            f"has {len(cameras)} cameras ({known}); expected one",
            f"Name it: {document.path}{SEPARATOR}NAME.",
        )
    return next(iter(cameras.values()))
