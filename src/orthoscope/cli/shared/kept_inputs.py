"""The files that a verb was given to read, so that none of them is written onto.

A file is known by what it is, not by its name: links and other spellings of a path are the same file. Of a folder
only photographs and films count, since what an earlier run wrote there may be written anew.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

__all__ = ["keeping_inputs"]

# Parameters of verbs that name what is written.
OUTPUTS = ("out",)


def keeping_inputs(callback: Callable[..., Any]) -> Callable[..., Any]:
    """A verb that replaces no file that it was given to read, whatever its parameters call it."""

    @functools.wraps(callback)
    def kept(*args: Any, **settings: Any) -> Any:
        from orthoscope.files.whole_files import keep_inputs

        given = [value for name, value in settings.items() if name not in OUTPUTS]
        with keep_inputs(_files(given)):
            return callback(*args, **settings)

    return kept


def _files(given: Any) -> Iterator[Path]:
    """The files that values of parameters name."""
    if isinstance(given, list | tuple):
        for value in given:
            yield from _files(value)
    elif isinstance(given, str | Path) and str(given):
        yield from _named(str(given))


def _named(text: str) -> Iterator[Path]:
    import glob

    try:
        path = Path(text)
        if path.is_dir():
            yield from _pictures_in(path)
        elif path.exists():
            yield path
        elif "#" in text:
            yield Path(text.rpartition("#")[0])
        elif glob.has_magic(text):
            yield from map(Path, glob.glob(text, recursive=True))
    except (OSError, ValueError):  # no path at all, such as a lens with its coefficients
        return


def _pictures_in(folder: Path) -> Iterator[Path]:
    """The photographs and films of a folder; OpenCV is needed for those, and loaded for nothing else."""
    from orthoscope.files.images import SUFFIXES
    from orthoscope.straight.film import CODECS

    yield from (file for file in folder.iterdir() if file.suffix.lower() in {*SUFFIXES, *CODECS})
