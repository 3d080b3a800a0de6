"""`orthoscope straighten`: photographs of anything with straight edges to the lens, and to straight pictures."""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell, tell_json, tell_of_earlier

__all__ = ["straighten"]

EXAMPLE = """\b
Example:
  $ orthoscope straighten street/ -o straight/
  lens       brown about (330.6, 232.5), from 215 of 240 long edges in 3 photographs, which it leaves bent by 0.08 px
  note       how large the straight pictures are is a convention: no target was seen, so this is no calibration
  wrote      3 pictures into straight/, straight/camera.json, their camera, and straight/lens.json

\b
Take photographs of buildings, shelves or tiles that fill the frame to its borders: an edge tells the lens where it
runs, and most by the border. Several photographs of one camera at one zoom tell more than one.
For a camera with its focal length, in pixels: orthoscope calibrate, with a target.
Exit: 0 done, 1 too few edges agree on a lens, 2 the command is wrong.
"""


@click.command(epilog=EXAMPLE)
@options.photos
@click.option(
    "--lens",
    default="auto",
    show_default=True,
    metavar="NAME",
    help="A formula, or with the coefficients to find, brown:k1,k2; auto takes brown's, kannala_brandt's or division.",
)
@options.straight_folder
@options.keep
@options.jobs
@options.as_json
def straighten(
    photos: tuple[str, ...], lens: str, out: Path, keep: str, jobs: int | None, as_json: bool
) -> None:
    """Find the lens by straight edges, without any target, and straighten the photographs."""
    from orthoscope.cli.shared.executors import threads
    from orthoscope.cli.shared.progress import bar
    from orthoscope.cli.shared.summary import to_json
    from orthoscope.cli.undistort import straighten as write_straight
    from orthoscope.cli.undistort import write_beside
    from orthoscope.files.images import photographs
    from orthoscope.files.whole_files import check_folder, check_not_onto
    from orthoscope.formats.own.json import save
    from orthoscope.methods.plumb_line.photographs import lens_of_photographs
    from orthoscope.models.lenses.table import lens_name
    from orthoscope.straight.outputs import of_earlier_runs
    from orthoscope.straight.views import straight_camera

    paths = photographs(photos)
    check_folder(out)
    check_not_onto([out / path.name for path in paths], paths)
    with threads(jobs) as executor, bar("looking for edges") as progress:
        found = lens_of_photographs(paths, lens=lens, executor=executor, progress=progress)
    view = straight_camera(found.camera, keep=keep)
    written, _ = write_straight(paths, found.camera, out, view=view, jobs=jobs, cluster=None)
    beside = write_beside(found.camera, view, out, maps=None)
    save(found.camera, out / "lens.json")
    tell_of_earlier(of_earlier_runs(out, [*written, *beside, out / "lens.json"]))
    centre = found.camera.intrinsics
    name, used = lens_name(found.camera.lens), int(found.used.sum())
    if as_json:
        coefficients = dict(
            zip(found.camera.lens.names(), found.camera.lens.coefficients.tolist(), strict=True)
        )
        told = {
            "lens": {"name": name, **coefficients},
            "centre": [centre.cx, centre.cy],
            "edges": len(found.edges),
            "used": used,
            "rms_px": found.rms_px,
            "assumptions": list(found.assumptions),
            "written": [str(path) for path in (*written, *beside, out / "lens.json")],
        }
        tell_json(to_json(told))
        return
    photographed = f"{len(paths)} photograph{'' if len(paths) == 1 else 's'}"
    tell(
        f"lens       {name} about ({centre.cx:.1f}, {centre.cy:.1f}), from {used} of {len(found.edges)} long edges in"
        f" {photographed}, which it leaves bent by {found.rms_px:.2f} px",
        *(f"note       {sentence}" for sentence in found.assumptions),
        "note       how large the straight pictures are is a convention: no target was seen, so this is no"
        " calibration",
        f"wrote      {len(written)} pictures into {out}/, {out / 'camera.json'}, their camera, and {out / 'lens.json'}",
    )
