"""Methods that make a calibration from detections, by name.

Each is a function in a file of its own that has its name, loaded when it is first asked for: one calibration
takes one method.
"""

from __future__ import annotations

import importlib
import inspect
from collections import UserDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, Unpack, get_origin, get_type_hints, overload

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.disc_centres import at_disc_centres, has_outlines
from orthoscope.geometry.arrays import InputError
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.settings import (
    DecoupledSettings,
    FccmSettings,
    FitzgibbonSettings,
    HartleyKangSettings,
    MldcSettings,
    NmldcSettings,
)
from orthoscope.targets.detections import Detections

__all__ = ["METHODS", "calibrate", "check_settings", "settings_of"]


# What a message calls the kinds of plain values.
KINDS_OF_VALUES = {str: "a word", bool: "true or false", int: "a whole number", float: "a number"}


class _Methods(UserDict[str, Any]):
    """Functions by name; what stands in the table is the function, or the name of its file until it is asked
    for.

    Methods of other packages are looked for when a name is none of ours, or all are asked for.
    """

    def __getitem__(self, name: str) -> Callable[..., Calibration]:
        if name not in self:
            raise KeyError(name)
        if isinstance(self.data[name], str):
            module, _, attribute = self.data[name].partition(":")
            self.data[name] = getattr(importlib.import_module(module), attribute or name)
        return self.data[name]

    def __contains__(self, name: object) -> bool:
        if name not in self.data:
            self._look_for_others()
        return name in self.data

    def __iter__(self) -> Iterator[str]:
        self._look_for_others()
        return iter(self.data)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def _look_for_others(self) -> None:
        self.data |= {name: value for name, value in _of_others().items() if name not in self.data}


METHODS = _Methods(
    {
        "decoupled": f"{__name__}.decoupled.decoupled",
        "fccm": f"{__name__}.fccm",
        "mldc": f"{__name__}.mldc.mldc",
        "nmldc": f"{__name__}.mldc.nmldc",
        "hartley_kang": f"{__name__}.radial_curve.hartley_kang",
        "fitzgibbon": f"{__name__}.radial_curve.fitzgibbon",
    }
)


def _of_others() -> dict[str, str]:
    """Methods of other packages: entry points of the group `orthoscope.methods`, `name =
    "package.module:name"`.

    They are functions like these here; where the attribute has another name than the entry, it is the entry's
    that counts.
    """
    from importlib.metadata import entry_points

    return {entry.name: entry.value for entry in entry_points(group="orthoscope.methods")}


@overload
def calibrate(
    detections: Detections, *, method: Literal["decoupled"] = ..., **settings: Unpack[DecoupledSettings]
) -> Calibration: ...
@overload
def calibrate(
    detections: Detections, *, method: Literal["fccm"], **settings: Unpack[FccmSettings]
) -> Calibration: ...
@overload
def calibrate(
    detections: Detections, *, method: Literal["nmldc"], **settings: Unpack[NmldcSettings]
) -> Calibration: ...
@overload
def calibrate(
    detections: Detections, *, method: Literal["mldc"], **settings: Unpack[MldcSettings]
) -> Calibration: ...
@overload
def calibrate(
    detections: Detections, *, method: Literal["hartley_kang"], **settings: Unpack[HartleyKangSettings]
) -> Calibration: ...
@overload
def calibrate(
    detections: Detections, *, method: Literal["fitzgibbon"], **settings: Unpack[FitzgibbonSettings]
) -> Calibration: ...
@overload
def calibrate(detections: Detections, *, method: str, **settings: Any) -> Calibration: ...
@with_one_thread
def calibrate(detections: Detections, *, method: str = "decoupled", **settings: Any) -> Calibration:
    """Calibrate a camera from detections by a method of METHODS; its settings are the method's own (lens,
    skew, loss, ...).

    Discs are calibrated twice: what a first fit says of their tilt moves the centres of their outlines to
    where the discs' centres are seen (`fitting/disc_centres.py`).

    Raises:
        CalibrationError: the views cannot tell the camera.
        InputError: a method or a setting that is none.
    """
    if not isinstance(detections, Detections):
        raise InputError(
            f"what is to be calibrated is a {type(detections).__name__}; expected detections. Find corners"
            " first: orthoscope.detect(photographs, target)."
        )
    check_settings(method, settings)
    found = METHODS[method](detections, **settings)
    if not has_outlines(detections):
        return found
    images = [view.image for view in found.detections.views]
    moved = at_disc_centres(
        detections, found.camera, found.camera_from_target, images, shape=found.target_shape
    )
    return METHODS[method](moved, **settings)


def check_settings(method: str, settings: Mapping[str, Any]) -> None:
    """Lets settings pass that a method has, with values of the kind that each takes.

    Args:
        method: a name of METHODS.
        settings: by name.
    Raises:
        InputError: a method, a setting or a value's kind is none.
    """
    known = settings_of(method)
    if unknown := sorted(set(settings) - set(known)):
        raise InputError(f"method {method!r} has no setting {unknown[0]!r}; it has {', '.join(known)}.")
    try:
        kinds = get_type_hints(METHODS[method])
    except NameError:  # a method of another package, with annotations that only its type checker resolves
        return
    for name, value in settings.items():
        if _is_misfit(value, kinds.get(name)):
            raise InputError(
                f"setting {name!r} of method {method!r} is {value!r}; expected {_told(kinds.get(name))}."
            )


def _is_misfit(value: Any, kind: Any) -> bool:
    """Whether a plain value is of another kind than a parameter says; functions are let pass."""
    if kind is float:
        return isinstance(value, bool) or not isinstance(value, int | float)
    if kind in (str, bool, int):
        return type(value) is not kind
    return get_origin(kind) is Sequence and (isinstance(value, str) or not isinstance(value, Sequence))


def _told(kind: Any) -> str:
    return KINDS_OF_VALUES.get(kind, "a list")


def settings_of(method: str) -> list[str]:
    """The names of a method's settings.

    Raises:
        InputError: a method that is none.
    """
    if method not in METHODS:
        raise InputError(f"method {method!r} is not known; expected one of {', '.join(METHODS)}.")
    return list(inspect.signature(METHODS[method]).parameters)[1:]
