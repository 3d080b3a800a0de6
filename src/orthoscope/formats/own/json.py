"""Our own files: `detections.json`, `calibration.json`, `camera.json` and a simulated scene's `truth.json`,
saved and loaded.

Each is one JSON object that opens with what it is and in which format: {"orthoscope": "calibration",
"format": 1, ...}. What is loaded equals what was saved to the last bit, and the same thing saved twice gives
the same bytes.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import msgspec

from orthoscope.files.whole_files import read_bytes, write_text
from orthoscope.fitting.calibration import Calibration
from orthoscope.formats.own.json_layout import lay_out
from orthoscope.formats.own.schema import CalibrationFile, CameraFile, DetectionsFile, SceneFile
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.simulation.scene import Scene
from orthoscope.targets.detections import Detections

__all__ = ["load", "load_calibration", "load_camera", "load_detections", "save"]

FORMAT = 1
KINDS: dict[str, tuple[type, Any]] = {  # what a file says it is: the type in memory, the schema on disk
    "detections": (Detections, DetectionsFile),
    "calibration": (Calibration, CalibrationFile),
    "camera": (Camera, CameraFile),
    "scene": (Scene, SceneFile),
}


class _Header(msgspec.Struct):
    orthoscope: str = ""
    format: int = 0


def _document(schema: type) -> type:
    """The schema of a whole file: the header's fields and the thing's own."""
    header = [("orthoscope", str), ("format", int)]
    return msgspec.defstruct(schema.__name__, header, bases=(schema,), kw_only=True)


DOCUMENTS = {kind: _document(schema) for kind, (_, schema) in KINDS.items()}


def save(thing: Detections | Calibration | Camera | Scene, path: str | Path) -> None:
    """Writes detections, a calibration, a camera or a scene to a file of our own, as a whole.

    Raises InputError where the place cannot be written or a setting has no plain value.
    """
    for kind, (core, schema) in KINDS.items():
        if isinstance(thing, core):
            try:
                text = lay_out(
                    {"orthoscope": kind, "format": FORMAT, **msgspec.to_builtins(schema.of(thing))}
                )
            except (TypeError, ValueError) as error:
                raise InputError(
                    f"the {kind} for {path} cannot be written as JSON ({error}); expected plain, finite"
                    " values."
                ) from error
            return write_text(path, text + "\n")
    raise InputError(f"{type(thing).__name__} cannot be saved; expected one of {', '.join(KINDS)}.")


def load(path: str | Path) -> Detections | Calibration | Camera | Scene:
    """Whatever one of our files holds.

    Raises InputError for a file that is missing, cut off, of another program or of a newer version, and for
    values that cannot be.
    """
    content = read_bytes(path).removeprefix(b"\xef\xbb\xbf")
    kind = _kind(content, path)
    try:
        return msgspec.json.decode(content, type=DOCUMENTS[kind]).core()
    except (msgspec.ValidationError, InputError) as error:
        what = str(error).rstrip(".")
        raise InputError(
            f"{path} does not hold proper {kind} data: {what}. Mend that place or write the file again."
        ) from error


def load_detections(path: str | Path) -> Detections:
    """The detections of a file, also those that a calibration was made from; errors as `load`."""
    thing = load(path)
    return _expect(Detections, thing.detections if isinstance(thing, Calibration) else thing, path)


def load_calibration(path: str | Path) -> Calibration:
    """The calibration of a file; errors as `load`."""
    return _expect(Calibration, load(path), path)


def load_camera(path: str | Path) -> Camera:
    """The camera of a file, also out of a calibration or a scene; errors as `load`."""
    thing = load(path)
    return _expect(Camera, thing.camera if isinstance(thing, Calibration | Scene) else thing, path)


def _expect(core: type, thing: Any, path: str | Path) -> Any:
    if isinstance(thing, core):
        return thing
    raise InputError(
        f"{path} holds {_named(thing)}; expected {core.__name__.lower()}. Hand in the file that has it."
    )


def _named(thing: Any) -> str:
    kind = type(thing).__name__.lower()
    return kind if kind.endswith("s") else f"a {kind}"


def _kind(content: bytes, path: str | Path) -> str:
    """What the file says it is, where we can read it."""
    try:
        header = msgspec.json.decode(content, type=_Header)
    except msgspec.ValidationError as error:
        raise InputError(_foreign(path)) from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InputError(_malformed(content, path, error)) from error
    if header.format > FORMAT:
        raise InputError(
            f"{path} was written by a newer orthoscope (format {header.format}; this one reads up to"
            f" {FORMAT}). Upgrade: pip install -U orthoscope."
        )
    if header.orthoscope not in KINDS or header.format < 1:
        raise InputError(_foreign(path))
    return header.orthoscope


def _foreign(path: str | Path) -> str:
    return (
        f"{path} is JSON, but not of orthoscope; expected an object that opens with "
        f'{{"orthoscope": "{"|".join(KINDS)}", "format": {FORMAT}, ...}}. Hand in a file that orthoscope'
        " wrote."
    )


def _malformed(content: bytes, path: str | Path, error: Exception) -> str:
    """Why this is no JSON, in the words that help most."""
    if not content.strip():
        return f"{path} is empty; expected JSON that orthoscope wrote. Write it again."
    outside_strings = re.sub(rb'"(?:[^"\\\n]|\\.)*"', lambda text: b" " * len(text[0]), content)
    if number := re.search(rb"-?\b(?:NaN|Infinity|nan|inf)\b", outside_strings):
        line = content.count(b"\n", 0, number.start()) + 1
        return f"{path}, line {line}, has {number[0].decode()}; expected finite numbers. Drop that entry."
    if "truncated" in str(error):
        return f"{path} is cut off; expected whole JSON that orthoscope wrote. Write or copy it again."
    return f"{path} is not JSON ({error}); expected a file that orthoscope wrote, such as calibration.json."
