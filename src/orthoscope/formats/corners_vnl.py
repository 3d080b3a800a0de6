"""corners.vnl, the text table of corners that mrgingham writes and mrcal reads.

    # filename x y level
    frame1.jpg 1385.433 1471.719 0
    frame1.jpg 1483.597 1469.825 1
    frame2.jpg - - -

The legend names the columns; lines that open with ## or #! are remarks. An image has one line for each corner
of the target, row by row as our ids go (mrcal's object-width-n is the number of corners in a row), or a
single line of dashes where no board was found. The fourth column is `level` (how often the image was halved
to find the corner) or `weight`; its size is not used here. A corner counts as not found, as in mrcal, where
x, y or that column is a dash, where x, y or the level is negative, or the weight not positive. Pixels as
ours: (0, 0) is the centre of the first. mrcal: doc/how-to-calibrate.org, mrcal/calibration.py.

A corners.csv is the same with commas, and its legend, if it has one, without the #.
"""

from __future__ import annotations

from itertools import compress, count, pairwise
from operator import ne
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from orthoscope.files.whole_files import read_text, write_text
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.targets.detections import Detections, SetAside, View
from orthoscope.targets.mirrored import with_word_of_mirrors
from orthoscope.targets.target import Target

__all__ = ["SUFFIXES", "read_vnl", "write_vnl"]

# Files of such tables end so.
SUFFIXES = (".vnl", ".csv")

LEGEND = ["filename", "x", "y", "level"]
PRESENT = {
    "level": np.greater_equal,
    "weight": np.greater,
}  # how the fourth column compares with 0 where a corner was found


class _Table(NamedTuple):
    """The rows of a file: images (n), pixels (n,2), NaN where a corner was not found; and its text, for
    messages.
    """

    images: list[str]
    pixels: ndarray
    text: str

    def line(self, row: int) -> int:
        """The number of the line that a row stands on."""
        return [number for number, line in enumerate(self.text.split("\n"), 1) if _is_row(line.strip())][row]


def read_vnl(path: str | Path, target: Target, image_size: tuple[int, int]) -> Detections:
    """The corners of a corners.vnl or corners.csv file as detections.

    Args:
        path: of the file, which says by its ending which of them it is.
        target: whose corners they are.
        image_size: of the photographs, (width, height) pixels.
    Raises:
        InputError: the table is none, an image has another number of corners than the target or is there
            twice, or a corner lies outside the image; the line is named.
    """
    text = read_text(path)
    table = _table(_without_commas(text) if Path(path).suffix.lower() == ".csv" else text, path)
    starts = [0, *compress(count(1), map(ne, table.images, table.images[1:]))]
    _check_once(table, starts, path)
    _check_inside(table, image_size, path)
    found = np.isfinite(table.pixels[:, 0])
    views, set_aside = [], []
    for start, stop in pairwise([*starts, len(table.images)]):
        image, ids = table.images[start], np.flatnonzero(found[start:stop])
        if len(ids) == 0:
            set_aside.append(SetAside(image, f"no corner of the target found, says {Path(path).name}"))
        elif stop - start == len(target.points):
            views.append(View(image, ids, table.pixels[start:stop][ids]))
        else:
            raise InputError(
                f"{path}, lines {table.line(start)} to {table.line(stop - 1)}: {image!r} has {stop - start}"
                f" corners; target {target.name!r} has {len(target.points)}. Name the target that was"
                " photographed, counting inner corners."
            )
    return with_word_of_mirrors(Detections(target, image_size, tuple(views), tuple(set_aside)))


def write_vnl(detections: Detections, path: str | Path) -> None:
    """Writes detections as a corners.vnl file that mrcal reads, every number to its last digit.

    Raises:
        InputError: an image name that such a table cannot hold, or the file cannot be written.
    """
    lines = ["# " + " ".join(LEGEND)]
    for view in detections.views:
        name = _checked_name(view.image)
        rows = ["- - -"] * len(detections.target.points)
        for corner, (x, y) in zip(view.ids.tolist(), view.pixels.tolist(), strict=True):
            rows[corner] = f"{x!r} {y!r} 0"
        lines += [f"{name} {row}" for row in rows]
    lines += [f"{_checked_name(image)} - - -" for image, _ in detections.set_aside]
    write_text(path, "\n".join(lines) + "\n")


def _without_commas(text: str) -> str:
    """A table with commas as one with blanks, line by line; what is empty is a dash."""
    lines = [
        " ".join(cell.strip(' "\r') or "-" for cell in line.split(",")) if "," in line else line
        for line in text.split("\n")
    ]
    words = lines[0].removeprefix("\ufeff").split()
    if words and not words[0].startswith("#") and set(LEGEND[:3]) <= {word.lower() for word in words}:
        lines[0] = f"# {' '.join(words).lower()}"
    return "\n".join(lines)


def _table(text: str, path: str | Path) -> _Table:
    legend = _legend(text)
    missing = [name for name in ("filename", "x", "y") if name not in legend]
    if missing:
        raise InputError(
            f"{path} has no column {missing[0]!r}; expected the legend '# {' '.join(LEGEND)}'. Mend the"
            " legend."
        )
    table = _Table([], np.empty((0, 2)), text)
    columns = dict(zip(legend, _columns(table, len(legend), path), strict=False))
    beyond = [name for name in ("filename", "x", "y") if name not in columns]
    if beyond:
        raise InputError(
            f"{path}, line {table.line(0)}, has {len(columns)} columns; expected {len(legend)} with"
            f" {beyond[0]!r} among them, as the legend says. Mend the legend or the lines."
        )
    numbers = {name: _numbers(columns[name], table, path) for name in ("x", "y", *PRESENT) if name in columns}
    pixels = np.stack([numbers["x"], numbers["y"]], axis=1)
    pixels[~(pixels >= 0).all(axis=1)] = np.nan
    for name in PRESENT.keys() & numbers.keys():
        pixels[~PRESENT[name](numbers[name], 0.0)] = np.nan
    return _Table(columns["filename"], pixels, text)


def _legend(text: str) -> list[str]:
    """The columns' names: of the first line that opens with a single #, before the rows; the usual ones where
    there is none.
    """
    for line in map(str.strip, text.split("\n")):
        if _is_row(line):
            break
        if line[1:].strip() and line[1] not in "#!":
            return line[1:].split()
    return LEGEND


def _columns(table: _Table, most: int, path: str | Path) -> list[list[str]]:
    """The words of each column; a row may lack those after y, which then are 1."""
    rows = [
        line for line in map(str.strip, table.text.split("\n")) if line and line[0] != "#"
    ]  # _is_row, many times
    if not rows:
        raise InputError(
            f"{path} has no corners; expected lines such as 'frame1.jpg 1385.433 1471.719 0'. Find corners"
            " first."
        )
    width, words = len(rows[0].split()), " ".join(rows).split()
    columns = [words[i::width] for i in range(width)]
    even = len(words) == width * len(rows) and width >= 3
    if even and not any(
        _is_number(name) or name == "-" for name in set(columns[0])
    ):  # no row has slipped into another's place
        return columns
    ragged = [line.split() for line in rows]
    for i, row in enumerate(ragged):
        if not 3 <= len(row) <= most:
            raise InputError(
                f"{path}, line {table.line(i)}, has {len(row)} columns; expected 3 to {most}. Mend that line."
            )
    return [[row[i] if i < len(row) else "1" for row in ragged] for i in range(most)]


def _is_row(stripped: str) -> bool:
    return stripped != "" and stripped[0] != "#"


def _numbers(words: list[str], table: _Table, path: str | Path) -> ndarray:
    """One column; NaN for a dash."""
    told = ["null" if word == "-" else word for word in words] if "-" in words else words
    try:  # four times as fast as Python's own, which takes more ways to write a number
        numbers = np.array(msgspec.json.decode(f"[{','.join(told)}]", type=list[float | None]), dtype=float)
    except msgspec.DecodeError:
        numbers = np.empty(0)
    if len(numbers) != len(words):
        numbers = np.array([float(word) if _is_number(word) else np.nan for word in words])
    for i in np.flatnonzero(~np.isfinite(numbers)).tolist():
        if words[i] != "-" and not _is_number(words[i]):
            raise InputError(
                f"{path}, line {table.line(i)}, has {words[i]!r}; expected a finite number or a dash. Mend"
                " that line."
            )
    return numbers


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _check_once(table: _Table, starts: list[int], path: str | Path) -> None:
    seen: set[str] = set()
    for start in starts:
        image = table.images[start]
        if image in seen:
            raise InputError(
                f"{path}, line {table.line(start)}: {image!r} comes again; expected each image once, its"
                " lines together."
            )
        seen.add(image)


def _check_inside(table: _Table, image_size: tuple[int, int], path: str | Path) -> None:
    outside = np.flatnonzero((table.pixels > np.array(image_size)).any(axis=1))
    if len(outside):
        row = int(outside[0])
        x, y = table.pixels[row]
        raise InputError(
            f"{path}, line {table.line(row)}: a corner at ({x:g}, {y:g}) lies outside an image of"
            f" {image_size[0]}x{image_size[1]}. Give the size, width first, of the images that the corners"
            " were found in."
        )


def _checked_name(image: str) -> str:
    if not image or image.split() != [image] or image.startswith("#"):
        raise InputError(
            f"image name {image!r} cannot stand in a .vnl table; expected a name without blanks. Rename the"
            " photograph."
        )
    return image
