"""`orthoscope export` and `orthoscope convert`: a camera to the file of the tool that is used next."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell

__all__ = ["convert", "export"]

EXPORT_EXAMPLE = """\b
Example:
  $ orthoscope export camera/calibration.json --to opencv -o camera.yaml
  lens       brown, since opencv cannot hold this free lens: 0.024 px apart on average where corners were seen, 0.16 px at most
  wrote      camera.yaml

\b
`orthoscope tools` lists what TOOL may be. A camera is written exactly, or as the nearest that the tool can hold, and
the line above says what that costs. `orthoscope calibrate --export TOOL` chooses a formula of the tool by held-out error.
"""
CONVERT_EXAMPLE = """\b
Examples:
  $ orthoscope convert camera_info.yaml cameras.txt --to colmap
  wrote      cameras.txt
  $ orthoscope convert camchain.yaml#cam1 half.json --to orthoscope --resize 640x480

\b
IN is a camera of any tool that `orthoscope tools` lists, known by its content; of several cameras in a file, #NAME names one.
"""
TOOLS_EXAMPLE = """\b
Example:
  $ orthoscope tools
  opencv     OpenCV (cv2.FileStorage): brown, rational, kannala_brandt; .yaml .yml .xml .json
"""


class _WithTools(click.Command):
    """A verb whose help ends with the tools of the table, which is loaded for that only."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_epilog(ctx, formatter)
        formatter.write("\nTools:\n" + "".join(f"  {line}\n" for line in tool_lines()))


@click.command(cls=_WithTools, epilog=EXPORT_EXAMPLE)
@click.argument("calibration", metavar="CAMERA")
@click.option(
    "--to", "tool", required=True, type=options.TOOL, help="The tool that is to read it; see below."
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="File to write; by default camera with the tool's suffix. The suffix says which of its files is meant.",
)
@options.another_size
@options.tool_settings
def export(calibration: str, tool: str, out: Path | None, **settings: Any) -> None:
    """Write a camera for another tool."""
    from orthoscope.formats.table import FORMATS

    write_for(calibration, out or Path(f"camera{FORMATS[tool].suffixes[0]}"), tool, **settings)


@click.command(cls=_WithTools, epilog=CONVERT_EXAMPLE)
@click.argument("source", metavar="IN")
@click.argument("out", type=click.Path(path_type=Path, dir_okay=False), metavar="OUT")
@click.option(
    "--to", "tool", required=True, type=options.TOOL, help="The tool that is to read it; see below."
)
@click.option("--image-size", type=options.SIZE, help="Size of the photographs, where IN does not say it.")
@options.another_size
@options.tool_settings
def convert(source: str, out: Path, tool: str, **settings: Any) -> None:
    """Turn one tool's camera into another's."""
    write_for(source, out, tool, **settings)


@click.command(epilog=TOOLS_EXAMPLE)
def tools() -> None:
    """List the tools whose cameras are read and written."""
    tell(*tool_lines())


def tool_lines() -> list[str]:
    """A line for each tool: name, title, lenses, suffixes."""
    from orthoscope.formats.table import FORMATS

    width = max(map(len, FORMATS))
    return [
        f"{name:<{width}}  {record.title}: {', '.join(record.lens_names)}; {' '.join(record.suffixes)}"
        for name, record in FORMATS.items()
    ]


def write_for(
    source: str,
    out: Path,
    tool: str,
    *,
    name: str,
    anyway: bool,
    image_size: tuple[int, int] | None = None,
    crop: Any = None,
    binning: int | None = None,
    resize: tuple[int, int] | None = None,
) -> None:
    """Write the camera of a file for a tool, and say what that costs."""
    from orthoscope.files.whole_files import check_not_onto
    from orthoscope.formats.export import export as write
    from orthoscope.formats.load import load_source

    loaded = load_source(source, image_size=image_size)
    check_not_onto([out], [source.rpartition("#")[0] if not Path(source).exists() else source])
    if crop or binning or resize:
        camera: Any = getattr(loaded, "camera", loaded)
        loaded = options.camera_at_another_size(camera, crop=crop, binning=binning, resize=resize)
    exported = write(loaded, out, tool, name=name, anyway=anyway)
    for remark in exported.remarks():
        tell(f"lens       {remark}")
    tell(f"wrote      {', '.join(map(str, exported.files))}")
