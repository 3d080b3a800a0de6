"""Photographs that the user leaves out by name: they stay in detections.json and take no part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath

from orthoscope.geometry.arrays import InputError
from orthoscope.targets.detections import Detections, SetAside, photograph_of

__all__ = ["LEFT_OUT_REASON", "left_out"]

# A photograph that `--without` leaves out has this reason.
LEFT_OUT_REASON = "left out by --without"
# An error lists so many names of photographs.
LISTED_PHOTOGRAPHS = 6


def left_out(detections: Detections, names: Sequence[str]) -> Detections:
    """The detections without these photographs, which are set aside.

    Args:
        names: of views; a file's name without its folders is enough where it is the only such one.
    Raises:
        InputError: there is no such photograph, or nothing would be left.
    """
    views = detections.views
    known = [view.image for view in views] + [entry.image for entry in detections.set_aside]
    out = {view for name in names for view in _named(name, known)}
    kept = [i for i, view in enumerate(views) if view.image not in out]
    if not kept:
        raise InputError("--without leaves no photograph; expected some to calibrate from. Leave out fewer.")
    aside = (SetAside(view.image, LEFT_OUT_REASON) for view in views if view.image in out)
    return replace(detections.only(kept), set_aside=(*detections.set_aside, *aside))


def _named(name: str, known: Sequence[str]) -> list[str]:
    """The views that are meant: one, or all of a photograph of several targets."""
    if name in known:
        return [name]
    alike = [each for each in known if PurePath(name).name in (PurePath(each).name, _file(each))]
    if len(alike) == 1 or len({photograph_of(each) for each in alike}) == 1:
        return alike
    shown = ", ".join((alike or list(known))[:LISTED_PHOTOGRAPHS])
    raise InputError(f"--without {name!r} names no single photograph; expected one such as {shown}.")


def _file(view: str) -> str:
    return PurePath(photograph_of(view)).name
