"""The folder of straight pictures: what earlier runs wrote there and this one does not stays, and is named.

It was straightened with whatever camera was given then. A list of what was written stands in the folder.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from orthoscope.files.whole_files import read_text, write_text

__all__ = ["LIST", "of_earlier_runs"]

LIST = "written.txt"
OPENING = "# Straight pictures that orthoscope wrote here."


def of_earlier_runs(folder: Path, written: Iterable[Path]) -> list[Path]:
    """The files that earlier runs wrote into the folder and this one did not; remembers what this one wrote.

    Args:
        written: by this run, in the folder.
    """
    names = sorted({path.name for path in written})
    earlier = [name for name in _listed(folder / LIST) if name not in names and (folder / name).is_file()]
    write_text(folder / LIST, "\n".join([OPENING, *sorted([*names, *earlier])]) + "\n")
    return [folder / name for name in earlier]


def _listed(path: Path) -> list[str]:
    """The names in a list that we wrote; none where there is none."""
    if not path.is_file():
        return []
    opening, *names = read_text(path).split("\n")
    if not opening.startswith(OPENING.rstrip(".")):
        return []
    return [name for name in names if name and Path(name).name == name and name not in (".", "..", LIST)]
