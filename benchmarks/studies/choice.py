"""Rules of choice beside each other, where the true camera is known: boards, poses and noise like real ones.

    ORTHOSCOPE_DATASETS=photographs python -m benchmarks.studies.choice 150 [--only alike]
    python -m benchmarks.studies.choice 100 --independent

Photographs are those of resimulated.py, or of independent.py.  Every base, shape and lens is fitted; printed
is, for each rule, the true camera error of what it takes over that of the best in its own table, which is all
that it tries, and over the best of all eighteen, with the mean's standard error, and the error itself.  The
best of many is lucky, and nobody can know it: beside the rules stand the very model that the photographs were
made by, and the entry that is best over all sets.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.real_sets import classic_corners
from benchmarks.studies.independent import recipe_for
from benchmarks.studies.resimulated import WORLDS, drawn
from benchmarks.studies.worlds import made, true_error
from orthoscope.evaluation.camera_error import predicted_error, rms_difference, seen_places
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.methods.decoupled.candidates import Candidates, Model
from orthoscope.methods.decoupled.model import BASES
from orthoscope.methods.decoupled.model_selection import (
    Contender,
    first_as_good,
    richest_unless_worse,
    simplest_as_good,
)
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import SHAPES
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

MODELS = list(product(SHAPES, ("formula", "free")))
SIMPLEST, RICHEST = MODELS[0], MODELS[-1]
FEWEST_VIEWS = 4
# Groups that are told of one by one.
VIEWS = ((4, 6), (7, 10), (11, 40), (8, 40))


class Set(NamedTuple):
    """Photographs and their truth.

    Attributes:
        case: what was wrong, or the kind of lens.
        off: how far a camera is from the true one at some pixels of its image, rms px.
        model: that the photographs were made by; None where it is none of the project's.
    """

    case: str
    photographs: Detections
    off: Callable[[Camera, np.ndarray], float]
    model: Model | None


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

    @property
    def kind(self) -> tuple[str, str]:
        """Shape and lens, whatever the base."""
        return self.model.shape, self.model.first_lens


def resimulated(folder: Path, seed: int) -> Set:
    """Photographs like those of a real set."""
    rng = np.random.default_rng(seed)
    name = list(WORLDS)[rng.integers(len(WORLDS))]
    case, photographs, model, world = drawn(classic_corners(folder, name), WORLDS[name], rng)
    true = world.camera(model)[0]
    return Set(case, photographs, lambda camera, seen: rms_difference(camera, true, seen), model)


def independent(seed: int) -> Set:
    """Photographs by a camera that is not this project's."""
    name, recipe = recipe_for(seed)
    world = made(recipe, seed)
    views = tuple(View(photo.image, photo.ids, photo.pixels) for photo in world.photographs)
    photographs = Detections(chessboard(*recipe.board), recipe.camera.size, views)
    return Set(name, photographs, lambda camera, at: true_error(world, at, camera.unproject(at)), None)


def tried(of: Set) -> list[Tried]:
    """Every model of every base that can be fitted."""
    candidates = Candidates(of.photographs, skew=False)
    seen, found = seen_places(np.concatenate([view.pixels for view in of.photographs.views])), []
    for base in BASES:
        try:
            candidates.flat(base)
        except CalibrationError:
            continue
        richest = Model(base, *RICHEST)
        for kind in MODELS:
            model = Model(base, *kind)
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
            found.append(Tried(model, contender, camera, seen, error.seen_px, of.off(camera, seen)))
    return found


class Rule(NamedTuple):
    """The base by its richest model, then a rule among some kinds of model on it."""

    among: Sequence[tuple[str, str]]
    choose: Callable[[Sequence[Contender], np.ndarray], int]

    def table(self, entries: list[Tried], corners: np.ndarray) -> tuple[list[Tried], Tried]:
        """All that it tries, and what it takes."""
        rich = [entry for entry in entries if entry.kind == RICHEST]
        base = rich[first_as_good([entry.contender for entry in rich], corners)].model.base
        of_base = [entry for entry in entries if entry.model.base == base and entry.kind in self.among]
        taken = of_base[self.choose([entry.contender for entry in of_base], corners)]
        return [*(entry for entry in rich if entry not in of_base), *of_base], taken


class OfAll(NamedTuple):
    """One of all entries, whatever their base."""

    choose: Callable[[list[Tried], np.ndarray], Tried]

    def table(self, entries: list[Tried], corners: np.ndarray) -> tuple[list[Tried], Tried]:
        """As of `Rule`."""
        return entries, self.choose(entries, corners)


def logarithms(entry: Tried, corners: np.ndarray) -> np.ndarray:
    """Of each view's mean squared error."""
    return np.log(entry.contender.squares / corners)


def lowest(entries: list[Tried], corners: np.ndarray) -> Tried:
    """The least held-out error."""
    return min(entries, key=lambda entry: np.nan_to_num(logarithms(entry, corners).mean(), nan=np.inf))


def in_the_middle(entries: list[Tried], corners: np.ndarray) -> Tried:
    """The camera nearest, in the mean square, to all that may be right: each counts exp(-z^2 / 2) where
    it loses z standard errors against the best.
    """
    logs = np.array([logarithms(entry, corners) for entry in entries])
    able = np.isfinite(logs).all(1) if np.isfinite(logs).all(1).any() else np.ones(len(logs), dtype=bool)
    lost = logs - logs[np.argmin(np.where(able, logs.mean(1), np.inf))]
    error = np.maximum(lost.std(1) / np.sqrt(len(corners) - 1), 1e-12)
    weights = np.where(able, np.exp(-0.5 * (lost.mean(1) / error) ** 2), 0.0)
    apart = np.array([[rms_difference(a.camera, b.camera, a.seen) for b in entries] for a in entries])
    return entries[int(np.argmin(apart**2 @ weights))]


# What the default method does.
OURS = "base, then the richest or the simplest"
RULES: dict[str, Rule | OfAll] = {
    OURS: Rule((SIMPLEST, RICHEST), richest_unless_worse),
    "base, its richest": Rule((RICHEST,), richest_unless_worse),
    "base, then the richest of six unless worse": Rule(MODELS, richest_unless_worse),
    "base, then the simplest of six as good": Rule(MODELS, simplest_as_good),
    "the lowest of all": OfAll(lowest),
    "in the middle of all that may be right": OfAll(in_the_middle),
    "the lowest predicted error": OfAll(lambda entries, _: min(entries, key=lambda entry: entry.predicted)),
}


def in_words(ratios: Sequence[float]) -> str:
    """The geometric mean with its standard error, and what nine of ten are below."""
    logs = np.log(ratios)
    mean, error = np.exp(logs.mean()), np.exp(logs.mean()) * logs.std() / np.sqrt(max(len(logs) - 1, 1))
    return f"{mean:.2f} ± {error:.2f} {np.percentile(ratios, 90):5.1f}"


class Found(NamedTuple):
    """What a rule took from one set, px: its true error, the least of its table and of all, and the predicted
    one.
    """

    true: float
    best_tried: float
    best: float
    predicted: float


def line(name: str, found: Sequence[Found]) -> str:
    """A rule's figures."""
    own, of_all = [one.true / one.best_tried for one in found], [one.true / one.best for one in found]
    error = np.exp(np.mean(np.log([one.true for one in found])))
    return f"{name:45s} {in_words(own):>18s}   {in_words(of_all):>18s}   {error:.4f} px"


def sets(folder: Path | None, count: int, only: str) -> Iterator[tuple[int, Set]]:
    """Those that are asked for and have views enough; folder None: independent ones."""
    for seed in range(count):
        of = independent(seed) if folder is None else resimulated(folder, seed)
        if len(of.photographs.views) >= FEWEST_VIEWS and only in ("", of.case):
            yield seed, of


def main(folder: Path | None, count: int, only: str) -> None:
    """Print a line for each set of photographs, and what each rule gives."""
    found: dict[str, list[Found]] = {name: [] for name in RULES}
    made_by: list[float] = []
    by_entry: dict[tuple[str, ...], list[float]] = {}
    about: list[tuple[str, int]] = []
    for seed, of in sets(folder, count, only):
        entries = [entry for entry in tried(of) if np.isfinite(entry.true)]
        if not entries:
            continue
        views = of.photographs.views
        corners = np.array([len(view.ids) for view in views], dtype=float)
        best = min(entry.true for entry in entries)
        for name, rule in RULES.items():
            table, taken = rule.table(entries, corners)
            found[name].append(Found(taken.true, min(e.true for e in table), best, taken.predicted))
        for entry in entries:
            by_entry.setdefault(entry.model[:3], []).append(entry.true / best)
            if of.model and entry.model[:3] == of.model[:3]:
                made_by.append(entry.true / best)
        about.append((of.case, len(views)))
        print(f"{seed:3d} {of.case:12s} {len(views):2d} views  {found[OURS][-1].true:.3f} px", flush=True)
    print(f"{'':45s} over the best tried   over the best of all; nine of ten are below")
    for name in RULES:
        print(line(name, found[name]))
    if made_by:
        print(f"{'the model that the photographs were made by':45s} {'':18s}   {in_words(made_by):>18s}")
    often = {entry: ratios for entry, ratios in by_entry.items() if len(ratios) == len(about)}
    for entry in sorted(often, key=lambda entry: np.mean(np.log(often[entry])))[:1]:
        print(f"{'always ' + ', '.join(entry):45s} {'':18s}   {in_words(often[entry]):>18s}")
    print(
        "\nwhat the default takes; predicted over true, how often the true error is above twice the predicted"
    )
    ours = list(zip(about, found[OURS], strict=True))
    groups = {case: [one for (of, _), one in ours if of == case] for case in sorted({of for of, _ in about})}
    groups |= {
        f"{low} to {high} views": [one for (_, m), one in ours if low <= m <= high] for low, high in VIEWS
    }
    for name, some in (groups | {"all": found[OURS]}).items():
        if some:
            ratio = np.array([one.predicted / one.true for one in some])
            honest = f"{np.exp(np.log(ratio).mean()):.2f}, {np.mean(ratio < 0.5):.0%} of {len(some)}"
            print(f"{line(name, some)}   {honest}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("count", type=int, nargs="?", default=30)
    parser.add_argument("--only", default="", help="a case")
    parser.add_argument("--independent", action="store_true")
    asked = parser.parse_args()
    main(None if asked.independent else Path(os.environ["ORTHOSCOPE_DATASETS"]), asked.count, asked.only)
