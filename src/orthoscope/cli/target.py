"""`orthoscope target`: something to print."""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli.shared.printing import tell

__all__ = ["target"]

EXAMPLE = """\b
Example:
  $ orthoscope target chessboard:9x6:25mm -o board.pdf
  board      chessboard:9x6:25mm on paper of 297 x 210 mm
  wrote      board.pdf: print it at 100 %, then measure the ruler
"""


@click.command(epilog=EXAMPLE)
@click.argument("spec", metavar="SPEC")
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    default=Path("target.pdf"),
    show_default=True,
    help="File to write; its ending says the format: .pdf, .svg, .png or .dxf.",
)
@click.option(
    "--paper",
    metavar="NAME",
    help="A4, A3, A2, A1, A0, letter, tabloid or a size such as 600x400mm; by default the smallest that fits.",
)
def target(spec: str, out: Path, paper: str | None) -> None:
    """Draw a target in true size, with a ruler, to print."""
    from orthoscope.files.whole_files import write_bytes
    from orthoscope.geometry.arrays import InputError
    from orthoscope.targets.printing import PRINT_FORMATS, page_of
    from orthoscope.targets.table import parse_target

    if out.suffix.lower() not in PRINT_FORMATS:
        raise InputError(
            f"{out} ends in {out.suffix or 'nothing'}; expected one of {', '.join(PRINT_FORMATS)} to draw a target."
        )
    drawn = parse_target(spec)
    page = page_of(drawn, paper=paper)
    write_bytes(out, PRINT_FORMATS[out.suffix.lower()](page))
    tell(f"board      {drawn.name} on paper of {page.width:g} x {page.height:g} mm")
    tell(f"wrote      {out}: print it at 100 %, then measure the ruler")
