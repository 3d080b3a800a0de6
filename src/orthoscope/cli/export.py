"""`orthoscope export`: a camera to the file of the tool that is used next.

Floor 8.
"""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli import options

__all__ = ["export"]

EXAMPLE = """\b
Example:
  $ orthoscope export camera/calibration.json --to opencv -o camera.yaml
  wrote      camera.yaml
"""


@click.command(epilog=EXAMPLE)
@options.calibration_file
@click.option("--to", "tool", required=True, metavar="TOOL", help="opencv, ros or kalibr.")
@click.option(
    "-o", "--out", type=click.Path(path_type=Path, dir_okay=False), default=Path("camera.yaml"), show_default=True, help="File to write."
)
def export(calibration: Path, tool: str, out: Path) -> None:
    """Write a camera for another tool, exactly or not at all."""
    from orthoscope.io.export import export as write
    from orthoscope.io.own_json import load_camera

    write(load_camera(calibration), out, tool)
    click.echo(f"wrote      {out}")
