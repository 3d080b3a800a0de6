"""`orthoscope report`: a calibration to its page."""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell

__all__ = ["report"]

EXAMPLE = """\b
Example:
  $ orthoscope report camera/calibration.json --photos photos/ -o report.html
  wrote      report.html

\b
CALIBRATION.json is what `calibrate` wrote, or its folder; the evaluation.json beside it is read, and made anew only
where it is missing, of another calibration, or --folds is asked for.
"""


@click.command(epilog=EXAMPLE)
@options.calibration_file
@click.option(
    "--photos", multiple=True, metavar="PHOTOS", help="The photographs, to show them with their corners."
)
@options.own_folds
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
@click.option(
    "--figures",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help=(
        "Also write the figures for a paper, SVG and PDF, into this folder (pip install"
        " 'orthoscope[figures]')."
    ),
)
def report(
    calibration: Path,
    photos: tuple[str, ...],
    folds: int | None,
    keep: str,
    jobs: int | None,
    cluster: str | None,
    out: Path,
    figures: Path | None,
) -> None:
    """Write the report page of a calibration: one HTML file that needs nothing else."""
    from orthoscope.cli.shared.executors import threads
    from orthoscope.cli.shared.judged_calibration import judged_calibration
    from orthoscope.cli.shared.progress import bar
    from orthoscope.files.images import names_of, photographs
    from orthoscope.files.whole_files import check_folder
    from orthoscope.report.page import write_report
    from orthoscope.report.pictures import pictures_of
    from orthoscope.report.print_files import check_matplotlib, write_figures

    check_folder(out.parent)
    if figures:
        check_matplotlib()
        check_folder(figures)
    evaluation = judged_calibration(calibration, folds=folds, jobs=jobs, cluster=cluster)
    paths = photographs(photos) if photos else []
    files = dict(zip(names_of(paths), paths, strict=True))
    with threads(jobs) as executor, bar("photographs") as progress:
        pictures = pictures_of(evaluation.calibration, files, keep=keep, executor=executor, progress=progress)
    write_report(evaluation, out, pictures=pictures)
    drawn = write_figures(evaluation, figures) if figures else []
    tell(f"wrote      {out}" + (f", {len(drawn)} figures into {figures}/" if drawn else ""))
