"""`orthoscope evaluate`: a calibration's verdict, on its own views or on others."""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell, tell_json, tell_remarks

__all__ = ["evaluate"]

EXAMPLE = """\b
Examples:
  $ orthoscope evaluate camera/calibration.json
  $ orthoscope evaluate camera/calibration.json --on other_photos/
  $ orthoscope evaluate camera_info.yaml --on photos/ --target chessboard:9x6:25mm
  verdict    Good: the camera that these photographs give by themselves, which they know to 0.2 px, is
             0.04 px away.
  off by     0.174 px per corner, the camera fixed, poses fitted
  photos     14 used, 0 set aside; 756 corners

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
@options.strict
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
    strict: bool,
    verbose: bool,
    as_json: bool,
) -> None:
    """Judge a calibration: held-out error, NCE, what limits it, which photograph to take next."""
    from orthoscope.cli.shared.executors import threads
    from orthoscope.cli.shared.exit_codes import leave_unless_usable
    from orthoscope.cli.shared.inputs import detections_from
    from orthoscope.cli.shared.judged_calibration import EVALUATION_NAME, judged_calibration
    from orthoscope.cli.shared.on_others import json_of, lines_of, on_others
    from orthoscope.cli.shared.progress import bar
    from orthoscope.cli.shared.summary import evaluation_lines, to_json
    from orthoscope.fitting.calibration import Calibration
    from orthoscope.formats.load import load_source
    from orthoscope.formats.own.json import text_of
    from orthoscope.geometry.arrays import InputError

    path = Path(calibration)
    found_before = [Path(each).suffix for each in others] == [".json"]  # corners, which know their target
    if not others and (path.is_dir() or path.name == EVALUATION_NAME):
        loaded = None
    else:
        loaded = load_source(calibration, image_size=image_size)
        if not isinstance(loaded, Calibration) and not (others and (target or found_before)):
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
        leave_unless_usable(evaluation.verdict.grade, strict=strict)
        return
    own = loaded.detections.target if isinstance(loaded, Calibration) else None
    board = target or (None if found_before else own)  # a camera alone comes with a target, as checked above
    with threads(jobs, cluster) as executor, bar("detecting") as progress:
        detections, _ = detections_from(
            others, board, image_size=image_size, executor=executor, progress=progress
        )
    tell_remarks(detections)
    found = on_others(loaded, detections, own_board=not target)
    if as_json:
        tell_json(to_json(json_of(found)))
    else:
        tell(*lines_of(found, verbose=verbose))
    leave_unless_usable(found.grade, strict=strict)
