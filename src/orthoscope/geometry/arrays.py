"""Arrays at the border: checked, converted to float64, frozen; and the two errors that everything raises.

`Float["n 2"]` and its kin annotate shapes.  They are jaxtyping's where jaxtyping has been imported first (the
tests do, and beartype then checks every call); otherwise they are plain arrays, so a user pays nothing.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Bool, Float, Int
else:

    class _PlainArray:
        def __class_getitem__(cls, _: str) -> type[ndarray]:
            return ndarray

    Bool = Float = Int = _PlainArray

__all__ = [
    "Bool",
    "CalibrationError",
    "Float",
    "InputError",
    "Int",
    "distinct",
    "evenly",
    "frozen",
    "median",
    "ndarray",
    "normalised",
]


class InputError(ValueError):
    """What was handed in is wrong; the message says what was got, what was expected and what to do."""


class CalibrationError(RuntimeError):
    """The data cannot answer; the message says why and what photographs would help."""


def frozen(values: Any, shape: tuple[int | None, ...], name: str, dtype: type = np.float64) -> ndarray:
    """A read-only copy of `values` that has the wanted shape and finite numbers only.

    Args:
        values: anything that numpy makes an array of.
        shape: the wanted one; None stands for any length.
        name: what the values are called in a message.
        dtype: of the copy.
    Raises:
        InputError: the shape is another, or a value is NaN, infinite or no number.
    """
    try:
        array = np.array(values, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name} is not an array of numbers ({error}). Hand in shape {_shape(shape)}."
        ) from error
    if array.ndim != len(shape) or any(
        want not in (None, got) for want, got in zip(shape, array.shape, strict=True)
    ):
        raise InputError(f"{name} has shape {_shape(array.shape)}; expected {_shape(shape)}.")
    if not np.isfinite(array).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(
            f"{name} has {array[place]} at {list(place)}; expected finite numbers. Drop that entry."
        )
    array.setflags(write=False)
    return array


def normalised(vectors: Float[ndarray, "*batch d"]) -> Float[ndarray, "*batch d"]:
    """Vectors scaled to length 1 along the last axis."""
    return vectors / np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))


def distinct(values: Int[ndarray, " n"]) -> Int[ndarray, " m"]:
    """Whole numbers in ascending order, each once; numpy's own loads its masked arrays."""
    ordered = np.sort(values)
    return ordered[np.concatenate([[True], ordered[1:] != ordered[:-1]])] if len(ordered) else ordered


def evenly(count: int, wanted: int) -> Int[ndarray, " v"]:
    """At most so many of the numbers below `count`, evenly picked, ascending."""
    return distinct(np.linspace(0, count - 1, wanted).round().astype(int))


def median(values: ndarray) -> float:
    """The median of all values; NaN where there is none, or where one is NaN.

    numpy's own loads its masked arrays and takes ten times as long for the corners of a board.
    """
    flat = np.ravel(values)
    count = flat.size
    if not count:
        return float("nan")
    low, high = (count - 1) // 2, count // 2
    ordered = np.partition(flat, (low, high, count - 1))  # NaN comes last
    return float("nan") if np.isnan(ordered[-1]) else 0.5 * (float(ordered[low]) + float(ordered[high]))


def _shape(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("n" if size is None else str(size) for size in shape) + ")"
