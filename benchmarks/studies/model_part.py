"""The model's own part of the camera error, predicted over sampled: perfect data, the same photographs taken
again.

    python -m benchmarks.studies.model_part --draws 200 [--only brown] [--views 5 20] [--board 9x6]

prints a line for each camera, model, board and number of views: the ratio of the deviation that is predicted
to that which is found over so many draws of the corners' noise, of fx, fy, cx, cy and of the first
coefficients; and of the image at the middle, the edge and the corner of the frame, far away and at two
distances, a motion fitted out over the corners.  `flat, formula` is what `fccm` fits, `free, free` the
richest of the default method.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from orthoscope.evaluation.camera_error import seen_places
from orthoscope.fitting.slopes.image_slopes import difference_of_images, image_slopes, motion_slopes
from orthoscope.fitting.unseen.leave_one_out import leave_one_out
from orthoscope.fitting.unseen.scatter import Scatter, scatter_of
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.decoupled.step_one import StepOneFit, fit_step_one
from orthoscope.methods.decoupled.step_one_linearised import linearised
from orthoscope.methods.fccm import fit_flat
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections
from orthoscope.targets.target import chessboard

__all__ = ["main", "study"]

NOISE = 0.1  # px
TYPICAL = 0.5  # metres, at which a turn and a shift are fitted out for things that are near
DISTANCES = (np.inf, 0.5, 2.0)  # metres
PLACES = ((0.5, 0.5), (0.9, 0.5), (0.85, 0.85))  # shares of the frame: its middle, an edge, a corner
SIZE = 0.24  # metres, of every board's longer side
CAMERAS = {
    "brown": Camera(
        (640, 480), Intrinsics(520.0, 524.0, 325.0, 236.0), Brown(k1=-0.28, k2=0.09, p1=1e-3, p2=-6e-4)
    ),
    "kannala_brandt": Camera(
        (640, 480), Intrinsics(205.0, 206.0, 318.0, 242.0), KannalaBrandt(k1=-0.02, k2=0.003, k3=-0.002)
    ),
}
MODELS = {"flat, formula": ("flat", "formula"), "free, free": ("free", "free")}
BOARDS = ((9, 6), (14, 10), (20, 14))
VIEWS = (5, 8, 20, 40)


def taken_again(clean: Detections, rng: np.random.Generator) -> Detections:
    """The same photographs with other noise."""
    views = [
        replace(view, pixels=view.pixels + NOISE * rng.standard_normal(view.pixels.shape))
        for view in clean.views
    ]
    return replace(clean, views=tuple(views))


def fitted(
    detections: Detections, base: str, model: tuple[str, str], near: StepOneFit | None
) -> tuple[StepOneFit, Scatter]:
    """A camera and how it scatters.

    Args:
        near: a fit of the same photographs to start from.
    """
    fit = fit_step_one(fit_flat(detections, lens=base), shape=model[0], first_lens=model[1], near=near)
    known = linearised(fit)
    return fit, scatter_of(known, leave_one_out(known), detections.target.points)


def predicted(scatter: Scatter, places: np.ndarray, seen: np.ndarray, distance: float) -> np.ndarray:
    """The variance of the image of some places, px^2, a motion fitted out over the seen rays.

    Args:
        places: along rays, in units of the distance.
        distance: of what was seen, metres.
    """
    every, rows = np.concatenate([seen, places]), 2 * len(seen)
    slopes = image_slopes(scatter.camera, every, scatter.names)
    motion = motion_slopes(scatter.camera, every, distance)
    fitting = motion[: len(seen)].reshape(rows, -1)
    undone = np.linalg.lstsq(fitting, slopes[: len(seen)].reshape(rows, -1), rcond=None)[0]
    left = (slopes - motion @ undone)[len(seen) :]
    return ((left @ scatter.repeated) * left).sum((1, 2))


def seen_from(distance: float) -> tuple[float, float]:
    """Where a motion is fitted out for things at a distance, and their distance in units of it."""
    return (np.inf, 1.0) if np.isinf(distance) else (TYPICAL, distance / TYPICAL)


@with_one_thread
def study(base: str, model: tuple[str, str], board: tuple[int, int], views: int, draws: int) -> str:
    """One line of ratios, predicted over sampled."""
    camera, rng = CAMERAS[base], np.random.default_rng(views)
    target = chessboard(*board, SIZE / (board[0] - 1))
    poses = random_views(camera, target, views, rng=np.random.default_rng(0))
    clean = simulate_detections(Scene(camera, target, poses), noise_px=0.0, rng=rng)
    seen = camera.unproject(seen_places(np.concatenate([view.pixels for view in clean.views])))
    rays = camera.unproject(np.array(PLACES) * np.array(camera.image_size) - 0.5)
    values, said, off, told = [], [], [], []
    names: tuple[str, ...] = ()
    near: StepOneFit | None = None
    for _ in range(draws):
        fit, scatter = fitted(taken_again(clean, rng), base, model, near)
        near = near or fit
        names, lens = scatter.names, scatter.camera.lens
        coefficients = dict(zip(lens.names(), lens.coefficients, strict=True))
        K = scatter.camera.intrinsics.as_tuple()[:4]
        values.append([*K, *(coefficients[name] for name in names[4:])])
        said.append(np.diag(scatter.repeated)[: len(names)])
        wanted = [seen_from(distance) for distance in DISTANCES]
        off.append(
            [difference_of_images(camera, scatter.camera, n * rays, seen, distance=d) for d, n in wanted]
        )
        told.append([predicted(scatter, n * rays, seen, d) for d, n in wanted])
    deviations = np.sqrt(np.mean(said, axis=0)) / np.std(values, axis=0)
    image = np.sqrt(np.mean(told, axis=0) / np.var(off, axis=0).sum(-1))
    named = ", ".join(f"{name} {ratio:.2f}" for name, ratio in zip(names[:8], deviations, strict=False))
    placed = " | ".join(" ".join(f"{ratio:.2f}" for ratio in row) for row in image)
    return f"{named} | {placed}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table, line by line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--only", default="", help="a part of `brown, flat, formula` and the like")
    parser.add_argument("--views", type=int, nargs="*", default=VIEWS)
    parser.add_argument("--board", nargs="*", default=["x".join(map(str, board)) for board in BOARDS])
    asked = parser.parse_args(arguments)
    far, *near = ("far away" if np.isinf(distance) else f"{distance:g} m" for distance in DISTANCES)
    heads = ("model", "board", "views", "parameters", f"middle, edge, corner {far}", *near)
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for base, name in product(CAMERAS, MODELS):
        if asked.only not in f"{base}, {name}":
            continue
        for board in asked.board:
            columns, rows = (int(count) for count in board.split("x"))
            for views in asked.views:
                found = study(base, MODELS[name], (columns, rows), views, asked.draws)
                print(f"| {base}, {name} | {board} | {views} | {found} |", flush=True)


if __name__ == "__main__":
    main()
