"""`orthoscope paper`: the paper's section 4, whole: one page and CSV files.

The floor of the command line.  Its trials run in processes, each of which computes with one thread.
"""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli import options
from orthoscope.cli.telling import tell

__all__ = ["paper"]

EXAMPLE = """\b
Examples:
  $ orthoscope paper -o paper/
  The paper's main claim, that MLDC is better than FCCM on test data, does not hold: it stands in 0 of 4 comparisons.
  wrote      paper/paper.html and 10 CSV files
  $ orthoscope paper --photos photos/ --target chessboard:9x6:25mm -o paper/

\b
Exit: 0 done, 1 the photographs cannot tell the camera, 2 the command is wrong.
"""


@click.command(epilog=EXAMPLE)
@click.option(
    "--photos",
    multiple=True,
    metavar="PHOTOS",
    help="Photographs, or corners found before, for Fig. 6, Fig. 7 and Table 1.",
)
@options.target
@options.image_size
@click.option("--trials", type=click.IntRange(1), help="Averaged in figures 2 to 5; 25, or 2 with --quick.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0), help="Of all that is random.")
@click.option(
    "--jobs", type=click.IntRange(1), help="Processes; by default as many as there are cores. 1 starts none."
)
@options.cluster
@click.option("--quick", is_flag=True, help="Few levels and trials: a look at everything in seconds.")
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("paper"),
    show_default=True,
    help="Folder to write.",
)
def paper(
    photos: tuple[str, ...],
    target: str | None,
    image_size: tuple[int, int] | None,
    trials: int | None,
    seed: int,
    jobs: int | None,
    cluster: str | None,
    quick: bool,
    out: Path,
) -> None:
    """Repeat the paper's experiments, each figure beside what the paper claims about it."""
    from orthoscope.cli.executors import processes, single_threaded, threads

    with single_threaded():
        from orthoscope.cli.progress import bar
        from orthoscope.files.whole_files import check_folder, write_text
        from orthoscope.paper.documents import documents
        from orthoscope.paper.section4 import Plan, run
        from orthoscope.report.print_files import check_matplotlib

        check_matplotlib()
        check_folder(out)
        plan = Plan.quick(trials=trials or 2, seed=seed) if quick else Plan(trials=trials or 25, seed=seed)
        detections, files = None, {}
        if photos:
            from orthoscope.cli.inputs import detections_from

            with threads(jobs, cluster) as executor, bar("detecting") as progress:
                detections, files = detections_from(
                    photos, target, image_size=image_size, executor=executor, progress=progress
                )
        with processes(jobs, cluster) as executor, bar("experiments") as progress:
            results = run(plan, detections=detections, executor=executor, progress=progress)
        written = documents(results, files)
        for name, text in written.texts.items():
            write_text(out / name, text)
    tell(written.headline)
    tell(f"wrote      {out / written.page} and {len(written.texts) - 1} CSV files")
