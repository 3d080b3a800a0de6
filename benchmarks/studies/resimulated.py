"""Photographs like those of real sets: fits of these are taken as truth, and photographed again.

Of a set are kept its poses, which corners were seen, the camera (its free lens or its formula) and the
board's shape. From these, photographs with white noise, and in each of CASES something more: `board` a
stretch and a sag, `alike` errors alike within a view, `bend` a board that bends from view to view, `breath` a
focal length that breathes, `rolling` rows that shear.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.methods.decoupled.candidates import Candidates, Model
from orthoscope.models.target_shape import polynomials
from orthoscope.targets.detections import Detections, View

__all__ = ["CASES", "WORLDS", "drawn"]

# Sets, and the base formula of their truth.
WORLDS = {
    "opencv-left": "brown",
    "udacity": "brown",
    "sony": "brown",
    "calibrel": "brown",
    "fisheye-180": "kannala_brandt",
}
CASES = ("perfect", "board", "alike", "bend", "breath", "rolling")
ALIKE = {2: 12.0, 3: 4.0, 4: 1.8}  # times independent noise, by the order of a pattern over the board


def drawn(
    detections: Detections, base: str, rng: np.random.Generator
) -> tuple[str, Detections, Model, Candidates]:
    """One set of photographs of a world: the case, the photographs, and the truth's model among its
    candidates.
    """
    world = Candidates(detections, skew=False)
    truth = Model(base, "free", "free" if rng.uniform() < 0.6 else "formula")
    fit, case = world.step_one(truth), CASES[rng.integers(len(CASES))]
    points, camera = detections.target.points, fit.estimate.camera
    seen, size = np.ones(len(points), dtype=bool), float(np.ptp(points[:, :2]))
    shape = np.zeros_like(points)
    if case != "perfect":
        shape = fit.shape.displacements.copy()
        middle, (a, b, c) = points - points.mean(0), rng.normal(0.0, 0.0014, 3)
        shape[:, 0] += a * middle[:, 0] + b * middle[:, 1]
        shape[:, 1] += c * middle[:, 1]
    patterns = {order: polynomials(points, seen, orders=(order,)) for order in ALIKE}
    sigma = float(np.clip(np.sqrt(fit.evidence.noise), 0.03, 0.15))
    views, chosen = [], rng.permutation(len(detections.views))[: int(rng.choice([5, 8, 15, 30]))]
    for number, i in enumerate(chosen):
        ids, rotation = detections.views[i].ids, fit.estimate.poses.rotation[i]
        translation = fit.estimate.poses.translation[i]
        turned = rotation_from_vector(rng.normal(0.0, 0.04, (1, 3)))[0] @ rotation
        middle = rotation @ points.mean(0) + translation
        translation = middle * rng.uniform(0.93, 1.07) - turned @ points.mean(0)
        bent, lens = shape.copy(), camera
        if case == "bend":
            bent[:, 2] += patterns[2] @ rng.normal(0.0, 0.0006 * size, patterns[2].shape[1])
        if case == "breath":
            K, larger = camera.intrinsics, 1.0 + rng.normal(0.0, 0.003)
            lens = replace(camera, intrinsics=replace(K, fx=larger * K.fx, fy=larger * K.fy))
        pixels = lens.project(((points + bent) @ turned.T + translation)[ids])
        if case == "rolling":
            pixels = pixels + np.outer(pixels[:, 1] - camera.intrinsics.cy, rng.normal(0.0, 1e-3, 2))
        pixels = pixels + sigma * rng.standard_normal(pixels.shape)
        if case == "alike":
            for order, tau in ALIKE.items():
                rows = patterns[order][ids] / np.sqrt(len(ids))
                pixels = pixels + rows @ rng.normal(0.0, sigma * np.sqrt(tau - 1.0), (rows.shape[1], 2))
        size_px = np.array(detections.image_size, dtype=float)
        inside = np.isfinite(pixels).all(1) & (pixels > -0.5).all(1) & (pixels < size_px - 0.5).all(1)
        if inside.sum() >= max(8, len(ids) // 2):
            views.append(View(f"{number:02d}", ids[inside], pixels[inside]))
    return case, Detections(detections.target, detections.image_size, tuple(views)), truth, world
