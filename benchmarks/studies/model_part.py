"""The model's own part of the camera error, predicted over sampled: perfect data, the same photographs taken
again.

    python -m benchmarks.studies.model_part 200

prints, for each method and camera, the ratio of what is predicted to what is found over so many draws of the
corners' noise: the deviations of fx, fy, cx, cy and the first coefficients, and the image far away and at two
distances.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from orthoscope.evaluation.camera_error import predicted_error, rms_difference, seen_places
from orthoscope.fitting.leave_one_out import leave_one_out
from orthoscope.fitting.scatter import Scatter, scatter_of
from orthoscope.methods.decoupled.step_one import fit_step_one
from orthoscope.methods.decoupled.step_one_linearised import linearised
from orthoscope.methods.fccm import fit_flat
from orthoscope.models.camera import Camera, Intrinsics
from orthoscope.models.lenses import Brown, KannalaBrandt
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections
from orthoscope.targets.target import chessboard

NOISE = 0.1  # px
DISTANCES = (np.inf, 0.5, 2.0)  # metres
CAMERAS = {
    "brown": Camera(
        (640, 480), Intrinsics(520.0, 524.0, 325.0, 236.0), Brown(k1=-0.28, k2=0.09, p1=1e-3, p2=-6e-4)
    ),
    "kannala_brandt": Camera(
        (640, 480), Intrinsics(205.0, 206.0, 318.0, 242.0), KannalaBrandt(k1=-0.02, k2=0.003, k3=-0.002)
    ),
}
MODELS = {"flat, formula": ("flat", "formula"), "free, free": ("free", "free")}


def taken_again(clean: Detections, rng: np.random.Generator) -> Detections:
    """The same photographs with other noise."""
    views = [
        replace(view, pixels=view.pixels + NOISE * rng.standard_normal(view.pixels.shape))
        for view in clean.views
    ]
    return replace(clean, views=tuple(views))


def fitted(detections: Detections, base: str, model: tuple[str, str]) -> Scatter:
    """A camera and how it scatters."""
    known = linearised(fit_step_one(fit_flat(detections, lens=base), shape=model[0], first_lens=model[1]))
    return scatter_of(known, leave_one_out(known), detections.target.points)


def study(base: str, model: tuple[str, str], views: int, draws: int) -> str:
    """One line of ratios, predicted over sampled."""
    camera, target, rng = CAMERAS[base], chessboard(9, 6, 0.025), np.random.default_rng(views)
    poses = random_views(camera, target, views, rng=np.random.default_rng(0))
    clean = simulate_detections(Scene(camera, target, poses), noise_px=0.0, rng=rng)
    seen = seen_places(np.concatenate([view.pixels for view in clean.views]))
    values, said, image, told = [], [], [], []
    names: tuple[str, ...] = ()
    for _ in range(draws):
        scatter = fitted(taken_again(clean, rng), base, model)
        names, lens = scatter.names, scatter.camera.lens
        K = scatter.camera.intrinsics
        coefficients = dict(zip(lens.names(), lens.coefficients, strict=True))
        values.append([*K.as_tuple()[:4], *(coefficients[name] for name in names[4:])])
        said.append(np.diag(scatter.model)[: len(names)])
        image.append(
            [rms_difference(scatter.camera, camera, seen, distance=distance) for distance in DISTANCES]
        )
        told.append(
            [predicted_error(scatter, seen, distance=distance).model_px for distance in DISTANCES[:1]]
        )
    deviations = np.sqrt(np.mean(said, axis=0)) / np.std(values, axis=0)
    far = np.sqrt(np.mean(np.square(told))) / np.sqrt(np.mean(np.square(image), axis=0))[0]
    named = "  ".join(f"{name} {ratio:.2f}" for name, ratio in zip(names[:8], deviations, strict=False))
    return f"{named}  image, far {far:.2f}"


if __name__ == "__main__":
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    for base in CAMERAS:
        for name, model in MODELS.items():
            for views in (8, 20):
                print(
                    f"{base:15s} {name:14s} {views:2d} views  {study(base, model, views, sets)}", flush=True
                )
