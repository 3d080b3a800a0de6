"""Text from files on its way to a terminal: what would move the cursor or colour the screen is shown as it is written."""

from __future__ import annotations

__all__ = ["printable"]


def printable(text: str) -> str:
    """The text, every character that is not printable (but a line's end) as Python writes it, such as \\x1b."""
    return "".join(
        letter if letter.isprintable() or letter == "\n" else repr(letter)[1:-1] for letter in text
    )
