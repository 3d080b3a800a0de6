"""`orthoscope compare`: methods and lenses side by side, on the same photographs."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell, tell_json, tell_remarks

if TYPE_CHECKING:
    from orthoscope.evaluation.comparison.compare import Comparison
    from orthoscope.evaluation.comparison.entry import Entry

__all__ = ["compare"]

EXAMPLE = """\b
Example:
  $ orthoscope compare photos/ --target chessboard:9x6:25mm --with decoupled --with decoupled:brown \\
    --with fccm:brown
  views      14 used, 0 set aside; 756 corners; 5 folds held out
                   held out (px)     loses (px)    NCE  used (px)  parameters  seconds  lens   target
  decoupled        0.088 ± 0.015           best  0.180      0.067         162     3.30  free   free
  decoupled:brown  0.090 ± 0.013  0.002 ± 0.002  0.189      0.074         141     3.04  brown  free
  fccm:brown       0.172 ± 0.008  0.085 ± 0.011  0.384      0.164           9     0.01  brown  flat
  verdict    decoupled predicts these photographs best: 0.088 ± 0.015 px on those that were not used.
             As good, for all that chance allows to say: decoupled:brown (loses 0.002 ± 0.002 px).
             The next, fccm:brown, loses 0.085 ± 0.011 px.
  wrote      comparison/comparison.json, comparison/comparison.html, comparison/comparison.svg

\b
comparison.svg, for print, is written where matplotlib is installed (pip install 'orthoscope[figures]').
WHO is METHOD, METHOD:LENS or either with settings of the method's own, such as fccm:brown:k1,k2 or
decoupled:brown:shape=flat; or a camera's file, whose camera stays as it is. PHOTOS are files, folders and globs; or one detections.json, corners.vnl or corners.csv.
Exit: 0 done, 1 the photographs are too few to hold any out, 2 the command is wrong.
"""
HEADINGS = ("", "held out (px)", "loses (px)", "NCE", "used (px)", "parameters", "seconds", "lens", "target")


@click.command(epilog=EXAMPLE)
@options.photos
@options.target
@options.image_size
@click.option(
    "--with",
    "names",
    multiple=True,
    metavar="WHO",
    help=(
        "Method and lens to compare, once for each; by default every method, decoupled also with the target's"
        " shape free and flat, fccm also with rational."
    ),
)
@options.folds
@options.jobs
@options.cluster
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("comparison"),
    show_default=True,
    help="Folder to write.",
)
@options.as_json
def compare(
    photos: tuple[str, ...],
    target: str | None,
    image_size: tuple[int, int] | None,
    names: tuple[str, ...],
    folds: int,
    jobs: int | None,
    cluster: str | None,
    out: Path,
    as_json: bool,
) -> None:
    """Compare methods and lenses by their error on photographs that they have not seen."""
    from orthoscope.cli.shared.executors import processes, threads
    from orthoscope.cli.shared.inputs import detections_from
    from orthoscope.cli.shared.progress import bar
    from orthoscope.evaluation.comparison.compare import compare as judge
    from orthoscope.evaluation.comparison.entry import USUAL, parse_entry
    from orthoscope.files.whole_files import check_folder, write_text
    from orthoscope.formats.load import SEPARATOR
    from orthoscope.formats.own.json import text_of
    from orthoscope.report.comparison import comparison_page, comparison_svg

    check_folder(out)
    entries = [
        _given(name, image_size) if Path(name.split(SEPARATOR)[0]).is_file() else parse_entry(name)
        for name in names or USUAL
    ]
    with threads(jobs, cluster) as executor, bar("detecting") as progress:
        detections, _ = detections_from(
            photos, target, image_size=image_size, executor=executor, progress=progress
        )
    tell_remarks(detections)
    with processes(jobs, cluster) as executor, bar("comparing") as progress:
        comparison = judge(detections, entries, folds=folds, executor=executor, progress=progress)
    texts = {
        "comparison.json": text_of(comparison),
        "comparison.html": comparison_page(comparison),
    }
    if find_spec("matplotlib"):  # the figure for print, where what draws it is installed
        texts["comparison.svg"] = comparison_svg(comparison)
    for name, text in texts.items():
        write_text(out / name, text)
    written = "wrote      " + ", ".join(str(out / name) for name in texts)
    if as_json:
        tell_json(texts["comparison.json"])
    else:
        tell(*_lines(comparison), written)


def _given(name: str, image_size: tuple[int, int] | None) -> Entry:
    """The entry of a camera's file; a calibration's shape goes with it."""
    from orthoscope.evaluation.comparison.entry import camera_entry
    from orthoscope.fitting.calibration import Calibration
    from orthoscope.formats.load import load_source

    loaded = load_source(name, image_size=image_size)
    return camera_entry(name, loaded.camera, calibration=loaded if isinstance(loaded, Calibration) else None)


def _lines(comparison: Comparison) -> list[str]:
    """The views, the table, who could not be judged and why, what follows."""
    from orthoscope.evaluation.comparison.conclusions import conclusions

    used = comparison.detections
    left_out = f", {len(used.outliers)} left out" if used.outliers else ""
    lines = [
        (
            f"views      {len(used.views)} used, {len(used.set_aside)} set aside; {used.corners}"
            f" corners{left_out}; {comparison.folds} folds held out"
        ),
        *_table(comparison),
    ]
    lines += [
        f"cannot     {standing.entry.name}: {standing.failure}"
        for standing in comparison.standings
        if standing.failure
    ]
    first, *others = conclusions(comparison)
    return [*lines, f"verdict    {first}", *(f"           {sentence}" for sentence in others)]


def _table(comparison: Comparison) -> list[str]:
    """The table as aligned lines, names and words to the left, numbers to the right."""
    from orthoscope.report.comparison import rows

    cells: list[tuple[str, ...]] = [HEADINGS]
    for row in rows(comparison):
        loses = row.verdict if row.verdict == "best" else row.loses
        cells.append(
            (
                row.name,
                row.held_out,
                loses,
                row.nce,
                row.used,
                row.parameters,
                row.seconds,
                row.lens,
                row.shape,
            )
        )
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    words = (0, 7, 8)
    return [
        "  ".join(
            cell.ljust(width) if i in words else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]
