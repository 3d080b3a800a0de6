"""What is photographed and what was found: Target, View, Detections.

A corner's *id* is its row in `Target.points`; a view lists ids, so partial boards are normal.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import InputError, frozen, ndarray

__all__ = [
    "Detections",
    "Outlier",
    "SetAside",
    "Target",
    "View",
    "chessboard",
    "parse_length",
    "parse_target",
]

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}


@dataclass(frozen=True, eq=False)
class Target:
    """A flat calibration target: where its corners nominally are.

    name: how it is asked for, such as `chessboard:9x6:25mm`. points: (m,3) metres, target frame, z = 0.
    lines: ids of the corners of each row and each column, in order. grid: (columns, rows) of a full
    chessboard, else None. Raises InputError where a point is not in the plane or a line names a corner that
    is not there.
    """

    name: str
    points: ndarray
    lines: tuple[ndarray, ...] = ()
    grid: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        points = frozen(self.points, (None, 3), f"target {self.name!r}: points")
        if np.abs(points[:, 2]).max(initial=0.0) > 0.0:
            raise InputError(
                f"target {self.name!r} has points off the plane z = 0; orthoscope calibrates with flat"
                " targets."
            )
        object.__setattr__(self, "points", points)
        lines = tuple(frozen(line, (None,), "line", dtype=np.int64) for line in self.lines)
        if any(((line < 0) | (line >= len(points))).any() for line in lines):
            raise InputError(f"target {self.name!r} has a line through a corner that it does not have.")
        object.__setattr__(self, "lines", lines)


@dataclass(frozen=True, eq=False)
class View:
    """What was found in one photograph.

    image: the photograph's name. ids: (n,) distinct rows of the target's points. pixels: (n,2) where they
    were seen. Raises InputError for NaN, infinite or repeated corners.
    """

    image: str
    ids: ndarray
    pixels: ndarray

    def __post_init__(self) -> None:
        ids = frozen(self.ids, (None,), f"view {self.image!r}: ids", dtype=np.int64)
        pixels = frozen(self.pixels, (len(ids), 2), f"view {self.image!r}: pixels")
        values, counts = np.unique(ids, return_counts=True)
        if (counts > 1).any():
            corner = int(values[counts > 1][0])
            raise InputError(
                f"view {self.image!r} has corner {corner} more than once; expected each once. Drop the"
                " repeats."
            )
        object.__setattr__(self, "ids", ids)
        object.__setattr__(self, "pixels", pixels)


class SetAside(NamedTuple):
    """A photograph that takes no part, and why."""

    image: str
    reason: str


class Outlier(NamedTuple):
    """A corner that was found but takes no part, and why.

    image: the photograph's name.  id: row of the target's points.  pixel: (x, y), where it was seen.
    """

    image: str
    id: int
    pixel: tuple[float, float]
    reason: str


@dataclass(frozen=True, eq=False)
class Detections:
    """One target seen by one camera in several photographs.

    image_size: (width, height) pixels.  set_aside: photographs without a view, with the reason.
    outliers: corners that were found and are in no view, with the reason.
    Raises InputError for a repeated image name or a corner that the target does not have.
    """

    target: Target
    image_size: tuple[int, int]
    views: tuple[View, ...]
    set_aside: tuple[SetAside, ...] = ()
    outliers: tuple[Outlier, ...] = ()

    def __post_init__(self) -> None:
        width, height = (int(side) for side in self.image_size)
        if width < 1 or height < 1:
            raise InputError(f"image_size is {self.image_size}; expected (width, height) in pixels.")
        object.__setattr__(self, "image_size", (width, height))
        object.__setattr__(self, "views", tuple(self.views))
        object.__setattr__(self, "set_aside", tuple(SetAside(*entry) for entry in self.set_aside))
        object.__setattr__(self, "outliers", tuple(Outlier(*entry) for entry in self.outliers))
        seen: set[str] = set()
        for view in self.views:
            if view.image in seen:
                raise InputError(
                    f"view {view.image!r} is there twice; expected each photograph once. Drop one."
                )
            seen.add(view.image)
            if len(view.ids) and not 0 <= view.ids.min() <= view.ids.max() < len(self.target.points):
                raise InputError(
                    f"view {view.image!r} has corner {int(view.ids.max())}; target {self.target.name!r} has"
                    f" corners 0 to {len(self.target.points) - 1}. Name the target that was photographed."
                )

    @property
    def corners(self) -> int:
        """How many corners were seen in all views together."""
        return sum(len(view.ids) for view in self.views)

    def only(self, indices: Sequence[int] | ndarray) -> Detections:
        """The same, with the views of these indices and their outliers only (nothing is set aside by it)."""
        views = tuple(self.views[i] for i in indices)
        images = {view.image for view in views}
        return replace(
            self, views=views, outliers=tuple(outlier for outlier in self.outliers if outlier.image in images)
        )


def chessboard(columns: int, rows: int, square: float) -> Target:
    """A chessboard of columns x rows inner corners, `square` metres apart; corner 0 first, row by row.

    Raises InputError for fewer than 2 x 2 corners or a square that has no size.
    """
    if columns < 2 or rows < 2 or columns * rows < 6 or not square > 0:
        raise InputError(
            f"a chessboard of {columns}x{rows} inner corners of {square:g} m cannot be used; "
            "expected at least 3x2 inner corners and a square larger than 0, such as chessboard:9x6:25mm."
        )
    y, x = np.mgrid[:rows, :columns].reshape(2, -1) * square
    ids = np.arange(rows * columns).reshape(rows, columns)
    return Target(
        name=f"chessboard:{columns}x{rows}:{round(square * 1e3, 9):g}mm",
        points=np.stack([x, y, np.zeros_like(x)], axis=1),
        lines=(*ids, *ids.T),
        grid=(columns, rows),
    )


def parse_length(text: str) -> float:
    """A length with its unit, such as `25mm`, in metres.

    Raises InputError without a number or a unit out of m, cm, mm, um, in.
    """
    found = re.fullmatch(r"\s*([0-9.eE+-]+)\s*([a-z]+)\s*", text)
    try:
        return float(found[1]) * METRES[found[2]]  # type: ignore[index]
    except (TypeError, ValueError, KeyError) as error:
        raise InputError(
            f"length {text!r} is not understood; expected a number and a unit ({', '.join(METRES)}), such as"
            " 25mm."
        ) from error


def parse_target(text: str) -> Target:
    """The target of a description such as `chessboard:9x6:25mm` (inner corners in a row, in a column, length
    of a square).

    Raises InputError where the description is none.
    """
    found = re.fullmatch(r"chessboard:(\d+)x(\d+):(.+)", text.strip())
    if not found:
        raise InputError(
            f"target {text!r} is not understood; expected chessboard:COLUMNSxROWS:SQUARE, "
            "counting inner corners, such as chessboard:9x6:25mm."
        )
    return chessboard(int(found[1]), int(found[2]), parse_length(found[3]))
