"""`orthoscope undistort`: photographs to straight pictures, films to straight films."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from orthoscope.cli import options

__all__ = ["straighten", "undistort"]

EXAMPLE = """\b
Examples:
  $ orthoscope undistort camera/calibration.json photos/ -o straight/ --keep valid
  wrote      14 pictures into straight/, and straight/camera.json, their camera
  $ orthoscope undistort camera/calibration.json clip.mp4 -o straight/
  wrote      straight/clip.mp4, 250 frames, and straight/camera.json, its camera

\b
PHOTOS are files, folders and globs of photographs; and video files (mp4, m4v, mov, mkv, avi), each named by itself. Sound is not kept.
"""


@click.command(epilog=EXAMPLE)
@options.camera_file
@options.photos
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("straight"),
    show_default=True,
    help="Folder to write.",
)
@options.keep
@options.jobs
@options.cluster
@options.as_json
def undistort(
    camera: str,
    photos: tuple[str, ...],
    out: Path,
    keep: str,
    jobs: int | None,
    cluster: str | None,
    as_json: bool,
) -> None:
    """Take the lens out of photographs and films: straight lines come out straight."""
    from orthoscope.cli.summary import camera_numbers, to_json
    from orthoscope.files.images import photographs
    from orthoscope.files.whole_files import check_folder
    from orthoscope.formats.load import load_camera
    from orthoscope.formats.own.json import save
    from orthoscope.straight.film import is_video
    from orthoscope.straight.undistort import straight_camera

    loaded = load_camera(camera)
    films = list(dict.fromkeys(Path(path) for path in photos if is_video(path)))
    pictures = [path for path in photos if not is_video(path)]
    paths = photographs(pictures) if pictures or not films else []
    check_folder(out)
    frames = straighten_films(films, loaded, out, keep=keep, jobs=jobs)
    written, failed = (
        straighten(paths, loaded, out, keep=keep, jobs=jobs, cluster=cluster) if paths else ([], [])
    )
    straight = straight_camera(loaded, keep=keep)
    save(straight, out / "camera.json")
    if as_json:
        rejected = [{"name": name, "reason": reason} for name, reason in failed]
        made = [str(path) for path in (*frames, *written)]
        click.echo(to_json({"written": made, "rejected": rejected, "camera": camera_numbers(straight)}))
        return
    made = [f"{film}, {count} frames" for film, count in frames.items()]
    made += [f"{len(written)} pictures into {out}/"] if written else []
    click.echo(f"wrote      {'; '.join(made)}, and {out / 'camera.json'}, their camera")


def straighten_films(
    paths: list[Path], camera: Any, out: Path, *, keep: str, jobs: int | None
) -> dict[Path, int]:
    """Write straight films, one after the other; returns for each its number of frames."""
    from orthoscope.cli.executors import threads
    from orthoscope.cli.progress import bar
    from orthoscope.geometry.arrays import InputError
    from orthoscope.straight.film import undistort_video

    places = {out / path.name: path for path in paths}
    if len(places) < len(paths):
        raise InputError(
            "two films have the same name; straighten them into folders of their own, one after the other."
        )
    frames = {}
    for place, path in places.items():
        with threads(jobs) as executor, bar("straightening") as progress:
            frames[place] = undistort_video(
                path, camera, place, keep=keep, executor=executor, progress=progress
            )
    return frames


def straighten(
    paths: list[Path], camera: Any, out: Path, *, keep: str, jobs: int | None, cluster: str | None
) -> tuple[list[Path], list[tuple[str, str]]]:
    """Write straight pictures; photographs that cannot be used are named on stderr."""
    from orthoscope.cli.executors import threads
    from orthoscope.cli.progress import bar
    from orthoscope.geometry.arrays import InputError
    from orthoscope.straight.undistort import undistort_photographs

    if cluster:  # its workers may stand in another folder
        paths, out = [path.absolute() for path in paths], out.absolute()
    with bar("straightening") as progress, threads(jobs, cluster) as executor:
        written, failed = undistort_photographs(
            paths, camera, out, keep=keep, executor=executor, progress=progress
        )
    for name, reason in failed:
        click.echo(f"left out   {name}: {reason}", err=True)
    if not written:
        raise InputError(f"none of {len(paths)} photographs could be straightened; {failed[0][1]}")
    return written, failed
