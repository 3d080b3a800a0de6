"""`orthoscope undistort`: photographs to straight pictures.

Floor 8.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from orthoscope.cli import options

__all__ = ["straighten", "undistort"]

EXAMPLE = """\b
Example:
  $ orthoscope undistort camera/calibration.json photos/ -o straight/ --keep valid
  wrote      14 pictures into straight/, and straight/camera.json, their camera
"""


@click.command(epilog=EXAMPLE)
@options.calibration_file
@options.photos
@click.option(
    "-o", "--out", type=click.Path(path_type=Path, file_okay=False), default=Path("straight"), show_default=True, help="Folder to write."
)
@options.keep
@options.jobs
@options.as_json
def undistort(calibration: Path, photos: tuple[str, ...], out: Path, keep: str, jobs: int | None, as_json: bool) -> None:
    """Take the lens out of photographs: straight lines come out straight."""
    from orthoscope.cli.summary import camera_numbers, to_json
    from orthoscope.io.files import check_folder
    from orthoscope.io.images import photographs
    from orthoscope.io.own_json import load_camera

    camera = load_camera(calibration)
    paths = photographs(photos)
    check_folder(out)
    written, failed, straight = straighten(paths, camera, out, keep=keep, jobs=jobs)
    if as_json:
        rejected = [{"name": name, "reason": reason} for name, reason in failed]
        click.echo(to_json({"written": [str(path) for path in written], "rejected": rejected, "camera": camera_numbers(straight)}))
        return
    click.echo(f"wrote      {len(written)} pictures into {out}/, and {out / 'camera.json'}, their camera")


def straighten(paths: list[Path], camera: Any, out: Path, *, keep: str, jobs: int | None) -> tuple[list[Path], list[tuple[str, str]], Any]:
    """Write straight pictures and their pin-hole camera; photographs that cannot be used are named on stderr."""
    import os
    from concurrent.futures import ThreadPoolExecutor

    from orthoscope.cli.progress import bar
    from orthoscope.geometry.arrays import InputError
    from orthoscope.io.own_json import save
    from orthoscope.io.undistort import straight_camera, undistort_photographs

    with bar("straightening") as progress, ThreadPoolExecutor(jobs or os.cpu_count()) as executor:
        written, failed = undistort_photographs(paths, camera, out, keep=keep, executor=executor, progress=progress)
    for name, reason in failed:
        click.echo(f"left out   {name}: {reason}", err=True)
    if not written:
        raise InputError(f"none of {len(paths)} photographs could be straightened; {failed[0][1]}")
    straight = straight_camera(camera, keep=keep)
    save(straight, out / "camera.json")
    return written, failed, straight
