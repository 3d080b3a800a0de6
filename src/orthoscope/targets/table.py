"""The kinds of target by name: an entry more, and descriptions, files, pictures and detectors know it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from orthoscope.geometry.arrays import InputError
from orthoscope.targets.aprilgrid import AprilGrid
from orthoscope.targets.board import Board
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.circles import Circles
from orthoscope.targets.grid_board import GridBoard
from orthoscope.targets.kalibr_target import kalibr_target
from orthoscope.targets.marked_chessboard import MarkedChessboard
from orthoscope.targets.target import TOGETHER, Target, several, target_of

__all__ = ["TARGETS", "as_fields", "forms", "parse_target"]

TARGETS: dict[str, type[Board]] = {
    board.kind: board for board in (Chessboard, MarkedChessboard, Charuco, AprilGrid, GridBoard, Circles)
}


def forms() -> str:
    """How every kind is described, for help and messages."""
    return ", ".join(f"{board.kind}:{board.form} ({board.counted})" for board in TARGETS.values())


def parse_target(text: str) -> Target:
    """The target of a description such as `chessboard:9x6:25mm`, or of Kalibr's target.yaml.

    Args:
        text: the description; of several targets in the same photographs all, with ` + ` between them.
    Raises:
        InputError: the description is none, or two targets could be taken for each other.
    """
    if TOGETHER in text:
        return several([parse_target(one) for one in text.split(TOGETHER)])
    if text.strip().lower().endswith((".yaml", ".yml")):
        return target_of(kalibr_target(text.strip()))
    kind, *fields = text.strip().split(":")
    if kind not in TARGETS:
        raise InputError(
            f"target {text!r} is not understood; expected {forms()}, such as {Chessboard.example}."
        )
    return target_of(TARGETS[kind].parse(fields))


def as_fields(board: Board) -> dict[str, Any]:
    """What a board is made of, by name, its kind first: plain values, as a file holds them."""
    return {"kind": board.kind, **asdict(board)}
