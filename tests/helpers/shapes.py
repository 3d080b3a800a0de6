"""The checker of annotations that the import hook in conftest.py puts on every function of orthoscope.

To check a call takes several times what most calls take, and a function that hands on a wrong shape does so
from its first call on. So calls 1, 10, 100... of each function in each test are checked; of one within a
function, which is made anew each time and so is its check, the first of all.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from functools import partial, wraps
from types import CodeType
from typing import Any

from beartype import beartype
from beartype.roar import BeartypeDecorHintException
from jaxtyping import jaxtyped

__all__ = ["begin_test", "checked", "sampled"]

# These calls of a function in a test are checked.
CHECKED_CALLS = frozenset(10**power for power in range(8))
# How often each function was called in this test.
_CALLS: dict[CodeType, int] = {}
# Functions within functions that were checked once.
_INNER_CHECKED: set[CodeType] = set()


def begin_test() -> None:
    """Let the calls be counted from the start."""
    _CALLS.clear()


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with its arguments and result checked; as it is where a hint (a plain Protocol, say)
    cannot be checked at run time.
    """
    try:
        return beartype(function)
    except BeartypeDecorHintException:
        return function


def sampled(thing: Any = None, *, typechecker: Callable[..., Any] = checked) -> Any:
    """Like `jaxtyping.jaxtyped`, for a function or a dataclass, but for the calls that are not checked.

    Args:
        thing: the function, or the class; None gives the decorator.
        typechecker: makes a function check its arguments and result.
    """
    if thing is None:
        return partial(sampled, typechecker=typechecker)
    if not inspect.isclass(thing):
        return _sampled(thing, typechecker)
    if dataclasses.is_dataclass(thing) and not hasattr(
        thing.__init__, "sampled"
    ):  # not one that is inherited
        thing.__init__ = _sampled(thing.__init__, typechecker)
    return thing


def _sampled(function: Any, typechecker: Callable[..., Any]) -> Callable[..., Any]:
    code = function.__code__
    is_inner = "<locals>" in function.__qualname__
    check: Callable[..., Any] | None = None

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        nonlocal check
        calls = _CALLS[code] = _CALLS.get(code, 0) + 1
        if calls not in CHECKED_CALLS or code in _INNER_CHECKED:
            return function(*args, **kwargs)
        if is_inner:
            _INNER_CHECKED.add(code)
        if check is None:
            check = jaxtyped(function, typechecker=typechecker)
        return check(*args, **kwargs)

    call.sampled = True
    return call
