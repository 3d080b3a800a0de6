"""A camera on photographs that it was not made from: is it still good? What `evaluate --on` finds and prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from orthoscope.evaluation.camera_check import CameraCheck
    from orthoscope.evaluation.evaluate import UnseenError
    from orthoscope.evaluation.same_board import SameBoard
    from orthoscope.evaluation.verdict.grades import Grade
    from orthoscope.fitting.calibration import Calibration
    from orthoscope.formats.record import Contents
    from orthoscope.simulation.scene import Scene
    from orthoscope.targets.detections import Detections

__all__ = ["OnOthers", "json_of", "lines_of", "on_others"]


class OnOthers(NamedTuple):
    """What was found.

    Attributes:
        error: with the camera fixed and poses fitted.
        board: whether it is the board of the calibration; None where that was not asked.
        check: the camera beside the one that the photographs give; None where they tell none.
    """

    error: UnseenError
    board: SameBoard | None
    check: CameraCheck | None

    @property
    def grade(self) -> Grade:
        """How far the camera may be trusted: by the photographs' own, or else by what is left over."""
        from orthoscope.evaluation.verdict.verdict import grade_on_others

        error = self.error
        return self.check.grade if self.check else grade_on_others(error.rms_px, error.detections.image_size)


def on_others(loaded: Calibration | Scene | Contents, detections: Detections, *, own_board: bool) -> OnOthers:
    """Judge a camera by other photographs.

    Args:
        loaded: one of our calibrations, or a camera from anywhere.
        detections: of the other photographs.
        own_board: whether they may show the board of the calibration, whose shape is known then.
    """
    from orthoscope.evaluation.camera_check import check_camera
    from orthoscope.evaluation.evaluate import evaluate_on
    from orthoscope.evaluation.same_board import same_board
    from orthoscope.fitting.calibration import Calibration

    camera = loaded.camera
    error, board = evaluate_on(camera, detections), None
    if own_board and isinstance(loaded, Calibration) and _may_be_its_board(loaded, detections):
        board = same_board(camera, loaded.target_shape, error.detections)
        if board.same:
            error = evaluate_on(camera, detections, shape=loaded.target_shape)
    return OnOthers(error, board, check_camera(camera, error.detections))


def _may_be_its_board(calibration: Calibration, detections: Detections) -> bool:
    """Whether a shape was learnt, of a target that is described as this one is."""
    return (
        calibration.target_shape.kind != "flat"
        and calibration.detections.target.name == detections.target.name
    )


def lines_of(found: OnOthers, *, verbose: bool = False) -> list[str]:
    """The verdict, the figures, the photographs.

    Args:
        verbose: the photographs that were set aside, and NCE, as well.
    """
    from orthoscope.geometry.numbers import pixels

    error = found.error
    aside = error.detections.set_aside
    lines = [
        f"verdict    {_verdict(found)}",
        f"off by     {pixels(error.rms_px)} px per corner, the camera fixed, poses fitted",
        f"photos     {len(error.detections.views)} used, {len(aside)} set aside; {error.detections.corners} corners",
    ]
    if found.board:
        lines.append(f"board      {_board_line(found.board)}")
    if verbose:
        lines += [f"set aside  {entry.image}: {entry.reason}" for entry in aside]
        lines.append(f"NCE        {error.nce:.3f} (1 is what rounding to whole pixels would give)")
    return lines


def json_of(found: OnOthers) -> dict[str, Any]:
    """The same as plain values."""
    error, check = found.error, found.check
    views = zip(error.detections.views, error.view_rms_px, strict=True)
    return {
        "verdict": _verdict(found),
        "rms_px": error.rms_px,
        "nce": error.nce,
        "corners": error.detections.corners,
        "same_board": found.board and found.board._asdict(),
        "beside_their_own_camera": check
        and {
            "grade": check.grade,
            "apart_px": check.apart_px,
            "known_px": check.known_px,
            "changed": check.changed,
            "focal_shares": list(check.focal_shares),
            "centre_px": list(check.centre_px),
            "unexplained_px": check.unexplained_px,
        },
        "views": [{"name": view.image, "rms_px": rms} for view, rms in views],
        "views_rejected": [
            {"name": entry.image, "reason": entry.reason} for entry in error.detections.set_aside
        ],
    }


def _verdict(found: OnOthers) -> str:
    """By the photographs' own camera; where they give none, by what is left over, and that it is so."""
    from orthoscope.evaluation.verdict.verdict import far_on_others

    if found.check:
        return str(found.check)
    error = found.error
    far = far_on_others(error.rms_px, error.detections.image_size)
    return f"{far} These photographs give no camera of their own to put beside it: more of them would."


def _board_line(board: SameBoard) -> str:
    """Whether it is the board that the camera was calibrated with, and how that shows."""
    from orthoscope.geometry.numbers import pixels

    which = "the one of the calibration" if board.same else "another than that of the calibration"
    taken = (
        "the shape found there is used"
        if board.same
        else "its corners are taken to be where they are said to be"
    )
    figures = f"{pixels(board.learnt_px)} px with the shape found there, {pixels(board.said_px)} without"
    return f"{'' if board.sure else 'perhaps '}{which}: {figures}; {taken}"
