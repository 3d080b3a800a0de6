"""Kalibr's `target.yaml`: a few names and values, one a line."""

from __future__ import annotations

from pathlib import Path

from orthoscope.geometry.arrays import InputError
from orthoscope.targets.aprilgrid import AprilGrid
from orthoscope.targets.board import Board
from orthoscope.targets.chessboard import Chessboard

__all__ = ["kalibr_target"]


def kalibr_target(path: str | Path) -> Board:
    """The board that a target.yaml describes.

    Raises:
        InputError: the file cannot be read, a value is missing, or its squares are oblong.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read ({error}); expected a target.yaml of Kalibr.") from error
    fields = [line.partition("#")[0].partition(":") for line in lines]
    values = {name.strip(): value.strip().strip("'\"") for name, _, value in fields}
    try:
        kind = values["target_type"]
        if kind == "aprilgrid":
            counts = int(values["tagCols"]), int(values["tagRows"])
            return AprilGrid(*counts, float(values["tagSize"]), float(values["tagSpacing"]))
        if kind == "checkerboard":
            across, down = float(values["colSpacingMeters"]), float(values["rowSpacingMeters"])
            if across != down:
                raise InputError(f"{path} has squares of {across:g} by {down:g} m; expected square ones.")
            return Chessboard(int(values["targetCols"]), int(values["targetRows"]), across)
    except KeyError as error:
        raise InputError(f"{path} does not say {error}; expected a target.yaml of Kalibr.") from error
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} has a value that is no number ({error}).") from error
    raise InputError(f"{path} has target_type {kind!r}; expected aprilgrid or checkerboard.")
