"""Our own files, saved and loaded: `detections.json`, `calibration.json`, `evaluation.json`, `camera.json`,
`comparison.json` and a simulated scene's `truth.json`.

Each is one JSON object that opens with what it is and in which format: {"orthoscope": "calibration",
"format": 1, ...}. What is loaded equals what was saved to the last bit, and the same thing saved twice gives
the same bytes.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from orthoscope.files.whole_files import read_bytes, write_text
from orthoscope.fitting.calibration import Calibration
from orthoscope.formats.own.json_layout import lay_out
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.simulation.scene import Scene
from orthoscope.targets.detections import Detections
from orthoscope.targets.mirrored import with_word_of_mirrors

if TYPE_CHECKING:
    from orthoscope.evaluation.comparison.compare import Comparison
    from orthoscope.evaluation.evaluate import Evaluation

__all__ = [
    "camera_in",
    "load",
    "load_calibration",
    "load_detections",
    "load_evaluation",
    "load_own_camera",
    "save",
    "text_of",
]

FORMAT = 1
# What a file says it is has a type in memory, and a schema on disk that stands in this module.
KINDS_OF_FILE = {
    "detections": ("Detections", "DetectionsFile", "schema"),
    "calibration": ("Calibration", "CalibrationFile", "schema"),
    "evaluation": ("Evaluation", "EvaluationFile", "evaluation_schema"),
    "comparison": ("Comparison", "ComparisonFile", "comparison_schema"),
    "camera": ("Camera", "CameraFile", "schema"),
    "scene": ("Scene", "SceneFile", "schema"),
}
# An evaluation judges the file of this name beside its own.
CALIBRATION_NAME = "calibration.json"
# Files of these kinds are other programs'.
OTHER_SUFFIXES = (".yaml", ".yml", ".xml", ".txt", ".csv", ".mat", ".pkl", ".npz")


class _Header(msgspec.Struct):
    orthoscope: str = ""
    format: int = 0


@cache
def _schema(kind: str) -> Any:
    """What objects of a kind are written with; imported when it is first asked for, since few verbs judge."""
    _, name, module = KINDS_OF_FILE[kind]
    return getattr(importlib.import_module(f"orthoscope.formats.own.{module}"), name)


@cache
def _document(kind: str) -> Any:
    """The schema of a whole file: the header's fields and the thing's own."""
    schema, header = _schema(kind), [("orthoscope", str), ("format", int)]
    return msgspec.defstruct(schema.__name__, header, bases=(schema,), kw_only=True)


def text_of(thing: Detections | Calibration | Evaluation | Comparison | Camera | Scene) -> str:
    """What `save` writes, one JSON object.

    Raises:
        InputError: a setting has no plain value, or this is nothing that has a file.
    """
    kinds = {core: kind for kind, (core, *_) in KINDS_OF_FILE.items()}
    if (kind := kinds.get(type(thing).__name__)) is None:
        raise InputError(
            f"{type(thing).__name__} cannot be saved; expected one of {', '.join(KINDS_OF_FILE)}."
        )
    try:
        plain = msgspec.to_builtins(_schema(kind).of(thing))
        return lay_out({"orthoscope": kind, "format": FORMAT, **plain}) + "\n"
    except (TypeError, ValueError) as error:
        raise InputError(
            f"the {kind} cannot be written as JSON ({error}); expected plain, finite values."
        ) from error


def save(
    thing: Detections | Calibration | Evaluation | Comparison | Camera | Scene, path: str | Path
) -> None:
    """Writes one of our things to a file of our own, as a whole.

    An evaluation is loaded with the calibration that it judges: save that beside it, as calibration.json.

    Raises:
        InputError: the place cannot be written or is named as another kind of file, or a setting has no plain
            value.
    """
    if Path(path).suffix.lower() in OTHER_SUFFIXES:
        raise InputError(
            f"{path} is named as another kind of file; ours are JSON. Name it .json, or write a camera for"
            " another tool: orthoscope.export(calibration, path, tool)."
        )
    write_text(path, text_of(thing))


def load(path: str | Path) -> Any:
    """Whatever one of our files holds.

    Raises:
        InputError: the file is missing, cut off, of another program or of a newer version, has values that
            cannot be, or is an evaluation of another calibration than the one beside it.
    """
    return _loaded(read_bytes(path), path)


def _loaded(content: bytes, path: str | Path) -> Any:
    """What the bytes of a file of ours hold; errors as `load`."""
    content = content.removeprefix(b"\xef\xbb\xbf")
    kind = _kind(content, path)
    judged = [load_calibration(Path(path).with_name(CALIBRATION_NAME))] if kind == "evaluation" else []
    return _thing(content, kind, path, judged)


def _thing(content: bytes, kind: str, path: str | Path, judged: Sequence[Calibration] = ()) -> Any:
    """What such content means; for an evaluation with the calibration that it judges."""
    try:
        return msgspec.json.decode(content, type=_document(kind)).core(*judged)
    except (msgspec.DecodeError, InputError, ValueError, OverflowError, RecursionError) as error:
        what = str(error).rstrip(".")
        raise InputError(
            f"{path} does not hold proper {kind} data: {what}. Mend that place or write the file again."
        ) from error


def load_detections(path: str | Path) -> Detections:
    """The detections of a file, also those that a calibration was made from; a remark says where corners run
    the wrong way round. Errors as `load`.
    """
    thing = load(path)
    found = _expect(Detections, thing.detections if isinstance(thing, Calibration) else thing, path)
    return with_word_of_mirrors(found)


def load_calibration(path: str | Path) -> Calibration:
    """The calibration of a file; errors as `load`."""
    return _expect(Calibration, load(path), path)


def load_evaluation(path: str | Path, calibration: Calibration | None = None) -> Evaluation:
    """The evaluation of a file.

    Args:
        path: such as camera/evaluation.json.
        calibration: the one that it judges; by default calibration.json in the same folder.
    Raises:
        InputError: as `load`, or the file judges another calibration.
    """
    content = read_bytes(path).removeprefix(b"\xef\xbb\xbf")
    if (kind := _kind(content, path)) != "evaluation":
        raise InputError(
            f"{path} holds {_article(kind)}; expected an evaluation. Hand in the file that has it."
        )
    return _thing(
        content, kind, path, [calibration or load_calibration(Path(path).with_name(CALIBRATION_NAME))]
    )


def load_own_camera(path: str | Path) -> Camera:
    """The camera of a file, also out of a calibration or a scene; errors as `load`."""
    return camera_in(read_bytes(path), path)


def camera_in(content: bytes, path: str | Path) -> Camera:
    """The camera in the bytes of a file of ours; errors as `load`."""
    thing = _loaded(content, path)
    return _expect(Camera, thing.camera if isinstance(thing, Calibration | Scene) else thing, path)


def _expect(core: type, thing: Any, path: str | Path) -> Any:
    if isinstance(thing, core):
        return thing
    raise InputError(
        f"{path} holds {_named(thing)}; expected {core.__name__.lower()}. Hand in the file that has it."
    )


def _named(thing: Any) -> str:
    return _article(type(thing).__name__.lower())


def _article(kind: str) -> str:
    return kind if kind.endswith("s") else f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _kind(content: bytes, path: str | Path) -> str:
    """What the file says it is, where we can read it."""
    try:
        content.decode()
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not JSON (byte {error.start} is no UTF-8); expected a file that orthoscope wrote,"
            f" such as"
            " calibration.json."
        ) from error
    try:
        header = msgspec.json.decode(content, type=_Header)
    except msgspec.ValidationError as error:
        raise InputError(_foreign(path)) from error
    except RecursionError as error:
        raise InputError(f"{path} nests without end; expected a file that orthoscope wrote.") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InputError(_malformed(content, path, error)) from error
    if header.format > FORMAT:
        raise InputError(
            f"{path} was written by a newer orthoscope (format {header.format}; this one reads up to"
            f" {FORMAT}). Upgrade: pip install -U orthoscope."
        )
    if header.orthoscope not in KINDS_OF_FILE or header.format < 1:
        raise InputError(_foreign(path))
    return header.orthoscope


def _foreign(path: str | Path) -> str:
    return (
        f"{path} is JSON, but not of orthoscope; expected an object that opens with "
        f'{{"orthoscope": "{"|".join(KINDS_OF_FILE)}", "format": {FORMAT}, ...}}. Hand in a file that'
        " orthoscope wrote."
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
    return (
        f"{path} is not JSON ({error}); expected a file that orthoscope wrote, such as calibration.json."
        " Cameras of other tools are read by orthoscope.load_camera."
    )
