"""From cold: help and import, as whole processes."""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks.peers import Peers
from benchmarks.race import ORTHOSCOPE, race, whole_process
from benchmarks.rows import Part, Row

__all__ = ["starting"]

HEAVY = ("numpy", "cv2", "scipy", "matplotlib")
LOADED = (
    "import sys; from orthoscope.cli import verbs; verbs(['--help'], standalone_mode=False); print('LOADED',"
    " *sys.modules)"
)
ABOUT = "Wall time of whole processes, the best of several rounds, files in the page cache."


def starting(peers: Peers, folder: Path) -> Part:
    """Help, import."""
    part = Part("Starting", ABOUT)
    _help(part)
    return part


def _help(part: Part) -> None:
    python = sys.executable
    results = race(
        {
            "orthoscope --help": lambda: whole_process([ORTHOSCOPE, "--help"]),
            "import orthoscope": lambda: whole_process([python, "-c", "import orthoscope"]),
            "import cv2": lambda: whole_process([python, "-c", "import cv2"]),
            "Python by itself": lambda: whole_process([python, "-c", "pass"]),
        },
        rounds=9,
    )
    loaded = whole_process([python, "-c", LOADED]).get("out", "").partition("LOADED")[2].split()
    heavy = [name for name in HEAVY if name in loaded]
    part.rows.append(Row("orthoscope --help", results["orthoscope --help"].wall, unit="ms", at_most=150.0))
    part.rows.append(
        Row("heavy modules that it imports", float(len(heavy)), unit="", at_most=0.0, note=", ".join(heavy))
    )
    for name in ("import orthoscope", "import cv2", "Python by itself"):
        part.rows.append(Row(name, results[name].wall, unit="ms"))
