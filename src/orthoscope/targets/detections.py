"""What was found in photographs: View, Detections.

A corner's *id* is its row in `Target.points`; a view lists ids, so partial boards are normal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import InputError, frozen, ndarray
from orthoscope.targets.target import Target

__all__ = ["Detections", "Outlier", "Remark", "SetAside", "View", "photograph_of", "view_name"]

# What stands between a photograph's name and the number of the target, where it shows several.
BOARD = ":board"


def view_name(photograph: str, member: int) -> str:
    """The name of what a photograph shows of one of several targets, numbered from 0 here, from 1 there."""
    return f"{photograph}{BOARD}{member + 1}"


def photograph_of(view: str) -> str:
    """The name of the photograph that a view, of one of several targets perhaps, was found in."""
    photograph, _, number = view.rpartition(BOARD)
    return photograph if photograph and number.isdecimal() else view


@dataclass(frozen=True, eq=False)
class View:
    """What was found in one photograph; of several targets, each has a view of its own.

    Attributes:
        image: the photograph's name, with the target's number where there are several (`view_name`).
        ids: (n,) distinct rows of the target's points.
        pixels: (n,2) where they were seen.
    Raises:
        InputError: NaN, infinite or repeated corners.
    """

    image: str
    ids: ndarray
    pixels: ndarray

    def __post_init__(self) -> None:
        ids = frozen(self.ids, (None,), f"view {self.image!r}: ids", dtype=np.int64)
        pixels = frozen(self.pixels, (len(ids), 2), f"view {self.image!r}: pixels")
        ordered = np.sort(ids)
        if (again := ordered[1:] == ordered[:-1]).any():
            corner = int(ordered[1:][again][0])
            raise InputError(
                f"view {self.image!r} has corner {corner} more than once; expected each once. Drop the"
                " repeats."
            )
        object.__setattr__(self, "ids", ids)
        object.__setattr__(self, "pixels", pixels)

    def __repr__(self) -> str:
        return f"View({self.image!r}, {len(self.ids)} corners)"


class SetAside(NamedTuple):
    """A photograph that takes no part, and why."""

    image: str
    reason: str


class Remark(NamedTuple):
    """What a person should know of how a photograph was seen, though it takes part, or of a target.

    Attributes:
        image: the photograph's name, or the target's.
        words: a sentence without its full stop.
    """

    image: str
    words: str


class Outlier(NamedTuple):
    """A corner that was found but takes no part, and why.

    Attributes:
        image: the photograph's name.
        id: row of the target's points.
        pixel: (x, y), where it was seen.
        reason: why it takes no part.
    """

    image: str
    id: int
    pixel: tuple[float, float]
    reason: str


@dataclass(frozen=True, eq=False)
class Detections:
    """One target, or several, seen by one camera in photographs.

    Attributes:
        target: what was photographed; a view of several shows one of its members.
        image_size: (width, height) pixels.
        views: what was found, photograph by photograph.
        set_aside: photographs without a view, with the reason.
        outliers: corners that were found and are in no view, with the reason.
        disc_centres: whether discs' pixels are where centres are seen, not the centres of outlines.
        remarks: what to know of how photographs were seen.
    Raises:
        InputError: a repeated image name, a corner that the target does not have, or corners of two of its
            members in one view.
    """

    target: Target
    image_size: tuple[int, int]
    views: tuple[View, ...]
    set_aside: tuple[SetAside, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    disc_centres: bool = False
    remarks: tuple[Remark, ...] = ()

    def __post_init__(self) -> None:
        width, height = (int(side) for side in self.image_size)
        if width < 1 or height < 1:
            raise InputError(f"image_size is {self.image_size}; expected (width, height) in pixels.")
        object.__setattr__(self, "image_size", (width, height))
        object.__setattr__(self, "views", tuple(self.views))
        object.__setattr__(self, "set_aside", tuple(SetAside(*entry) for entry in self.set_aside))
        object.__setattr__(self, "outliers", tuple(Outlier(*entry) for entry in self.outliers))
        object.__setattr__(self, "remarks", tuple(Remark(*entry) for entry in self.remarks))
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
            if self.target.members and len(np.unique(self.member_of(view.ids))) > 1:
                raise InputError(
                    f"view {view.image!r} has corners of several targets; expected those of one. Make a view"
                    " for each."
                )

    def __repr__(self) -> str:
        width, height = self.image_size
        aside = f", {len(self.set_aside)} set aside" if self.set_aside else ""
        seen = f"{len(self.views)} views of {width}x{height}, {self.corners} corners"
        return f"Detections({self.target.name}, {seen}{aside})"

    @property
    def corners(self) -> int:
        """How many corners were seen in all views together."""
        return sum(len(view.ids) for view in self.views)

    def member_of(self, ids: ndarray) -> ndarray:
        """Which of the target's members corners are of, from 0; all are of the first where it is one."""
        return np.searchsorted([part.stop for part in self.target.parts], ids, side="right")

    def only(self, indices: Sequence[int] | ndarray) -> Detections:
        """The same, with the views of these indices and their outliers only (nothing is set aside by it)."""
        views = tuple(self.views[i] for i in indices)
        images = {view.image for view in views}
        return replace(
            self, views=views, outliers=tuple(outlier for outlier in self.outliers if outlier.image in images)
        )
