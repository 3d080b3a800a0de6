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

\b
CALIBRATION.json is what `calibrate` wrote, or its folder; the evaluation.json beside it is read, and made
anew only where it is missing, of another calibration, or --folds is asked for.
"""


@click.command(epilog=EXAMPLE)
@options.calibration_file
@click.option(
    "--photos", multiple=True, metavar="PHOTOS", help="The photographs, to show one before and after."
)
@options.folds_anew
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
    folds: int | None,
    keep: str,
    jobs: int | None,
    cluster: str | None,
    out: Path,
) -> None:
    """Write the report page of a calibration: one HTML file that needs nothing else."""
    from orthoscope.cli.judged import judged
    from orthoscope.files.images import photographs
    from orthoscope.files.whole_files import check_folder
    from orthoscope.report.page import write_report
    from orthoscope.straight.undistort import before_and_after

    check_folder(out.parent)
    evaluation = judged(calibration, folds=folds, jobs=jobs, cluster=cluster)
    files = {path.name: path for path in photographs(photos)} if photos else {}
    write_report(evaluation, out, photograph=before_and_after(evaluation.calibration, files, keep=keep))
    click.echo(f"wrote      {out}")
