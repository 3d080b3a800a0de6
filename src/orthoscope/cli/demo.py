"""`orthoscope demo`: some photographs are rendered, then the main job, and how far its camera is from the truth."""

from __future__ import annotations

from pathlib import Path

import click

from orthoscope.cli.shared.printing import tell

__all__ = ["demo"]

EXAMPLE = """\b
Example:
  $ orthoscope demo -o demo/
  rendered   20 photographs of chessboard:14x9:16mm into demo/photographs/
  views      20 used, 0 set aside; 2520 corners
  ...
  truth      the recovered camera is 0.004 px from the true one on average over the frame, 0.006 px at most
"""


@click.command(epilog=EXAMPLE)
@click.option(
    "--seed", default=0, show_default=True, type=click.IntRange(0), help="Of the views and the noise."
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("demo"),
    show_default=True,
    help="Folder to write.",
)
def demo(seed: int, out: Path) -> None:
    """Render 20 photographs of a chessboard through a distorting lens, calibrate from them, compare with the
    truth.
    """
    import numpy as np

    from orthoscope.cli.calibrate import calibrate_into
    from orthoscope.cli.simulate import write_photographs
    from orthoscope.files.whole_files import check_folder
    from orthoscope.formats.own.json import save
    from orthoscope.models.difference import frame_grid, image_difference
    from orthoscope.simulation.render import demo_scene

    check_folder(out)
    scene = demo_scene(seed=seed)
    folder = write_photographs(scene, out / "photographs", seed=seed)
    save(scene, out / "truth.json")
    tell(f"rendered   {len(scene.camera_from_target)} photographs of {scene.target.name} into {folder}/")
    evaluation = calibrate_into((str(folder),), target=scene.target.name, out=out, lens="brown")
    apart = np.hypot(
        *image_difference(scene.camera, evaluation.calibration.camera, frame_grid(scene.camera.image_size)).T
    )
    tell(
        f"truth      the recovered camera is {np.nanmean(apart):.3f} px from the true one on average over the"
        f" frame, {np.nanmax(apart):.3f} px at most"
    )
