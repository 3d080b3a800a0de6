"""The command line as a user meets it: arguments in, exit code and printed text out; and photographs for it
to work on.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from orthoscope.cli import main
from orthoscope.files.images import write_image
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer, rendered_photographs
from orthoscope.simulation.scene import Scene, random_views
from orthoscope.targets.target import chessboard


class Run(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def run(monkeypatch, capsys) -> Callable[..., Run]:
    """Runs `orthoscope ARGS...` in this process."""

    def runner(*arguments: object) -> Run:
        monkeypatch.setattr(sys, "argv", ["orthoscope", *map(str, arguments)])
        try:
            main()
            code = 0
        except SystemExit as leave:
            code = int(leave.code or 0)
        printed = capsys.readouterr()
        return Run(code, printed.out, printed.err)

    return runner


@pytest.fixture(scope="session")
def scene() -> Scene:
    """Ten views of a 9x6 board by a small camera with visible distortion."""
    camera = Camera((640, 480), Intrinsics(520.0, 518.0, 324.0, 236.0), Brown(k1=-0.25, k2=0.08, p1=0.001))
    target = chessboard(9, 6, 0.025)
    rng = np.random.default_rng(3)
    return Scene(
        camera,
        target,
        random_views(camera, target, 10, rng=rng, roll=(-0.3, 0.3), fill=(0.5, 0.9), margin=0.025),
    )


@pytest.fixture(scope="session")
def photos(scene, tmp_path_factory) -> Path:
    """The scene's photographs, in a folder."""
    folder = tmp_path_factory.mktemp("rendered") / "photos"
    for name, image in rendered_photographs(
        scene, rng=np.random.default_rng(4), renderer=Renderer(scene.camera)
    ):
        write_image(folder / f"{name}.png", image)
    return folder


@pytest.fixture(scope="session")
def calibrated(photos, tmp_path_factory) -> Path:
    """The folder that `orthoscope calibrate` made of the photographs."""
    from orthoscope.cli.calibrate import calibrate_into

    out = tmp_path_factory.mktemp("calibrated")
    calibrate_into((str(photos),), target="chessboard:9x6:25mm", out=out, lens="brown")
    return out
