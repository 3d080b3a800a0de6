"""The studies' worlds (benchmarks/studies) for tests: photographs made by cameras that are not this
project's.
"""

from __future__ import annotations

import sys
from pathlib import Path

from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.methods.decoupled.candidates import Candidates, Model
from orthoscope.models.lenses.table import FREE
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # benchmarks/ stands beside src/ and is no part of the package

from benchmarks.studies.worlds import Recipe, World, made  # noqa: E402

__all__ = ["ROOT", "found_in", "photographs_by", "richest_fit"]


def found_in(world: World) -> Detections:
    """What a detector found in a world's photographs."""
    views = tuple(View(photo.image, photo.ids, photo.pixels) for photo in world.photographs)
    return Detections(chessboard(*world.recipe.board), world.recipe.camera.size, views)


def photographs_by(recipe: Recipe, seed: int = 0) -> Detections:
    """What a detector found in the photographs of a recipe."""
    return found_in(made(recipe, seed))


def richest_fit(detections: Detections, base: str = "brown") -> Linearised:
    """Every corner free and a free lens."""
    return Candidates(detections, skew=False).linearised(Model(base, "free", FREE))
