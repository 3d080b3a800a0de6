"""`orthoscope export`: a camera to the file of the tool that is used next."""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli import options

__all__ = ["export"]

EXAMPLE = """\b
Example:
  $ orthoscope export camera/calibration.json --to opencv -o camera.yaml
  lens       brown instead of the free lens: 0.024 px apart on average where corners were seen, 0.16 px at
             most
  wrote      camera.yaml

\b
A formula is written exactly or not at all. opencv, ros and kalibr have no free lens: the nearest formula that
they have is written, and the line above says what it costs. `orthoscope calibrate --export TOOL` chooses that
formula by held-out error.
"""


@click.command(epilog=EXAMPLE)
@options.calibration_file
@click.option("--to", "tool", required=True, metavar="TOOL", help="opencv, ros or kalibr.")
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    default=Path("camera.yaml"),
    show_default=True,
    help="File to write.",
)
def export(calibration: Path, tool: str, out: Path) -> None:
    """Write a camera for another tool."""
    from orthoscope.fitting.calibration import Calibration
    from orthoscope.formats.export import export as write
    from orthoscope.formats.export import exportable
    from orthoscope.formats.own.json import load, load_camera
    from orthoscope.models.lenses import lens_name

    thing = load(calibration)
    camera = load_camera(calibration)
    known = exportable(camera, tool, made_from=thing if isinstance(thing, Calibration) else None)
    write(known.camera, out, tool)
    if known.camera is not camera:
        click.echo(
            f"lens       {lens_name(known.camera.lens)} instead of the free lens: {known.apart_px:.2g} px"
            f" apart on average {known.where}, {known.farthest_px:.2g} px at most"
        )
    click.echo(f"wrote      {out}")
