"""`orthoscope report`: a calibration to its page."""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli import options

__all__ = ["report"]

EXAMPLE = """\b
Example:
  $ orthoscope report camera/calibration.json --photos photos/ -o report.html
  wrote      report.html
"""


@click.command(epilog=EXAMPLE)
@options.calibration_file
@click.option(
    "--photos", multiple=True, metavar="PHOTOS", help="The photographs, to show one before and after."
)
@options.folds
@options.keep
@options.jobs
@options.cluster
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    default=Path("report.html"),
    show_default=True,
    help="File to write.",
)
def report(
    calibration: Path,
    photos: tuple[str, ...],
    folds: int,
    keep: str,
    jobs: int | None,
    cluster: str | None,
    out: Path,
) -> None:
    """Write the report page of a calibration: one HTML file that needs nothing else."""
    from orthoscope.cli.executors import processes
    from orthoscope.cli.progress import bar
    from orthoscope.evaluation.evaluate import evaluate
    from orthoscope.files.images import photographs
    from orthoscope.files.whole_files import check_folder
    from orthoscope.formats.own.json import load_calibration
    from orthoscope.report.page import write_report
    from orthoscope.straight.undistort import before_and_after

    loaded = load_calibration(calibration)
    check_folder(out.parent)
    files = {path.name: path for path in photographs(photos)} if photos else {}
    with processes(jobs or 1, cluster) as executor, bar("holding out") as progress:
        evaluation = evaluate(loaded, folds=folds, executor=executor, progress=progress)
    write_report(evaluation, out, photograph=before_and_after(loaded, files, keep=keep))
    click.echo(f"wrote      {out}")
