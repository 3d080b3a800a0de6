"""What the verbs say: every line goes through here, so that no name out of a file commands a terminal."""

from __future__ import annotations

import click

from orthoscope.files.printable import printable, printable_json

__all__ = ["tell", "tell_json"]


def tell(*lines: str, err: bool = False) -> None:
    """Print lines.

    Args:
        lines: one each.
        err: to stderr, where progress and remarks go.
    """
    for line in lines:
        click.echo(printable(line), err=err)


def tell_json(text: str) -> None:
    """Print a JSON document."""
    click.echo(printable_json(text).removesuffix("\n"))
