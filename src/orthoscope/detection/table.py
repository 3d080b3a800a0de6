"""The detector of each kind of target."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from orthoscope.detection.chessboards.chessboard import see_chessboard
from orthoscope.detection.discs.circles import see_circles
from orthoscope.detection.markers.aprilgrid import see_aprilgrid
from orthoscope.detection.markers.charuco import see_charuco
from orthoscope.detection.markers.grid_board import see_grid_board
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.targets.aprilgrid import AprilGrid
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.circles import Circles
from orthoscope.targets.grid_board import GridBoard
from orthoscope.targets.marked_chessboard import MarkedChessboard
from orthoscope.targets.target import Target

__all__ = ["DETECTORS", "check_can_be_seen", "see"]

DETECTORS: dict[str, Callable[[ndarray, Any], Sight | Unseen]] = {
    Chessboard.kind: see_chessboard,
    MarkedChessboard.kind: see_chessboard,
    Charuco.kind: see_charuco,
    AprilGrid.kind: see_aprilgrid,
    GridBoard.kind: see_grid_board,
    Circles.kind: see_circles,
}


def see(grey: ndarray, target: Target) -> Sight | Unseen:
    """The corners of a single target in one photograph, (h,w) uint8."""
    return DETECTORS[target.kind](grey, target.board)


def check_can_be_seen(target: Target) -> None:
    """Says before the first photograph that a target cannot be looked for.

    Raises:
        InputError: no detector knows its kind.
    """
    for member in target.members:
        check_can_be_seen(member)
    if not target.members and target.kind not in DETECTORS:
        raise InputError(
            f"target {target.name!r} cannot be looked for in photographs; expected one of"
            f" {', '.join(DETECTORS)}. Hand in corners instead."
        )
