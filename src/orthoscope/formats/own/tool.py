"""Our own files in the table of tools: every lens, its centre, a skew; and poses with a calibration or a
scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from orthoscope.formats.own.json import camera_in, text_of
from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import Document
from orthoscope.models.lenses.table import FREE, LENSES

__all__ = ["ORTHOSCOPE"]

# A file of ours says what it is in its first bytes.
OPENING = 200


def _recognises(document: Document) -> bool:
    return b'"orthoscope"' in document.content[:OPENING]


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    return {"camera": Contents(camera_in(document.content, document.path))}


def _write(contents: Contents, place: Path) -> Files:
    return {place: text_of(contents.camera)}


ORTHOSCOPE = Format(
    name="orthoscope",
    title="orthoscope camera.json",
    suffixes=(".json",),
    holdings=(
        *(Holding(name, name, kind.names()) for name, kind in LENSES.items()),
        Holding(FREE, FREE, ()),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    skew=True,
    own_centre=True,
    remarks="calibration.json and truth.json are read too, for their camera.",
)
