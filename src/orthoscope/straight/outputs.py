"""The folder of straight pictures: what an earlier run wrote there and this one does not write is removed.

A list of what was written stands in the folder; only what stands in it, and in the folder itself, is ever
removed.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from orthoscope.files.whole_files import check_not_onto, read_text, write_text
from orthoscope.geometry.arrays import InputError

__all__ = ["LIST", "replace_outputs"]

LIST = "written.txt"
OPENING = "# Straight pictures that orthoscope wrote here; what a later run does not write again it removes."


def replace_outputs(folder: Path, written: Iterable[Path], inputs: Iterable[Path]) -> list[Path]:
    """Removes what an earlier run wrote into the folder and this one did not; remembers what this one wrote.

    Args:
        written: by this run, in the folder.
        inputs: of this run; none of them is removed.
    Returns:
        What was removed.
    """
    names = sorted({path.name for path in written})
    kept, removed = list(inputs), []
    for name in _listed(folder / LIST):
        place = folder / name
        if name in names or not place.is_file() or place.is_symlink():
            continue
        try:
            check_not_onto([place], kept)
        except InputError:
            continue
        place.unlink()
        removed.append(place)
    write_text(folder / LIST, "\n".join([OPENING, *names]) + "\n")
    return removed


def _listed(path: Path) -> list[str]:
    """The names in a list that we wrote; none where there is none."""
    if not path.is_file():
        return []
    lines = read_text(path).split("\n")
    if lines[0] != OPENING:
        return []
    return [name for name in lines[1:] if name and Path(name).name == name and name not in (".", "..", LIST)]
