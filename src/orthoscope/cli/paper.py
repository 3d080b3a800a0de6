"""`orthoscope paper`: the paper's section 4, whole: one page and CSV files.

Its trials run in processes, each of which computes with one thread.
"""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from typing import Any

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell

__all__ = ["paper"]

EXAMPLE = """\b
Examples:
  $ orthoscope paper -o paper/
  The paper's main claim, that MLDC is better than FCCM on test data, does not hold (in 0 of 4 figures); with its two
  steps repeated it holds (in 4 of 4 figures).
  wrote      paper/paper.html and 13 CSV files
  $ orthoscope paper --photos photos/ --target chessboard:9x6:25mm -o paper/
  $ orthoscope paper --only fig4 --only fig5 --trials 5 --with mine=my_methods:calibrate -o paper/

\b
Exit: 0 done, 1 the photographs cannot tell the camera, 2 the command is wrong.
"""


class _Numbers(click.ParamType):
    name = "NUMBERS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return tuple(sorted({float(part) for part in value.split(",")}))
        except ValueError:
            self.fail(f"{value!r} is no list of numbers; expected such as 0,0.1,1.", param, ctx)


class _Grids(click.ParamType):
    name = "GRIDS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        found = [re.fullmatch(r"(\d{1,4})x(\d{1,4})", part.strip()) for part in value.split(",")]
        grids = {(int(part[1]), int(part[2])) for part in found if part}
        if not all(found):
            self.fail(
                f"{value!r} is no list of sub-grids; expected COLUMNSxROWS such as 3x4,14x20.", param, ctx
            )
        return tuple(sorted(grids, key=lambda grid: (grid[0] * grid[1], grid)))


NUMBERS, GRIDS = _Numbers(), _Grids()


def _in_order(
    context: click.Context, parameter: click.Parameter, value: tuple[float, float] | None
) -> tuple[float, float] | None:
    """A range as it was given, if its least comes first."""
    if value is not None and value[0] > value[1]:
        raise click.BadParameter(f"{value[0]:g} is more than {value[1]:g}; expected the least first.")
    return value


@click.command(epilog=EXAMPLE)
@click.option(
    "--photos",
    multiple=True,
    metavar="PHOTOS",
    help="Photographs, or corners found before, for Fig. 6, Fig. 7 and Table 1.",
)
@options.target
@options.image_size
@click.option(
    "--trials",
    type=click.IntRange(1),
    help="Averaged in figures 4 and 5, at most 8 in the others; 25, or 2 with --quick.",
)
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0), help="Of all that is random.")
@click.option(
    "--jobs", type=click.IntRange(1), help="Processes; by default as many as there are cores. 1 starts none."
)
@options.cluster
@click.option(
    "--only",
    multiple=True,
    metavar="PART",
    help="A part to run, once for each: fig1 to fig7, images_low, images_high, exact, step2, times, lenses, eq7, table1.",
)
@click.option("--noise", type=NUMBERS, help="Levels of figs. 2 and 3, pixels, such as 0,0.1,1.")
@click.option("--points", type=GRIDS, help="Levels of figs. 4 and 5, columns x rows, such as 3x4,14x20.")
@click.option(
    "--tilt",
    nargs=2,
    type=click.FloatRange(0, 70),
    callback=_in_order,
    help="Least and greatest tilt of the simulated sheet, degrees; 0 45 by default.",
)
@click.option(
    "--fill",
    nargs=2,
    type=click.FloatRange(0, 0.98, min_open=True),
    callback=_in_order,
    help="Share of the simulated image that the sheet fills, from .. to; 0.8 0.98 by default.",
)
@click.option(
    "--with",
    "others",
    multiple=True,
    metavar="METHOD",
    help=(
        "A method of your own in every figure, once for each: module:function, which takes detections and returns a"
        " calibration; or one of ours with its settings, fccm:brown:k1,k2,k3. NAME=METHOD names it."
    ),
)
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
    only: tuple[str, ...],
    noise: tuple[float, ...] | None,
    points: tuple[tuple[int, int], ...] | None,
    tilt: tuple[float, float] | None,
    fill: tuple[float, float] | None,
    others: tuple[str, ...],
    quick: bool,
    out: Path,
) -> None:
    """Repeat the paper's experiments, all or some, each figure beside what the paper claims about it."""
    from orthoscope.cli.shared.executors import processes, single_threaded, threads

    with single_threaded():
        from orthoscope.cli.shared.progress import bar
        from orthoscope.files.whole_files import check_folder, write_text
        from orthoscope.paper.documents import documents
        from orthoscope.paper.entries import own_entry
        from orthoscope.paper.section4 import Plan, run
        from orthoscope.report.print_files import check_matplotlib

        check_matplotlib()
        check_folder(out)
        sys.path.insert(0, str(Path.cwd()))  # a module of the user's own lies where the command is given
        told = {
            "trials": trials,
            "noise_px": noise,
            "points": points,
            "tilt": tilt and (math.radians(tilt[0]), math.radians(tilt[1])),
            "fill": fill,
            "only": only,
            "own": tuple(own_entry(text) for text in others),
        }
        told = {name: value for name, value in told.items() if value is not None}
        plan = (Plan.quick if quick else Plan)(seed=seed, **told)
        detections, files = None, {}
        if photos:
            from orthoscope.cli.shared.inputs import detections_from

            with threads(jobs, cluster) as executor, bar("detecting") as progress:
                detections, files = detections_from(
                    photos, target, image_size=image_size, executor=executor, progress=progress
                )
        with processes(jobs, cluster) as executor, bar("experiments", lines=True) as progress:
            results = run(plan, detections=detections, executor=executor, progress=progress)
        written = documents(results, files)
        for name, text in written.texts.items():
            write_text(out / name, text)
    tell(written.headline)
    tell(f"wrote      {out / written.page} and {len(written.texts) - 1} CSV files")
