"""`FORMATS`, the table of tools by name that everything else goes by: what `--to` takes, what is read by
content.

A tool is one file of this room with one record; entered here, the command line, errors, completions, the
choice of a formula and docs/formats.md know it. A document is taken for the first tool that recognises it, so
those that are sure come first.
"""

from __future__ import annotations

from orthoscope.formats.basalt import BASALT
from orthoscope.formats.colmap import COLMAP
from orthoscope.formats.foxglove import FOXGLOVE
from orthoscope.formats.kalibr import KALIBR
from orthoscope.formats.lensfun import LENSFUN
from orthoscope.formats.matlab import MATLAB
from orthoscope.formats.meshroom import MESHROOM
from orthoscope.formats.metashape import METASHAPE
from orthoscope.formats.mrcal import MRCAL
from orthoscope.formats.nerfstudio import NERFSTUDIO
from orthoscope.formats.opencv import OPENCV
from orthoscope.formats.openmvg import OPENMVG
from orthoscope.formats.own.tool import ORTHOSCOPE
from orthoscope.formats.photonvision import PHOTONVISION
from orthoscope.formats.record import Format
from orthoscope.formats.ros import ROS
from orthoscope.geometry.arrays import InputError

__all__ = ["FORMATS", "tool"]

FORMATS: dict[str, Format] = {
    record.name: record
    for record in (
        ORTHOSCOPE,
        OPENCV,
        ROS,
        KALIBR,
        COLMAP,
        NERFSTUDIO,
        MRCAL,
        MATLAB,
        METASHAPE,
        OPENMVG,
        MESHROOM,
        PHOTONVISION,
        FOXGLOVE,
        BASALT,
        LENSFUN,
    )
}


def tool(name: str) -> Format:
    """The record of a tool.

    Raises:
        InputError: there is none of this name.
    """
    if name not in FORMATS:
        raise InputError(f"no file for {name!r} can be written; expected one of {', '.join(FORMATS)}.")
    return FORMATS[name]
