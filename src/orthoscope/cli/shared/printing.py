"""What the verbs say: every line goes through here, so that no name out of a file commands a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from orthoscope.files.printable import printable, printable_json

if TYPE_CHECKING:
    from orthoscope.targets.detections import Detections

__all__ = ["tell", "tell_json", "tell_of_earlier", "tell_remarks"]

# So many files of earlier runs are named.
LISTED_FILES = 5


def tell(*lines: str, err: bool = False) -> None:
    """Print lines.

    Args:
        lines: one each.
        err: to stderr, where progress and remarks go.
    """
    for line in lines:
        click.echo(printable(line), err=err)


def tell_remarks(detections: Detections) -> None:
    """Print what to know of how photographs were seen, to stderr."""
    tell(*(f"remark     {remark.image}: {remark.words}" for remark in detections.remarks), err=True)


def tell_json(text: str) -> None:
    """Print a JSON document."""
    click.echo(printable_json(text).removesuffix("\n"))


def tell_of_earlier(files: list[Path]) -> None:
    """Say which files in the folder are of earlier runs, and so of the camera that was used then.

    Args:
        files: these.
    """
    if files:
        listed = ", ".join(path.name for path in files[:LISTED_FILES])
        more = f" and {len(files) - LISTED_FILES} more" if len(files) > LISTED_FILES else ""
        tell(f"kept       of earlier runs, whose camera may be another: {listed}{more}", err=True)
