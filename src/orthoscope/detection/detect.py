"""Photographs to Detections: each is read, looked at and refined on its own, many at the same time.

A photograph that cannot take part is set aside with the reason, and the others go on: one that cannot be
read, one of another size than most, one that shows the same picture as another, one without the target.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orthoscope.detection.chessboards.chessboard import board_size, lattice_sizes
from orthoscope.detection.recognition.marker_layout import marker_boards
from orthoscope.detection.several_targets import see_members
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.detection.table import check_can_be_seen
from orthoscope.files.images import MOST_MEGAPIXELS
from orthoscope.files.pictures import Given, Picture, pictures
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.machine.cores import at_once
from orthoscope.targets.aprilgrid import AprilGrid
from orthoscope.targets.board import Board
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.circles import Circles
from orthoscope.targets.detections import Detections, Remark, SetAside, View, view_name
from orthoscope.targets.grid_board import GridBoard
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

__all__ = ["detect"]

# Where none showed the target the reasons of so many photographs are told.
LISTED_PHOTOGRAPHS = 5
# Of these kinds another board is told by its markers.
MARKED = (Charuco, AprilGrid, GridBoard)
# Where none showed the target so many photographs are looked at for a board of another size.
TRIED_PHOTOGRAPHS = 5
# Lattices of one size in so many of them are a board's.
ALIKE_PHOTOGRAPHS = 3

# Discs that are larger or smaller than described by more than this share of it are told of.
MOST_DIAMETER_OFF = 0.15


class _Look(NamedTuple):
    """What one photograph came to: its size and a digest of its picture, and corners, of each target that it
    shows by the target's number, or the reason why there are none.
    """

    size: tuple[int, int] | None
    digest: str
    found: dict[int, Sight]
    reason: str


def detect(
    photographs: Given,
    target: Target | str,
    *,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    most_megapixels: float = MOST_MEGAPIXELS,
    topic: str | None = None,
) -> Detections:
    """Find the target in photographs.

    Args:
        photographs: files, folders, globs and films; or arrays (h,w) or (h,w,3), alone, several or by name.
        target: or its description, such as `chessboard:9x6:25mm`; of several ` + ` between them.
        jobs: photographs looked at at once, as many as there are cores.
        executor: of one's own, instead of jobs.
        progress: called with (done, total, name).
        most_megapixels: larger photographs are set aside unread.
        topic: of a ROS bag with several that have pictures.
    Raises:
        InputError: photographs or target are wrong.
        CalibrationError: no photograph shows the target.
    """
    target = parse_target(target) if isinstance(target, str) else target
    check_can_be_seen(target)
    given = pictures(photographs, topic=topic)
    names = [picture.name for picture in given]
    looks: list[_Look] = []
    with nullcontext(executor) if executor else ThreadPoolExecutor(at_once(jobs)) as run:
        asked = [_placed(picture) for picture in given]
        for look in run.map(_look, asked, [target] * len(given), [most_megapixels] * len(given)):
            looks.append(look)
            if progress:
                progress(len(looks), len(given), names[len(looks) - 1])
    size = _usual_size(looks)
    views, aside = _sorted_out(names, looks, size, bool(target.members))
    remarks = [
        Remark(name, f"{(target.members or (target,))[number].name} {sight.remark}")
        for name, look in zip(names, looks, strict=True)
        for number, sight in look.found.items()
        if sight.remark
    ]
    if not views or size is None:
        raise CalibrationError(_nothing_found(given, looks, target, aside))
    remarks += [
        *_never_seen(looks, target),
        *_otherwise_drawn(looks, target),
        *_if_another(given, looks, target, views),
    ]
    return Detections(target, size, tuple(views), tuple(aside), remarks=tuple(remarks))


def _placed(picture: Picture) -> Picture:
    """The picture with the whole path of its file: an executor's workers may stand in another folder."""
    return replace(picture, source=picture.source.absolute()) if isinstance(picture.source, Path) else picture


def _look(picture: Picture, target: Target, most_megapixels: float) -> _Look:
    """One photograph, from its file to its corners (ids and pixels)."""
    try:
        grey = picture.grey(most_megapixels=most_megapixels)
    except InputError as error:
        named = picture.source if isinstance(picture.source, Path) else picture.name
        return _Look(None, "", {}, str(error).removeprefix(f"{named} "))
    size = (grey.shape[1], grey.shape[0])
    sights = see_members(grey, target)
    reasons = [
        f"{member.name} {sight.reason}"
        for member, sight in zip(target.members or (target,), sights, strict=True)
        if isinstance(sight, Unseen)
    ]
    return _Look(
        size,
        hashlib.sha256(grey.tobytes()).hexdigest(),
        {number: sight for number, sight in enumerate(sights) if isinstance(sight, Sight)},
        "; ".join(reasons),
    )


def _usual_size(looks: list[_Look]) -> tuple[int, int] | None:
    """The size that most photographs have, among those that show the target where any does; of two, the
    larger.
    """
    sizes = [look.size for look in looks if look.size and look.found] or [
        look.size for look in looks if look.size
    ]
    if not sizes:
        return None
    counts = Counter(sizes)
    return max(counts, key=lambda size: (counts[size], size[0] * size[1]))


def _sorted_out(
    names: list[str], looks: list[_Look], size: tuple[int, int] | None, several: bool
) -> tuple[list[View], list[SetAside]]:
    """Views, of several targets one for each that a photograph shows; and photographs set aside."""
    views: list[View] = []
    aside: list[SetAside] = []
    first: dict[str, str] = {}
    for name, look in zip(names, looks, strict=True):
        if look.size and look.size != size and size:
            aside.append(
                SetAside(name, f"its size is {look.size[0]}x{look.size[1]}, most have {size[0]}x{size[1]}")
            )
        elif look.digest and look.digest in first:
            aside.append(SetAside(name, f"the same picture as {first[look.digest]}"))
        elif not look.found:
            aside.append(SetAside(name, look.reason))
        else:
            views += [
                View(view_name(name, number) if several else name, sight.ids, sight.pixels)
                for number, sight in look.found.items()
            ]
        if look.digest:
            first.setdefault(look.digest, name)
    return views, aside


def _nothing_found(given: list[Picture], looks: list[_Look], target: Target, aside: list[SetAside]) -> str:
    """Why no photograph could be used, and which board seems to be there instead."""
    readable = [picture for picture, look in zip(given, looks, strict=True) if look.size]
    reasons = "".join(f"\n  {entry.image}: {entry.reason}" for entry in aside[:LISTED_PHOTOGRAPHS])
    if more := len(aside) - LISTED_PHOTOGRAPHS:
        reasons += f"\n  and {more} more" if more > 0 else ""
    if not readable:
        return f"none of {len(given)} photographs can be read; expected images. Look at them:{reasons}"
    told = f"{target.name} was found in none of {len(readable)} photographs; expected it in most of them."
    if isinstance(target.board, Chessboard) and (board := _board_instead(readable, target.board)):
        where = readable[0].name if len(readable) == 1 else "them"
        return f"{told} There seems to be {_instead(board, target.board, where)}."
    if isinstance(target.board, MARKED) and (seen := _markers_instead(readable, target.board)):
        return (
            f"{told} The markers in them make {seen}: if that is the one, say so, with its lengths.{reasons}"
        )
    advice = target.board.advice if target.board else "See that it is whole, sharp and lit"
    return f"{told} {advice}:{reasons}"


def _markers_instead(given: list[Picture], board: Board) -> str:
    """What markers in a few photographs make, where that is another board; nothing where it is not seen."""
    greys = [picture.grey(most_megapixels=np.inf) for picture in _few(given)]
    for seen in marker_boards(greys):
        families = {
            dictionary.rpartition("_")[0] for dictionary, _ in filter(None, (seen.markers, board.markers))
        }
        if type(seen) is not type(board) or seen.grid != board.grid or len(families) > 1:
            return f"--target {seen.description}"
    return ""


def _few(given: list[Picture]) -> list[Picture]:
    """Some photographs, evenly picked."""
    return given[:: max(1, len(given) // TRIED_PHOTOGRAPHS)][:TRIED_PHOTOGRAPHS]


def _never_seen(looks: list[_Look], target: Target) -> list[Remark]:
    """A remark on each of several targets that no photograph shows."""
    count = sum(look.size is not None for look in looks)
    never = [
        member
        for number, member in enumerate(target.members)
        if not any(number in look.found for look in looks)
    ]
    told = f"was found in none of {count} photographs; expected in some of them."
    return [
        Remark(member.name, f"{told} {member.board.advice if member.board else 'See that it is there'}")
        for member in never
    ]


def _otherwise_drawn(looks: list[_Look], target: Target) -> list[Remark]:
    """A remark on each grid of discs whose discs are larger or smaller than its description says."""
    remarks = []
    for number, member in enumerate(target.members or (target,)):
        seen = [look.found[number].diameter for look in looks if number in look.found]
        if not isinstance(member.board, Circles) or not any(seen):
            continue
        said, drawn = member.board.diameter, float(np.median([one for one in seen if one > 0]))
        if abs(drawn - said) > MOST_DIAMETER_OFF * said and drawn < member.board.nearest:
            spec = replace(member.board, diameter=round(drawn, 4)).description
            sizes = [f"{1e3 * length:.1f} mm" for length in (drawn, member.board.nearest, said)]
            words = "its discs are seen {} wide where they stand {} apart; expected {} as described.".format(
                *sizes
            )
            remarks.append(Remark(member.name, f"{words} If that is so, say --target {spec}"))
    return remarks


def _board_instead(given: list[Picture], target: Chessboard) -> tuple[int, int] | None:
    """The size of the board that a few photographs show, where it is not the target's: by its four sides, or,
    where these are not seen, by the lattice of one size that comes again and again.
    """
    greys = [picture.grey(most_megapixels=np.inf) for picture in _few(given)]
    whole = Counter(board for grey in greys if (board := board_size(grey)))
    again = Counter(size for grey in greys for size in lattice_sizes(grey)) if not whole else Counter()
    seen = whole or {size: count for size, count in again.items() if count >= ALIKE_PHOTOGRAPHS}
    others = {board: count for board, count in seen.items() if sorted(board) != sorted(target.grid)}
    return max(others, key=lambda board: others[board], default=None)


def _if_another(given: list[Picture], looks: list[_Look], target: Target, views: list[View]) -> list[Remark]:
    """A remark where most photographs do not show the target and seem to show a board of another size."""
    unseen = [picture for picture, look in zip(given, looks, strict=True) if look.size and not look.found]
    if len(unseen) <= len(views) or not isinstance(target.board, Chessboard):
        return []
    if (board := _board_instead(unseen, target.board)) is None:
        return []
    return [Remark(unseen[0].name, f"there seems to be {_instead(board, target.board, 'it and others')}")]


def _instead(board: tuple[int, int], target: Chessboard, where: str) -> str:
    columns, rows = board
    spec = replace(target, columns=columns, rows=rows).description
    return f"a board of {columns}x{rows} inner corners in {where}: if that is the one, say --target {spec}"
