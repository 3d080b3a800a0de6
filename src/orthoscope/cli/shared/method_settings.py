"""`--set NAME=VALUE`: any setting of a method, as its function takes it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from orthoscope.geometry.arrays import InputError

__all__ = ["settings_from"]


def settings_from(texts: Sequence[str]) -> dict[str, Any]:
    """Settings by name: numbers, true and false as they are written, lists with commas, all else as text.

    Raises:
        InputError: a text has no `=`, or a name is given twice.
    """
    given: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise InputError(f"--set {text!r} is not NAME=VALUE; write it as in --set correct=nearest.")
        if name in given:
            raise InputError(f"--set names {name!r} twice; expected each setting once. Drop one.")
        given[name] = (
            [_value(part) for part in value.split(",")]
            if "," in value and ":" not in value
            else _value(value)
        )
    return given


def _value(text: str) -> Any:
    """A number or truth value where it reads as one."""
    try:
        return json.loads(text)
    except ValueError:
        return text
