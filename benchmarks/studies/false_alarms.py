"""How often photographs with which nothing is wrong are blamed, test by test.

    python -m benchmarks.studies.false_alarms --seeds 2 [--views 5 8]

Perfect photographs (worlds.py: a camera that is not this project's, a true board, white noise), 5 to 30 of
them, two boards, three lenses, by the default method and by `fccm` with the lens's own formula.  Every test
that a verdict rests on is asked by itself, whether or not the verdict would have named it.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from benchmarks.studies.projectors import Projector
from benchmarks.studies.scenarios import FISHEYE, USUAL, WIDE
from benchmarks.studies.worlds import Recipe, made
from orthoscope import Detections, View, chessboard
from orthoscope.evaluation.evaluate import examine
from orthoscope.evaluation.verdict.causes import CAUSES
from orthoscope.evaluation.verdict.facts import situation_of
from orthoscope.methods import calibrate

__all__ = ["VIEWS", "blamed"]

VIEWS = (5, 8, 15, 30)
BOARDS = ((9, 6, 0.025), (14, 10, 0.02))
LENSES: dict[str, Projector] = {"brown": USUAL.camera, "kannala_brandt": WIDE, "fisheye": FISHEYE}
METHODS = ("decoupled", "fccm")
# Causes that something is wrong; the others say that something is missing.
FAULTS = ("photographs", "lens", "target", "corners", "views")


def blamed(recipe: Recipe, seed: int, **settings: str) -> set[str]:
    """The faults that are found in a world.

    Args:
        settings: of `calibrate`.
    """
    world = made(recipe, seed)
    views = tuple(View(*photograph) for photograph in world.photographs)
    detections = Detections(chessboard(*recipe.board), recipe.camera.size, views)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        situation = situation_of(examine(calibrate(detections, **settings)))
    return {cause.name for cause in CAUSES if cause.name in FAULTS and cause.holds(situation)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each method and number of views."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=2, help="of each board and lens: six sets")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--views", type=int, nargs="*", default=VIEWS)
    asked = parser.parse_args(arguments)
    print(f"| method | views | sets | {' | '.join(FAULTS)} | any |\n|{'---|' * (4 + len(FAULTS))}")
    any_of_all, sets = 0, 0
    for method, count in product(METHODS, asked.views):
        found: Counter[str] = Counter()
        for (lens, camera), board, seed in product(LENSES.items(), BOARDS, range(asked.seeds)):
            standing = replace(USUAL.standing, count=count, fill=(0.3, 0.6))
            recipe = replace(USUAL, camera=camera, board=board, standing=standing)
            formula = "kannala_brandt" if camera.fisheye else lens
            settings = {"method": method} | ({"lens": formula} if method == "fccm" else {})
            faults = blamed(recipe, 1000 + asked.first + seed, **settings)
            found.update(faults)
            found["any"] += bool(faults)
        of = len(LENSES) * len(BOARDS) * asked.seeds
        shares = " | ".join(f"{100 * found[fault] / of:.1f} %" for fault in (*FAULTS, "any"))
        print(f"| {method} | {count} | {of} | {shares} |", flush=True)
        any_of_all, sets = any_of_all + found["any"], sets + of
    error = 100 * np.sqrt(max(any_of_all, 1)) / sets
    print(f"\nAny in {any_of_all} of {sets}: {100 * any_of_all / sets:.1f} ± {error:.1f} %")


if __name__ == "__main__":
    main()
