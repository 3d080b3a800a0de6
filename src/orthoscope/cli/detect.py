"""`orthoscope detect`: photographs to detections.json."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell, tell_json

if TYPE_CHECKING:
    from orthoscope.targets.detections import SetAside

__all__ = ["detect"]

EXAMPLE = """\b
Example:
  $ orthoscope detect photos/ --target chessboard:9x6:25mm -o detections.json
  views      14 of 14 photographs, 756 corners, 640x480
  wrote      detections.json
"""


@click.command(epilog=EXAMPLE)
@options.photos
@options.target
@options.topic
@options.image_size
@options.jobs
@click.option(
    "--max-megapixels",
    type=click.FloatRange(min=0, min_open=True),
    help="Photographs that say they are larger are set aside unread; 500 by default.",
)
@options.cluster
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    default=Path("detections.json"),
    show_default=True,
    help="File to write.",
)
@options.as_json
def detect(
    photos: tuple[str, ...],
    target: str | None,
    topic: str | None,
    image_size: tuple[int, int] | None,
    jobs: int | None,
    max_megapixels: float | None,
    cluster: str | None,
    out: Path,
    as_json: bool,
) -> None:
    """Find the target's corners in photographs (or turn a corners.vnl or corners.csv into detections.json).

    With --target auto say which target the photographs show, of several each, and write nothing.
    """
    from orthoscope.cli.shared.executors import threads
    from orthoscope.cli.shared.inputs import AUTO, detections_from
    from orthoscope.cli.shared.progress import bar
    from orthoscope.files.whole_files import check_folder
    from orthoscope.formats.own.json import save, text_of

    if target == AUTO:
        _recognise(photos, as_json=as_json)
        return
    check_folder(out.parent)
    with threads(jobs, cluster) as executor, bar("detecting") as progress:
        detections, _ = detections_from(
            photos,
            target,
            image_size=image_size,
            executor=executor,
            progress=progress,
            most_megapixels=max_megapixels,
            topic=topic,
        )
    save(detections, out)
    width, height = detections.image_size
    used, aside = detections.views, detections.set_aside
    if as_json:
        tell_json(text_of(detections))
        return
    tell(
        f"views      {len(used)} of {len(used) + len(aside)} photographs, {detections.corners} corners,"
        f" {width}x{height}"
    )
    tell(*(f"           {line}" for line in _reasons(aside)))
    for remark in detections.remarks:
        tell(f"remark     {remark.image}: {remark.words}")
    tell(f"wrote      {out}")


def _reasons(aside: Sequence[SetAside]) -> Iterator[str]:
    """A line for each photograph that was set aside, and for frames of one film that have the same reason."""
    from orthoscope.files.pictures import file_name_of

    for (_, reason), same in groupby(
        aside, key=lambda one: (file_name_of(one.image) or one.image, one.reason)
    ):
        first, *others = (entry.image for entry in same)
        yield f"{first}{f' and {len(others)} more of it' if others else ''}: {reason}"


def _recognise(photos: tuple[str, ...], *, as_json: bool) -> None:
    """Say which targets photographs show."""
    from orthoscope.detection.recognition.recognise import recognise
    from orthoscope.targets.target import TOGETHER

    found = recognise(photos)
    if as_json:
        names = [target.name for target in found.targets]
        each = [{"target": name, "seen": seen} for name, seen in zip(names, found.seen, strict=True)]
        told = {"target": TOGETHER.join(names), "seen": found.seen[-1], "looked_at": found.looked_at}
        tell_json(json.dumps(told | {"targets": each}, indent=2))
        return
    tell(*(f"target     {target.name}" for target in found.targets), f"seen       {found.sentence}")
