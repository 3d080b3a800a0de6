"""The checker of annotations that the import hook in conftest.py puts on every function of orthoscope."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from beartype import beartype
from beartype.roar import BeartypeDecorHintException

__all__ = ["checked"]


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with its arguments and result checked; as it is where a hint (a plain Protocol, say)
    cannot be checked at run time.
    """
    try:
        return beartype(function)
    except BeartypeDecorHintException:
        return function
