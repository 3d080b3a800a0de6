"""Photographs by cameras that are not this project's (projectors.py), of boards shaped as real ones are: from
a telephoto lens to a fisheye of 180 degrees, 8 to 40 views, with errors alike within a view.
"""

from __future__ import annotations

import numpy as np

from benchmarks.studies.projectors import Projector
from benchmarks.studies.standing import Standing
from benchmarks.studies.worlds import Recipe

__all__ = ["recipe_for"]

SIZE = (640, 480)
# Focal length, pixels, with the share by which it varies; coefficients of the lens, with the share by which
# they do; whether they are those of the fisheye.
LENSES: dict[str, tuple[float, float, tuple[float, ...], float, bool]] = {
    "narrow": (1100.0, 0.2, (-0.15, 0.3, 3e-4, 3e-4, 0.0), 0.5, False),
    "usual": (560.0, 0.1, (-0.28, 0.09, 5e-4, -5e-4, 0.0), 0.2, False),
    "rational": (480.0, 0.05, (0.35, -0.08, 4e-4, 3e-4, 0.002, 0.62, -0.05, 0.004), 0.0, False),
    "120 degrees": (290.0, 0.05, (-0.02, 0.004, -0.001, 0.0), 0.5, True),
    "150 degrees": (245.0, 0.03, (0.02, -0.004, 0.001, -0.0002), 0.5, True),
    "180 degrees": (205.0, 0.02, (0.03, -0.006, 0.001, -0.0002), 0.3, True),
}
BOARDS = ((9, 6, 0.025), (11, 8, 0.02), (14, 9, 0.02))
VIEWS = (8, 11, 15, 20, 30, 40)
# Shares of the board's size, as found on real ones: surfaces up to so much, half of the boards each.
SURFACES = {"sag": 1.4e-3, "bend": 1.4e-3, "wave": 0.7e-3}
STRETCH_DEVIATION = 1.4e-3
SINGLES = (0.5e-4, 3e-4)
NOISE_PX = (0.03, 0.15)
# Smooth errors that a view shares are up to so many times the corners' own noise.
MOST_ALIKE = 1.0


def recipe_for(seed: int) -> tuple[str, Recipe]:
    """What is photographed and by what: the lens's name, the rest; the same for the same seed."""
    rng = np.random.default_rng([seed, 777])
    name = list(LENSES)[rng.integers(len(LENSES))]
    focal, focal_share, coefficients, share, fisheye = LENSES[name]
    focal *= 1.0 + focal_share * rng.normal()
    camera = Projector(
        SIZE,
        (focal, focal * (1.0 + 0.003 * rng.normal())),
        (325.0 + 8.0 * rng.normal(), 237.0 + 8.0 * rng.normal()),
        tuple(float(k * (1.0 + share * rng.normal())) for k in coefficients),
        fisheye=fisheye,
    )
    noise = float(rng.uniform(*NOISE_PX))
    shape = {kind: most * float(rng.uniform()) * int(rng.integers(2)) for kind, most in SURFACES.items()}
    shape |= {"stretch": abs(float(rng.normal(0.0, STRETCH_DEVIATION))), "singles": rng.uniform(*SINGLES)}
    return name, Recipe(
        camera=camera,
        board=BOARDS[rng.integers(len(BOARDS))],
        standing=Standing(count=int(rng.choice(VIEWS)), fill=(0.3, 0.6) if focal < 250.0 else (0.4, 0.8)),
        noise=noise,
        alike=noise * MOST_ALIKE * float(rng.uniform()),
        shape=shape,
    )
