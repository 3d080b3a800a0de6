"""Words out of files (names of photographs, of cameras, of targets) as they may be shown.

A file's name may hold line ends, a terminal's commands and marks that turn the direction of writing: what
cannot be seen is shown by its number, as Python writes it.
"""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Callable

__all__ = ["printable", "printable_json"]


def printable(text: str) -> str:
    """One line of text in which everything can be seen."""
    return _shown(text, lambda char: char.encode("unicode_escape").decode())


def printable_json(text: str) -> str:
    """JSON, any number of lines, in which everything can be seen; it says the same."""
    return "\n".join(_shown(line, lambda char: json.dumps(char)[1:-1]) for line in text.split("\n"))


def _shown(text: str, escaped: Callable[[str], str]) -> str:
    if text.isprintable():
        return text
    seen = (char.isprintable() or unicodedata.category(char) == "Zs" for char in text)
    return "".join(char if plain else escaped(char) for char, plain in zip(text, seen, strict=True))
