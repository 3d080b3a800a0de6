"""HTML as nested calls: `tag("p", "a < b", class_="note")` is `<p class="note">a &lt; b</p>`.

Text is escaped where it is put in; only what `tag` and `raw` have made goes in as it is. A template language
would take a sixth of a second of every calibration to be loaded and compiled.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from typing import Any

__all__ = ["Content", "Html", "raw", "table", "tag", "unbroken"]

# These elements hold nothing.
VOID_ELEMENTS = frozenset({"br", "img", "input", "meta", "wbr"})


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


Content = str | int | None | Iterable[Any]  # and so on within what is iterated over


def raw(text: str) -> Html:
    """Text that is known to be markup, or is put where nothing is escaped (a style, a script)."""
    return Html(text)


def tag(name: str, /, *content: Content, **attributes: str | int | bool | None) -> Html:
    """An element.

    Args:
        name: `p`, `section`, ...
        content: text, elements, sequences of them; None is left out.
        attributes: `class_` is class, `data_view` data-view; True stands alone, False and None are left out.
    """
    told = "".join(
        f" {key.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{_quoted(str(value))}"')
        for key, value in attributes.items()
        if value is not None and value is not False
    )
    return Html(f"<{name}{told}>" if name in VOID_ELEMENTS else f"<{name}{told}>{_joined(content)}</{name}>")


def table(
    headings: Iterable[Content], rows: Iterable[Iterable[Content]], *, class_: str | None = None
) -> Html:
    """A table whose first column names its rows."""
    body = [
        tag("tr", tag("th", first, scope="row"), [tag("td", cell) for cell in others])
        for first, *others in rows
    ]
    head = [tag("th", heading, scope="col") for heading in headings]
    return tag("table", tag("thead", tag("tr", head)) if head else None, tag("tbody", body), class_=class_)


def unbroken(text: str) -> str:
    """Text whose numbers stay on one line with their units and errors."""
    return re.sub(r"(?<=[\d±]) (?=[±%\d]|px\b|mm\b)|(?<=\b[cf][xy]) (?=\d)", "\N{NO-BREAK SPACE}", text)


def _quoted(value: str) -> str:
    return escape(value, quote=False).replace('"', "&quot;")


def _joined(content: Iterable[Content]) -> str:
    return "".join(
        (
            piece
            if isinstance(piece, Html)
            else escape(str(piece), quote=False)
            if isinstance(piece, str | int)
            else _joined(piece)
        )
        for piece in content
        if piece is not None
    )
