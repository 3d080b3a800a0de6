"""`orthoscope evaluate`: a calibration's verdict, on its own views or on others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from orthoscope.cli import options
from orthoscope.cli.telling import tell, tell_json

if TYPE_CHECKING:
    from orthoscope.evaluation.same_board import SameBoard

__all__ = ["evaluate"]

EXAMPLE = """\b
Examples:
  $ orthoscope evaluate camera/calibration.json
  $ orthoscope evaluate camera/calibration.json --on other_photos/
  verdict    Good: off by about 0.16 px where these photographs have corners.
  off by     0.158 px per corner, the camera fixed, poses fitted
  photos     5 used, 0 set aside; 270 corners
  board      the one of the calibration: 0.158 px with the shape found there, 0.241 without; the shape found
  there is used
  $ orthoscope evaluate camera_info.yaml --on photos/ --target chessboard:9x6:25mm

\b
Whether other photographs show the board of the calibration is found out by its shape;
with --target they show that one, taken as it is said to be.
"""


@click.command(epilog=EXAMPLE)
@click.argument("calibration", metavar="CAMERA")
@click.option(
    "--on",
    "others",
    multiple=True,
    metavar="PHOTOS",
    help="Photographs or corners that were not used: only their poses are fitted.",
)
@options.target
@options.image_size
@options.own_folds
@options.jobs
@options.cluster
@options.verbose
@options.as_json
def evaluate(
    calibration: str,
    others: tuple[str, ...],
    target: str | None,
    image_size: tuple[int, int] | None,
    folds: int | None,
    jobs: int | None,
    cluster: str | None,
    verbose: bool,
    as_json: bool,
) -> None:
    """Judge a calibration: held-out error, NCE, what limits it, which photograph to take next."""
    from orthoscope.cli.executors import threads
    from orthoscope.cli.inputs import detections_from
    from orthoscope.cli.judged import EVALUATION, judged_calibration
    from orthoscope.cli.progress import bar
    from orthoscope.cli.summary import evaluation_lines, to_json
    from orthoscope.evaluation.evaluate import evaluate_on
    from orthoscope.evaluation.same_board import same_board
    from orthoscope.evaluation.verdict.verdict import far_on_others
    from orthoscope.fitting.calibration import Calibration
    from orthoscope.formats.load import load_source
    from orthoscope.formats.own.json import text_of
    from orthoscope.geometry.arrays import InputError

    path = Path(calibration)
    if not others and (path.is_dir() or path.name == EVALUATION):
        loaded = None
    else:
        loaded = load_source(calibration, image_size=image_size)
        if not isinstance(loaded, Calibration) and not (others and target):
            raise InputError(
                f"{calibration} is a camera without the photographs that it was made from; expected photographs"
                " and their target: --on PHOTOS --target chessboard:9x6:25mm."
            )
    if not others or loaded is None:
        evaluation = judged_calibration(path, folds=folds, jobs=jobs, cluster=cluster)
        if as_json:
            tell_json(text_of(evaluation))
        else:
            tell(*evaluation_lines(evaluation, verbose=verbose))
        return
    with threads(jobs, cluster) as executor, bar("detecting") as progress:
        own = loaded.detections.target if isinstance(loaded, Calibration) else None
        board = target or own  # a camera alone comes with a target, as checked above
        detections, _ = detections_from(
            others, board, image_size=image_size, executor=executor, progress=progress
        )
    test = evaluate_on(loaded.camera, detections)
    board = None
    if isinstance(loaded, Calibration) and not target and loaded.target_shape.kind != "flat":
        board = same_board(loaded.camera, loaded.target_shape, test.detections)
        if board.same:
            test = evaluate_on(loaded.camera, detections, shape=loaded.target_shape)
    verdict = far_on_others(test.rms_px, loaded.camera.image_size)
    if as_json:
        rejected = [{"name": entry.image, "reason": entry.reason} for entry in test.detections.set_aside]
        views = [
            {"name": view.image, "rms_px": rms}
            for view, rms in zip(test.detections.views, test.view_rms_px, strict=True)
        ]
        numbers = {
            "verdict": verdict,
            "rms_px": test.rms_px,
            "nce": test.nce,
            "corners": test.detections.corners,
            "same_board": board and board._asdict(),
            "views": views,
            "views_rejected": rejected,
        }
        tell_json(to_json(numbers))
        return
    tell(f"verdict    {verdict}")
    tell(f"off by     {test.rms_px:.3f} px per corner, the camera fixed, poses fitted")
    aside = test.detections.set_aside
    tell(
        f"photos     {len(test.detections.views)} used, {len(aside)} set aside; {test.detections.corners} corners"
    )
    if board:
        tell(f"board      {_board_line(board)}")
    if verbose:
        for entry in aside:
            tell(f"set aside  {entry.image}: {entry.reason}")
        tell(f"NCE        {test.nce:.3f} (1 is what rounding to whole pixels would give)")


def _board_line(board: SameBoard) -> str:
    """Whether it is the board that the camera was calibrated with, and how that shows."""
    which = "the one of the calibration" if board.same else "another than that of the calibration"
    taken = (
        "the shape found there is used"
        if board.same
        else "its corners are taken to be where they are said to be"
    )
    figures = f"{board.learnt_px:.3f} px with the shape found there, {board.said_px:.3f} without"
    return f"{'' if board.sure else 'perhaps '}{which}: {figures}; {taken}"
