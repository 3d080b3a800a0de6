"""`orthoscope simulate`: a camera whose truth is known, to detections or rendered photographs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell

if TYPE_CHECKING:
    from orthoscope.models.camera import Camera
    from orthoscope.simulation.scene import Scene
    from orthoscope.targets.target import Target

__all__ = ["simulate", "write_photographs"]

EXAMPLE = """\b
Examples:
  $ orthoscope simulate --views 15 --noise 0.1 -o simulated/
  wrote      simulated/detections.json, and simulated/truth.json: camera, target and poses
  $ orthoscope simulate --lens kannala_brandt:k1=-0.02 --image-size 1280x960 --focal 400 --render \\
    -o simulated/
  $ orthoscope simulate --camera camera/calibration.json --target chessboard:14x20:14mm --tilt-noise \\
    -o simulated/
"""


@click.command(epilog=EXAMPLE)
@click.option(
    "--camera",
    "source",
    metavar="CAMERA",
    help="A camera of ours or of any tool (`orthoscope tools`); by default that of `orthoscope demo`.",
)
@click.option(
    "--lens",
    metavar="LENS",
    help="Instead of --camera: a lens with its coefficients, such as brown:k1=-0.3,k2=0.1.",
)
@options.image_size
@click.option(
    "--focal",
    type=click.FloatRange(1),
    help="With --lens: focal length, pixels; by default the image's width.",
)
@click.option(
    "--target",
    "targets",
    multiple=True,
    default=("chessboard:9x6:25mm",),
    show_default=True,
    metavar="SPEC",
    help="What stands before the camera.",
)
@click.option("--views", default=20, show_default=True, type=click.IntRange(1), help="How many photographs.")
@click.option(
    "--noise",
    default=0.1,
    show_default=True,
    type=click.FloatRange(0),
    help="Standard deviation of each corner coordinate, pixels.",
)
@click.option(
    "--tilt-noise",
    is_flag=True,
    help="Let the noise grow with the target's tilt, doubling at 70 degrees (the paper's law).",
)
@click.option(
    "--tilt",
    default=45.0,
    show_default=True,
    type=click.FloatRange(0, 70),
    help="Greatest tilt of the target, degrees.",
)
@click.option(
    "--fill",
    nargs=2,
    type=float,
    default=(0.4, 0.9),
    show_default=True,
    help="Share of the image that it fills, from .. to.",
)
@click.option("--partial", is_flag=True, help="Let the target leave the frame.")
@click.option("--render", "rendered", is_flag=True, help="Also render the photographs, into OUT/photographs.")
@click.option(
    "--paper",
    "papers",
    type=click.Choice(("low", "high")),
    help="Instead of all these but --noise and --seed: the paper's section 4.1 with low or high distortion, 15 views to"
    " compute in OUT/training.json and 5 to test in OUT/test.json; the first trial of `orthoscope paper`.",
)
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0), help="Of all that is random.")
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("simulated"),
    show_default=True,
    help="Folder to write.",
)
def simulate(
    source: str | None,
    lens: str | None,
    image_size: tuple[int, int] | None,
    focal: float | None,
    targets: tuple[str, ...],
    views: int,
    noise: float,
    tilt_noise: bool,
    tilt: float,
    fill: tuple[float, float],
    partial: bool,
    rendered: bool,
    papers: str | None,
    seed: int,
    out: Path,
) -> None:
    """Make corners, or photographs, of a camera that is known."""
    import numpy as np

    from orthoscope.files.whole_files import check_folder
    from orthoscope.formats.own.json import save
    from orthoscope.simulation.scene import Scene, random_views, simulate_detections
    from orthoscope.targets.table import parse_target

    check_folder(out)
    if papers:
        _write_papers(papers, noise, seed, out)
        return
    rng = np.random.default_rng(seed)
    camera, board = _camera(source, lens, image_size, focal), _only(parse_target(" + ".join(targets)))
    margin = _square(board) if rendered else 0.0  # the outer squares are to be in the picture too
    poses = random_views(
        camera,
        board,
        views,
        rng=rng,
        tilt=(0.0, np.deg2rad(tilt)),
        fill=fill,
        whole=not partial,
        margin=margin,
    )
    scene = Scene(camera, board, poses)
    save(simulate_detections(scene, noise_px=noise, rng=rng, tilt_noise=tilt_noise), out / "detections.json")
    save(scene, out / "truth.json")
    tell(f"wrote      {out / 'detections.json'}, and {out / 'truth.json'}: camera, target and poses")
    if rendered:
        folder = write_photographs(scene, out / "photographs", seed=seed)
        tell(f"wrote      {views} photographs into {folder}/")


def _write_papers(distortion: str, noise: float, seed: int, out: Path) -> None:
    """The paper's own corners, for other people's code to run on."""
    from orthoscope.formats.own.json import save
    from orthoscope.paper.trials import Condition, papers_scene, simulated

    training, test = simulated(distortion, Condition(noise), seed=seed, trial=0)
    for thing, name in (
        (training, "training"),
        (test, "test"),
        (papers_scene(distortion, Condition(noise), seed=seed, trial=0), "truth"),
    ):
        save(thing, out / f"{name}.json")
    tell(
        f"wrote      {out / 'training.json'}, {out / 'test.json'}, and {out / 'truth.json'}: camera, target,"
        " poses"
    )


def _only(target: Target) -> Target:
    """The target, where it is one.

    Raises:
        InputError: it is several.
    """
    from orthoscope.geometry.arrays import InputError

    if target.members:
        raise InputError(
            f"simulate was given {len(target.members)} targets ({target.name}); expected one, which all views"
            " show. Name one --target; orthoscope.simulation.render.Renderer.photograph_of draws several."
        )
    return target


def _camera(
    source: str | None, lens: str | None, image_size: tuple[int, int] | None, focal: float | None
) -> Camera:
    """The camera that was asked for: of a file, of a lens, or that of the demo."""
    from orthoscope.formats.load import load_camera
    from orthoscope.geometry.arrays import InputError
    from orthoscope.models.camera import Camera
    from orthoscope.models.intrinsics import Intrinsics
    from orthoscope.models.lenses.table import lens_with_values
    from orthoscope.simulation.render import demo_scene

    if source and lens:
        raise InputError("both --camera and --lens were given; expected one of them. Drop the other.")
    if not lens:
        if image_size or focal:
            raise InputError(
                "--image-size and --focal go with --lens; a camera of a file has its own. Add --lens or drop"
                " them."
            )
        return load_camera(source) if source else demo_scene().camera
    width, height = image_size or (1280, 960)
    focal = focal or float(width)
    return Camera(
        (width, height),
        Intrinsics(focal, focal, 0.5 * (width - 1), 0.5 * (height - 1)),
        lens_with_values(lens),
    )


def write_photographs(scene: Scene, folder: Path, *, seed: int) -> Path:
    """Render every view of a scene into a folder, as PNG."""
    import numpy as np

    from orthoscope.cli.shared.progress import bar
    from orthoscope.files.images import write_image
    from orthoscope.simulation.render import rendered_photographs

    with bar("rendering") as progress:
        for done, (name, image) in enumerate(rendered_photographs(scene, rng=np.random.default_rng(seed)), 1):
            write_image(folder / f"{name}.png", image)
            progress(done, len(scene.camera_from_target), name)
    return folder


def _square(target: Target) -> float:
    """The side of a chessboard's square: what it reaches beyond its outer corners."""
    return float(abs(target.points[1] - target.points[0]).max())
