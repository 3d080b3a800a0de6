"""What is measured, one module for each question; PARTS is what `make bench ONLY=...` knows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from benchmarks.parts.detecting import accuracy, detecting
from benchmarks.parts.held_out import held_out
from benchmarks.parts.points import points
from benchmarks.parts.real_photographs import real_photographs
from benchmarks.parts.shape_and_lens import shape_and_lens
from benchmarks.parts.solving import solving
from benchmarks.parts.starting import starting
from benchmarks.parts.undistorting import undistorting
from benchmarks.parts.whole_command import whole_command
from benchmarks.peers import Peers
from benchmarks.rows import Part

__all__ = ["PARTS"]

PARTS: dict[str, Callable[[Peers, Path], Part]] = {
    "whole-command": whole_command,
    "solving": solving,
    "shape": shape_and_lens,
    "held-out": held_out,
    "detecting": detecting,
    "accuracy": accuracy,
    "photographs": real_photographs,
    "undistorting": undistorting,
    "points": points,
    "starting": starting,
}
