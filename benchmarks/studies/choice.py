"""Rules of choice beside each other, where the true camera is known: boards, poses and noise like real ones.

    ORTHOSCOPE_DATASETS=photographs python -m benchmarks.studies.choice 60 [alike]

Worlds are fits of real sets, taken as truth: poses, which corners were seen, the camera (its free lens or its
formula) and the board's shape.
From these, photographs with white noise, and in each case something more: `board` a stretch and a sag,
`alike` errors alike within a view, `bend` a board that bends from view to view, `breath` a focal length that
breathes, `rolling` rows that shear.  Every base, shape and lens is fitted; printed is, for each rule, the
true camera error of what it takes over that of the best base, shape and lens, with the mean's standard error.
The best of eighteen is lucky, and nobody can know it: beside the rules stand the very model that the
photographs were made by, the entry that is best over all sets, and each rule over the first of these.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.real_sets import classic_corners
from orthoscope.evaluation.camera_error import predicted_error, rms_difference, seen_places
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.methods.decoupled.candidates import Candidates, Model
from orthoscope.methods.decoupled.model import BASES
from orthoscope.methods.decoupled.model_selection import (
    Contender,
    first_as_good,
    richest_unless_worse,
    simplest_as_good,
)
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import SHAPES, polynomials
from orthoscope.targets.detections import Detections, View

WORLDS = {
    "opencv-left": "brown",
    "udacity": "brown",
    "sony": "brown",
    "calibrel": "brown",
    "fisheye-180": "kannala_brandt",
}
CASES = ("perfect", "board", "alike", "bend", "breath", "rolling")
ALIKE = {2: 12.0, 3: 4.0, 4: 1.8}  # times independent noise, by the order of a pattern over the board
MODELS = list(product(SHAPES, ("formula", "free")))


class Tried(NamedTuple):
    """A model with its contender, its camera and the places by which it is compared; what it was said to be
    off by and what it is off by, px.
    """

    model: Model
    contender: Contender
    camera: Camera
    seen: np.ndarray
    predicted: float
    true: float


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


def tried(photographs: Detections, truth: Model, world: Candidates) -> list[Tried]:
    """Every model of every base that can be fitted."""
    candidates, true = Candidates(photographs, skew=False), world.camera(truth)[0]
    seen, found = seen_places(np.concatenate([view.pixels for view in photographs.views])), []
    for base in BASES:
        try:
            candidates.flat(base)
        except CalibrationError:
            continue
        richest = Model(base, "free", "free")
        for shape, through in MODELS:
            model = Model(base, shape, through)
            contender = candidates.contender(model)
            if np.isnan(contender.squares).all():
                continue
            error = predicted_error(
                candidates.scatter(model),
                seen,
                distance=1.0,
                richest=None if model == richest else candidates.scatter(richest),
            )
            camera = candidates.camera(model)[0]
            off = rms_difference(camera, true, seen)
            found.append(Tried(model, contender, camera, seen, error.seen_px, off))
    return found


def base_first(rule: Callable) -> Callable:
    """The base by its richest model, then a rule among its models."""

    def choose(entries: list[Tried], corners: np.ndarray) -> Tried:
        rich = [entry for entry in entries if entry.model[1:3] == ("free", "free")]
        base = rich[first_as_good([entry.contender for entry in rich], corners)].model.base
        of_base = [entry for entry in entries if entry.model.base == base]
        return of_base[rule([entry.contender for entry in of_base], corners)]

    return choose


def in_the_middle(entries: list[Tried], corners: np.ndarray) -> Tried:
    """The camera nearest, in the mean square, to all that may be right: each counts exp(-z^2 / 2) where
    it loses z standard errors against the best.
    """
    logs = np.array([np.log(entry.contender.squares / corners) for entry in entries])
    able = np.isfinite(logs).all(1) if np.isfinite(logs).all(1).any() else np.ones(len(logs), dtype=bool)
    lost = logs - logs[np.argmin(np.where(able, logs.mean(1), np.inf))]
    error = np.maximum(lost.std(1) / np.sqrt(len(corners) - 1), 1e-12)
    weights = np.where(able, np.exp(-0.5 * (lost.mean(1) / error) ** 2), 0.0)
    apart = np.array([[rms_difference(a.camera, b.camera, a.seen) for b in entries] for a in entries])
    return entries[int(np.argmin(apart**2 @ weights))]


# What the default method does.
OURS = "base first, then the richest unless worse"
# Nobody can take it, since nobody knows it.
MADE_BY = "the model that the photographs were made by"
RULES: dict[str, Callable] = {
    OURS: base_first(richest_unless_worse),
    "base first, then the simplest as good": base_first(simplest_as_good),
    "the lowest of all": lambda entries, corners: entries[
        int(np.argmin([np.log(entry.contender.squares / corners).mean() for entry in entries]))
    ],
    "in the middle of all that may be right": in_the_middle,
    "the lowest predicted error": lambda entries, corners: min(entries, key=lambda entry: entry.predicted),
}


def in_words(ratios: list[float]) -> str:
    """The geometric mean with its standard error, and what nine of ten are below."""
    logs = np.log(ratios)
    mean, error = np.exp(logs.mean()), np.exp(logs.mean()) * logs.std() / np.sqrt(max(len(logs) - 1, 1))
    return f"{mean:.2f} ± {error:.2f}, nine of ten below {np.percentile(ratios, 90):.1f}"


def main(folder: Path, sets: int, only: str = "") -> None:
    """Print a line for each set of photographs, and what each rule gives.

    Args:
        only: a case; the others are left out.
    """
    ratios: dict[str, list[float]] = {name: [] for name in (*RULES, MADE_BY)}
    by_entry: dict[tuple[str, ...], list[float]] = {}
    honest: list[tuple[str, int, float]] = []
    for seed in range(sets):
        rng = np.random.default_rng(seed)
        name = list(WORLDS)[rng.integers(len(WORLDS))]
        case, photographs, truth, world = drawn(classic_corners(folder, name), WORLDS[name], rng)
        wanted = len(photographs.views) >= 4 and only in ("", case)
        entries = tried(photographs, truth, world) if wanted else []
        if not entries:
            continue
        corners = np.array([len(view.ids) for view in photographs.views], dtype=float)
        best = min(entry.true for entry in entries)
        for rule, choose in RULES.items():
            ratios[rule].append(choose(entries, corners).true / best)
        found = {entry.model[:3]: entry.true / best for entry in entries}
        ratios[MADE_BY].append(found[truth[:3]])
        for entry, ratio in found.items():
            by_entry.setdefault(entry, []).append(ratio)
        taken = RULES[OURS](entries, corners)
        honest.append((case, len(photographs.views), taken.predicted / taken.true))
        told = f"{seed:3d} {name:12s} {case:8s} {len(photographs.views):2d} views"
        print(f"{told}  {taken.model.base} {taken.true:.3f} px", flush=True)
    for rule, found in ratios.items():
        print(f"{rule:45s} {in_words(found)}")
    always = min(
        (entry for entry, found in by_entry.items() if len(found) == len(honest)),
        key=lambda entry: np.mean(np.log(by_entry[entry])),
    )
    print(f"{'always ' + ', '.join(always):45s} {in_words(by_entry[always])}")
    print(f"\nover {MADE_BY}")
    for rule in RULES:
        over = [ours / made for ours, made in zip(ratios[rule], ratios[MADE_BY], strict=True)]
        print(f"{rule:45s} {in_words(over)}")
    print("\npredicted over true, and how often the true error is above twice the predicted one")
    groups = {case: [r for of, _, r in honest if of == case] for case in CASES}
    groups |= {
        f"{low} to {high} views": [r for _, m, r in honest if low <= m <= high]
        for low, high in ((4, 6), (7, 10), (11, 30))
    }
    for name, found in (groups | {"all": [r for *_, r in honest]}).items():
        if found:
            mean, beyond = np.exp(np.mean(np.log(found))), np.mean(np.array(found) < 0.5)
            print(f"{name:16s} {mean:.2f}, {beyond:.0%} of {len(found)}")


if __name__ == "__main__":
    asked = sys.argv[1:]
    main(Path(os.environ["ORTHOSCOPE_DATASETS"]), int(asked[0]) if asked else 30, *asked[1:])
