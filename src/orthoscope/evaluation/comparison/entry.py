"""Who is compared, in the words of a user: a method, its lens, its settings.

`METHOD`, `METHOD:LENS` with the lens as everywhere (`fccm:brown:k1,k2`), and any setting of the method's own
by its name (`decoupled:shape=flat`, `fccm:rational:loss=huber`). A camera from elsewhere stays as it is.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any, NamedTuple

from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import InputError
from orthoscope.methods import METHODS
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.table import parse_lens

__all__ = ["AS_IT_IS", "USUAL", "Entry", "camera_entry", "parse_entry"]

USUAL = (
    *METHODS,
    "decoupled:shape=free",
    "decoupled:shape=flat",
    "fccm:rational",
)  # fccm alone: brown, or kannala_brandt if wide
# These lenses are in no table.
LENSES_IN_NO_TABLE = ("auto", "free")
TRUTHS = {"true": True, "yes": True, "false": False, "no": False}


# What stands for a method where a camera is given, and none is made.
AS_IT_IS = "as it is"


class Entry(NamedTuple):
    """A method with its settings, under the name that a user gave it; or a camera that is given, with the
    calibration that it is of, where that is known.
    """

    name: str
    method: str
    settings: Mapping[str, Any]
    camera: Camera | None = None
    calibration: Calibration | None = None


def camera_entry(name: str, camera: Camera, *, calibration: Calibration | None = None) -> Entry:
    """The entry of a camera from elsewhere, which stays as it is: each view's pose alone is fitted.

    Args:
        name: that it is shown by, such as its file's.
        camera: of the photographs' size.
        calibration: that it is of; its target's shape is used where it fits the photographs better.
    """
    return Entry(name, AS_IT_IS, {}, camera, calibration)


def parse_entry(text: str) -> Entry:
    """The entry of a description.

    Args:
        text: such as `fccm`, `fccm:brown`, `fccm:brown:k1,k2` or `decoupled:brown:shape=flat`.
    Raises:
        InputError: a method, a lens or a setting that is not there, or a value that is none.
    """
    if "." in text.split(":")[0]:
        raise InputError(
            f"{text!r} is neither a method nor a file that is there; expected a camera's file, or one of"
            f" {', '.join(METHODS)}."
        )
    method, *parts = (part.strip() for part in text.strip().split(":"))
    if method not in METHODS:
        raise InputError(
            f"method {method!r} is not known; expected one of {', '.join(METHODS)}, alone or as in"
            " fccm:brown."
        )
    lens = ":".join(part for part in parts if "=" not in part)
    if lens and lens not in LENSES_IN_NO_TABLE:
        parse_lens(lens)
    settings: dict[str, Any] = {"lens": lens} if lens else {}
    known = _settings_of(method)
    for part in parts:
        name, equals, value = part.partition("=")
        if equals:
            if name not in known:
                raise InputError(f"method {method!r} has no setting {name!r}; it has {', '.join(known)}.")
            settings[name] = _value(name, value, known[name])
    return Entry(text.strip(), method, settings)


def _settings_of(method: str) -> dict[str, Any]:
    """The settings that can be written as text, with the values that they have when left alone."""
    parameters = inspect.signature(METHODS[method]).parameters.values()
    return {
        each.name: each.default
        for each in parameters
        if isinstance(each.default, bool | int | float | str | tuple)
    }


def _value(name: str, text: str, usual: Any) -> Any:
    """A value of the kind that the setting usually has; several are separated by commas."""
    if isinstance(usual, tuple):
        return tuple(_value(name, part, usual[0] if usual else "") for part in text.split(",") if part)
    if isinstance(usual, str):
        return text
    try:
        return TRUTHS[text.lower()] if isinstance(usual, bool) else type(usual)(text)
    except (KeyError, ValueError) as error:
        expected = (
            "true or false"
            if isinstance(usual, bool)
            else "a whole number"
            if isinstance(usual, int)
            else "a number"
        )
        raise InputError(
            f"setting {name!r} is {text!r}; expected {expected}, such as {name}={str(usual).lower()}."
        ) from error
