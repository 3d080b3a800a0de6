"""`orthoscope evaluate`: a calibration's verdict, on its own views or on others."""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli import options

__all__ = ["evaluate"]

EXAMPLE = """\b
Examples:
  $ orthoscope evaluate camera/calibration.json
  $ orthoscope evaluate camera/calibration.json --on other_photos/
  views      5 used; 270 corners
  rms        0.158 px per point, camera fixed, poses fitted
  NCE        0.357 (1 is what rounding to whole pixels would give)
  $ orthoscope evaluate camera_info.yaml --on photos/ --target chessboard:9x6:25mm

\b
Other photographs show the calibration's own board, whose estimated shape is used;
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
@options.folds_anew
@options.jobs
@options.cluster
@options.as_json
def evaluate(
    calibration: str,
    others: tuple[str, ...],
    target: str | None,
    image_size: tuple[int, int] | None,
    folds: int | None,
    jobs: int | None,
    cluster: str | None,
    as_json: bool,
) -> None:
    """Judge a calibration: held-out error, NCE, what limits it, which photograph to take next."""
    from orthoscope.cli.executors import threads
    from orthoscope.cli.inputs import detections_from
    from orthoscope.cli.judged import EVALUATION, judged
    from orthoscope.cli.progress import bar
    from orthoscope.cli.summary import evaluation_lines, to_json
    from orthoscope.evaluation.evaluate import evaluate_on
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
        evaluation = judged(path, folds=folds, jobs=jobs, cluster=cluster)
        click.echo(
            text_of(evaluation) if as_json else "\n".join(evaluation_lines(evaluation)) + "\n", nl=False
        )
        return
    with threads(jobs, cluster) as executor, bar("detecting") as progress:
        # type: ignore[union-attr]  # a calibration, as checked above
        board = target or loaded.detections.target
        detections, _ = detections_from(
            others, board, image_size=image_size, executor=executor, progress=progress
        )
    shape = (
        loaded.target_shape if isinstance(loaded, Calibration) and not target else None
    )  # another board has another shape
    test = evaluate_on(loaded.camera, detections, shape=shape)
    if as_json:
        rejected = [{"name": entry.image, "reason": entry.reason} for entry in test.detections.set_aside]
        views = [
            {"name": view.image, "rms_px": rms}
            for view, rms in zip(test.detections.views, test.view_rms_px, strict=True)
        ]
        click.echo(
            to_json(
                {
                    "rms_px": test.rms_px,
                    "nce": test.nce,
                    "corners": test.detections.corners,
                    "views": views,
                    "views_rejected": rejected,
                }
            )
        )
        return
    click.echo(f"views      {len(test.detections.views)} used; {test.detections.corners} corners")
    for entry in test.detections.set_aside:
        click.echo(f"           {entry.image}: {entry.reason}")
    click.echo(f"rms        {test.rms_px:.3f} px per point, camera fixed, poses fitted")
    click.echo(f"NCE        {test.nce:.3f} (1 is what rounding to whole pixels would give)")
