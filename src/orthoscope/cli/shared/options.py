"""Options that several verbs share, each said once."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

if TYPE_CHECKING:
    from orthoscope.models.camera import Camera

__all__ = [
    "another_size",
    "as_json",
    "base",
    "calibration_file",
    "camera_at_another_size",
    "camera_file",
    "cluster",
    "fit",
    "folds",
    "image_size",
    "jobs",
    "keep",
    "lens",
    "loss",
    "method",
    "own_folds",
    "photos",
    "shape",
    "skew",
    "straight_folder",
    "strict",
    "target",
    "tool_settings",
    "topic",
    "verbose",
]

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class _Size(click.ParamType):
    """An image's width and height, pixels."""

    name = "WxH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        try:
            width, height = (int(side) for side in value.lower().split("x"))
        except ValueError:
            self.fail(f"{value!r} is no size; expected WIDTHxHEIGHT in pixels, such as 640x480.", param, ctx)
        if width < 1 or height < 1:
            self.fail(f"{value!r} is no size; both sides must be at least 1.", param, ctx)
        return width, height


class _Tool(click.ParamType):
    """A tool of the table; the table is loaded only where a name is to be checked or completed."""

    name = "TOOL"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from orthoscope.formats.table import tool

        return tool(value).name

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        from orthoscope.formats.table import FORMATS

        return [
            CompletionItem(name, help=record.title)
            for name, record in FORMATS.items()
            if name.startswith(incomplete)
        ]


class _Crop(click.ParamType):
    """A part of an image: where it begins, and its size."""

    name = "WxH+X+Y"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"(\d{1,7})x(\d{1,7})\+(\d{1,7})\+(\d{1,7})", value)
        if not found:
            self.fail(
                f"{value!r} is no part of an image; expected WIDTHxHEIGHT+LEFT+TOP, such as 640x480+320+240.",
                param,
                ctx,
            )
        width, height, left, top = (int(part) for part in found.groups())
        return left, top, (width, height)


SIZE, TOOL = _Size(), _Tool()


def another_size(verb: Callable[..., Any]) -> Callable[..., Any]:
    """--crop, --binning and --resize: the same camera for photographs of another size, done in this order."""
    resize = click.option("--resize", type=SIZE, help="The same camera for photographs scaled to this size.")
    binning = click.option(
        "--binning",
        type=click.IntRange(1),
        help="The same camera where blocks of N x N pixels are read as one.",
    )
    crop = click.option(
        "--crop",
        type=_Crop(),
        help="The same camera for a part of its photographs: its size, its first pixel.",
    )
    return crop(binning(resize(verb)))


def camera_at_another_size(
    camera: Camera,
    *,
    crop: tuple[int, int, tuple[int, int]] | None,
    binning: int | None,
    resize: tuple[int, int] | None,
) -> Camera:
    """The same camera for photographs of another size, done in this order.

    Args:
        camera: for the photographs as they were.
        crop: the part's left column, its top row and its size; None for the whole.
        binning: side of a block of pixels that are read as one; None for 1.
        resize: width and height of the scaled photographs; None where they are not scaled.
    """
    camera = camera.cropped(*crop) if crop else camera
    camera = camera.binned(binning) if binning else camera
    return camera.resized(resize) if resize else camera


def tool_settings(verb: Callable[..., Any]) -> Callable[..., Any]:
    """--name and --anyway, as `export` takes them."""
    name = click.option(
        "--name", default="camera", show_default=True, help="Of the camera, where the tool names cameras."
    )
    anyway = click.option(
        "--anyway", is_flag=True, help="Write even where the tool cannot come within a pixel of the camera."
    )
    return name(anyway(verb))


photos: Decorator = click.argument("photos", nargs=-1, required=True, metavar="PHOTOS...")
target: Decorator = click.option(
    "--target",
    metavar="SPEC",
    multiple=True,
    callback=lambda _, __, given: " + ".join(given) or None,
    help=(
        "What was photographed, once for each board that the photographs show: chessboard:COLUMNSxROWS:SQUARE, counting inner corners, e.g."
        " chessboard:9x6:25mm; charuco:COLUMNSxROWS:SQUARE:MARKER:DICTIONARY[:legacy], counting squares;"
        " aprilgrid:COLUMNSxROWS:TAG:SPACING, counting tags; or a target.yaml of Kalibr; docs/targets.md has"
        " all kinds. auto says which it seems to be."
    ),
)
topic: Decorator = click.option(
    "--topic", help="Of a ROS bag or MCAP file with several topics that have pictures: which one."
)
image_size: Decorator = click.option(
    "--image-size",
    type=SIZE,
    help="Size of the photographs; needed with a table of corners or a simulated lens only.",
)
lens: Decorator = click.option(
    "--lens",
    default="auto",
    show_default=True,
    metavar="NAME",
    help=(
        "free (a formula and a spline on top), brown, rational, kannala_brandt, double_sphere, eucm, division,"
        " fov, pfet, fet;"
        " brown:k1,k2 frees just these; auto takes what the method takes: decoupled the free lens, fccm"
        " brown, or kannala_brandt for wide views."
    ),
)
method: Decorator = click.option(
    "--method",
    default="decoupled",
    show_default=True,
    metavar="NAME",
    help=(
        "How to calibrate: decoupled (target's shape and a free lens first), fccm (jointly, the target flat),"
        " nmldc (straight lines first), mldc (the paper's), hartley_kang or fitzgibbon (linearly, lens first)."
    ),
)
shape: Decorator = click.option(
    "--shape",
    metavar="KIND",
    help=(
        "The target's shape, for decoupled: flat (as it is said to be), smooth (stretched, bent) or free"
        " (each corner by itself); by default what best predicts photographs left out."
    ),
)
base: Decorator = click.option(
    "--base",
    metavar="NAME",
    help=(
        "The formula under the free lens, for decoupled: brown, kannala_brandt, rational or another; by default"
        " what foresees best of these three."
    ),
)
fit: Decorator = click.option(
    "--fit",
    metavar="HOW",
    help=(
        "How decoupled fits a formula that --lens or --export asks for: joint (with poses and target) or pairs"
        " (to what the free lens found); by default what best predicts photographs left out."
    ),
)
skew: Decorator = click.option("--skew", is_flag=True, help="Let the pixel axes be oblique.")
loss: Decorator = click.option(
    "--loss",
    metavar="NAME",
    help=(
        "For fccm, nmldc and mldc: linear, huber or cauchy; the last two forgive gross errors beyond 1 px."
        " decoupled finds its own."
    ),
)
folds: Decorator = click.option(
    "--folds",
    default=5,
    show_default=True,
    type=click.IntRange(2),
    help="Parts that the views are held out in.",
)
own_folds: Decorator = click.option(
    "--folds",
    type=click.IntRange(2),
    help=(
        "Hold the views out in so many parts, everything fitted again without each; by default each is left"
        " out in its turn by one linear step."
    ),
)
jobs: Decorator = click.option(
    "--jobs",
    type=click.IntRange(1),
    help=(
        "How much is done at the same time: photographs, and folds where they are asked for; by default as many"
        " as there are cores."
    ),
)
cluster: Decorator = click.option(
    "--cluster",
    metavar="ADDRESS",
    help=(
        "Instead of --jobs: the Dask scheduler, such as tls://192.168.1.5:8786, whose workers see the same"
        " files (pip install 'orthoscope[cluster]'). Whoever owns that address runs code here."
    ),
)
keep: Decorator = click.option(
    "--keep",
    type=click.Choice(["all", "valid"]),
    default="all",
    show_default=True,
    help="all: every photographed pixel, with black borders; valid: only places that were photographed.",
)
straight_folder: Decorator = click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("straight"),
    show_default=True,
    help="Folder to write.",
)
camera_file: Decorator = click.argument("camera", metavar="CAMERA")
as_json: Decorator = click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON object instead of text."
)
calibration_file: Decorator = click.argument(
    "calibration", type=click.Path(path_type=Path), metavar="CALIBRATION.json"
)
strict: Decorator = click.option(
    "--strict", is_flag=True, help='Exit with 3 where the verdict is "do not use", once all is written.'
)
verbose: Decorator = click.option(
    "-v", "--verbose", is_flag=True, help="Print every figure that was found, and what was left out."
)
