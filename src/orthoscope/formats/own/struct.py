"""What the objects of our files have in common: unknown fields are refused, and null says what NaN says in
memory, since JSON has no word for it.

A `Record` has the very fields of a type of the core whose values are plain: numbers, words, sequences of
them. It is then enough to name the type and to annotate the fields; conversion both ways is said here.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

import msgspec
import numpy as np

from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["FileStruct", "Number", "Record", "array_of", "null_for_nan", "rows_of"]

Number = float | None  # null where the number does not exist


class FileStruct(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """An object of a file; a field that has its default is left out."""


class Record(FileStruct):
    """An object with the fields of `CORE`, plain values all."""

    CORE: ClassVar[type]

    @classmethod
    def of(cls, thing: Any) -> Self:
        return cls(**{name: null_for_nan(getattr(thing, name)) for name in cls.__struct_fields__})

    def core(self) -> Any:
        numbers = {field.name for field in msgspec.structs.fields(self) if field.type == Number}
        values = {name: getattr(self, name) for name in self.__struct_fields__}
        return self.CORE(
            **{
                name: float("nan") if value is None and name in numbers else value
                for name, value in values.items()
            }
        )


def null_for_nan(value: Any) -> Any:
    """A plain value, None in the place of a number that does not exist."""
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def rows_of(values: ndarray) -> list[Any]:
    """An array as nested lists, None in the place of NaN."""
    finite = np.isfinite(values)
    if finite.all():
        return values.tolist()
    known = values.astype(object)
    known[~finite] = None
    return known.tolist()


def array_of(rows: list[Any], *shape: int) -> ndarray:
    """Nested lists as an array of this shape (-1: as many as there are), NaN in the place of None.

    Raises:
        InputError: they are not of that shape.
    """
    try:
        return np.array(rows, dtype=float).reshape(shape)
    except ValueError as error:
        expected = " by ".join("any" if side < 0 else str(side) for side in shape)
        raise InputError(f"rows of numbers are not {expected}, as was expected") from error
