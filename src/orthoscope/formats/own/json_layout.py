"""How our JSON files look: indented for people, but a list of numbers is one line and a table of numbers one
line a row.

Numbers are written as the shortest text that reads back as the same number, as Python writes it, so files are
exact and the same each time. Long tables are left to msgspec, which is ten times as fast and differs where
numbers are very small or very large.
"""

from __future__ import annotations

import json
from typing import Any

import msgspec

__all__ = ["lay_out"]

# An object of plain values that fits in so many characters stays on one line.
LINE_WIDTH = 120


def lay_out(value: Any, indent: str = "") -> str:
    """JSON text of plain values: dict, list, str, numbers, bool, None.

    Raises:
        ValueError: NaN or infinity.
        TypeError: anything else that JSON has no word for.
    """
    inner = indent + "  "
    entries = (
        list(value.values() if isinstance(value, dict) else value)
        if isinstance(value, dict | list | tuple)
        else []
    )
    if not any(isinstance(entry, dict | list | tuple) for entry in entries):
        line = _line(value)
        if not isinstance(value, dict) or len(indent) + len(line) <= LINE_WIDTH:
            return line
    if isinstance(value, dict):
        return _block(
            "{}", [f"{_line(str(key))}: {lay_out(entry, inner)}" for key, entry in value.items()], indent
        )
    if isinstance(entries[0], list | tuple) and not any(
        isinstance(cell, list | tuple) for cell in entries[0]
    ):
        line = _table(value)
        if (
            not line.startswith("[[[") and '"' not in line and "{" not in line
        ):  # a table of numbers, at once since it may be long
            return _block("[]", [line[1:-1].replace("], [", f"],\n{inner}[")], indent)
    return _block("[]", [lay_out(entry, inner) for entry in entries], indent)


def _block(brackets: str, lines: list[str], indent: str) -> str:
    return f"{brackets[0]}\n{indent}  " + f",\n{indent}  ".join(lines) + f"\n{indent}{brackets[1]}"


def _line(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _table(value: Any) -> str:
    """The same as `_line`, sooner for many numbers: only rows that Python writes in another way are left to
    it.
    """
    text = msgspec.json.encode(value).decode()
    if _has_others(text):
        rows = text[2:-2].split("],[")
        plain = '"' not in text and "{" not in text and not text.startswith("[[[") and text.endswith("]]")
        if not plain or len(rows) != len(value):
            return _line(value)
        for i, row in enumerate(rows):
            if _has_others(row):
                rows[i] = _line(value[i])[1:-1].replace(", ", ",")
        text = f"[[{'],['.join(rows)}]]"
    return text.replace(",", ", ")


def _has_others(text: str) -> bool:
    """Whether msgspec's text has numbers that Python writes in another way, null, or what is no number."""
    return "e" in text or "0.0000" in text or "n" in text or '"' in text or "{" in text
