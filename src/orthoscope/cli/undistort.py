"""`orthoscope undistort`: photographs to straight pictures, films to straight films."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell, tell_json, tell_of_earlier

__all__ = ["straighten", "undistort"]

EXAMPLE = """\b
Examples:
  $ orthoscope undistort camera/calibration.json photos/ -o straight/ --keep valid
  wrote      14 pictures into straight/, and straight/camera.json, their camera
  $ orthoscope undistort camera/calibration.json clip.mp4 -o straight/
  wrote      straight/clip.mp4, 250 frames, and straight/camera.json, its camera
  $ orthoscope undistort fisheye.yaml photos/ -o round/ --projection equidistant --size 1200x1200

\b
CAMERA is ours or any tool's (`orthoscope tools`). PHOTOS are files, folders and globs of photographs and films
(mp4, m4v, mov, mkv, avi). Photographs keep their depth, channels, EXIF,
profile and file type; films their sound and time stamps where PyAV is installed
(pip install 'orthoscope[video]').
"""


@click.command(epilog=EXAMPLE)
@options.camera_file
@options.photos
@options.straight_folder
@options.keep
@click.option("--size", type=options.SIZE, help="Of the straight pictures; by default the camera's.")
@click.option("--fov", type=float, help="Degrees that a straight picture shows across; instead of --keep.")
@click.option(
    "--scale",
    type=float,
    help="Straight pixels for one of the camera's at its principal point; instead of --keep.",
)
@click.option(
    "--projection",
    default="rectilinear",
    show_default=True,
    metavar="NAME",
    help="rectilinear, or for wide lenses equidistant, stereographic, cylindrical or equirectangular.",
)
@click.option(
    "--maps",
    is_flag=False,
    flag_value="npy",
    type=click.Choice(["npy", "opencv"]),
    help="Also write where each straight pixel looks, for cv2.remap: map_x.npy and map_y.npy, or maps.yml.gz.",
)
@options.jobs
@options.cluster
@options.as_json
def undistort(
    camera: str,
    photos: tuple[str, ...],
    out: Path,
    keep: str,
    size: tuple[int, int] | None,
    fov: float | None,
    scale: float | None,
    projection: str,
    maps: str | None,
    jobs: int | None,
    cluster: str | None,
    as_json: bool,
) -> None:
    """Take the lens out of photographs and films: straight lines come out straight."""
    from orthoscope.cli.shared.summary import camera_numbers, to_json
    from orthoscope.files.images import photographs
    from orthoscope.files.whole_files import check_folder, check_not_onto
    from orthoscope.formats.load import load_camera
    from orthoscope.models.camera import Camera
    from orthoscope.straight.film import CODECS, is_video
    from orthoscope.straight.outputs import of_earlier_runs
    from orthoscope.straight.views import share_kept, straight_camera

    loaded = load_camera(camera)
    view = straight_camera(loaded, keep=keep, size=size, fov=fov, scale=scale, projection=projection)
    given = photographs(photos, also=tuple(CODECS))
    films, paths = [path for path in given if is_video(path)], [path for path in given if not is_video(path)]
    check_folder(out)
    check_not_onto([out / path.name for path in (*films, *paths)], [*films, *paths])
    frames = straighten_films(films, loaded, out, view=view, jobs=jobs)
    written, failed = (
        straighten(paths, loaded, out, view=view, jobs=jobs, cluster=cluster) if paths else ([], [])
    )
    beside = write_beside(loaded, view, out, maps=maps)
    earlier = of_earlier_runs(out, [*frames, *written, *beside])
    if as_json:
        rejected = [{"name": name, "reason": reason} for name, reason in failed]
        made = [str(path) for path in (*frames, *written)]
        numbers = camera_numbers(view) if isinstance(view, Camera) else None
        others = [str(path) for path in earlier]
        tell_json(to_json({"written": made, "rejected": rejected, "earlier": others, "camera": numbers}))
        return
    wrote_camera = isinstance(view, Camera)
    tell_of_earlier(earlier)
    if (share := share_kept(loaded, view)) < 1.0 and keep == "all":
        tell(f"shows      {100 * share:.3g} % of what was photographed ({projection})", err=True)
    made = [f"{film}, {count} frames" for film, count in frames.items()]
    made += [f"{len(written)} picture{'s' if len(written) > 1 else ''} into {out}/"] if written else []
    others = (
        [f"{beside[0]}, {'its' if len(frames) + len(written) == 1 else 'their'} camera"]
        if wrote_camera
        else []
    )
    others += [str(path) for path in beside[wrote_camera:]]
    tell(f"wrote      {'; '.join(made)}" + "".join(f", and {other}" for other in others))


def write_beside(camera: Any, view: Any, out: Path, *, maps: str | None) -> list[Path]:
    """Write the straight pictures' camera, where it is one that files can hold, and the maps that were asked for."""
    from orthoscope.files.whole_files import write_bytes
    from orthoscope.formats.own.json import save
    from orthoscope.models.camera import Camera
    from orthoscope.straight.map_files import map_files
    from orthoscope.straight.views import map_of

    written = []
    if isinstance(view, Camera):
        save(view, out / "camera.json")
        written.append(out / "camera.json")
    for name, content in map_files(*map_of(camera, view), kind=maps).items() if maps else ():
        write_bytes(out / name, content)
        written.append(out / name)
    return written


def straighten_films(
    paths: list[Path], camera: Any, out: Path, *, view: Any, jobs: int | None
) -> dict[Path, int]:
    """Write straight films, one after the other; returns for each its number of frames."""
    from orthoscope.cli.shared.executors import threads
    from orthoscope.cli.shared.progress import bar
    from orthoscope.geometry.arrays import InputError
    from orthoscope.straight.film import undistort_video
    from orthoscope.straight.film_av import has_pyav

    places = {out / path.name: path for path in paths}
    if len(places) < len(paths):
        raise InputError(
            "two films have the same name; straighten them into folders of their own, one after the other."
        )
    if paths and not has_pyav():
        tell("films      are written without sound; pip install 'orthoscope[video]' keeps it", err=True)
    frames = {}
    for place, path in places.items():
        with threads(jobs) as executor, bar("straightening") as progress:
            frames[place] = undistort_video(
                path, camera, place, view=view, executor=executor, progress=progress
            )
    return frames


def straighten(
    paths: list[Path], camera: Any, out: Path, *, view: Any, jobs: int | None, cluster: str | None
) -> tuple[list[Path], list[tuple[str, str]]]:
    """Write straight pictures; photographs that cannot be used are named on stderr."""
    from orthoscope.cli.shared.executors import threads
    from orthoscope.cli.shared.progress import bar
    from orthoscope.geometry.arrays import InputError
    from orthoscope.straight.undistort import undistort_photographs

    if cluster:  # its workers may stand in another folder
        paths, out = [path.absolute() for path in paths], out.absolute()
    with bar("straightening") as progress, threads(jobs, cluster) as executor:
        written, failed = undistort_photographs(
            paths, camera, out, view=view, executor=executor, progress=progress
        )
    for name, reason in failed:
        tell(f"left out   {name}: {reason}", err=True)
    if not written:
        raise InputError(f"none of {len(paths)} photographs could be straightened; {failed[0][1]}")
    return written, failed
