"""What must be true of every lens: the lenses to try, and rays all over a lens's domain.

`LENSES_TO_TRY` has every name in LENSES as it comes, mild, strong and at its singular places;
`FREE_LENSES_TO_TRY` some with a displacement over them. A lens that is listed here is put through every law
by `for_every_lens`, a formula by `for_every_formula` too.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray

from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.lens import Formula, Lens
from orthoscope.models.lenses.spline import Displacement, Lattice
from orthoscope.models.lenses.table import (
    Brown,
    Division,
    DoubleSphere,
    Eucm,
    Fet,
    Fov,
    KannalaBrandt,
    Pfet,
    Rational,
    Stereographic,
)

__all__ = [
    "FREE_LENSES_TO_TRY",
    "LENSES_TO_TRY",
    "WIDE",
    "barrel",
    "directions",
    "displaced",
    "for_every_formula",
    "for_every_lens",
    "places_over",
    "rays_over",
]

# tan(87 degrees): as far as the laws look where a lens of the plane has no end of its own; rounding grows
# with the radius
WIDE = 20.0

LENSES_TO_TRY: dict[str, Formula] = {
    "brown": Brown(),
    "brown mild": Brown(k1=-0.2, k2=0.05, p1=1e-3, p2=-5e-4, k3=-0.01),
    "brown strong": Brown(k1=-0.4, k2=0.15, p1=0.01, p2=-0.02, k3=-0.03),
    "brown pincushion": Brown(k1=0.3, k2=0.1, p1=0.01),
    "brown with a prism": Brown(k1=-0.2, k2=0.05, s1=0.01, s2=-0.005, s3=-0.02, s4=0.003),
    "brown tilted": Brown(k1=-0.3, k2=0.1, p1=0.002, p2=0.001, s1=0.01, s3=-0.02, tau_x=0.05, tau_y=-0.08),
    "rational": Rational(),
    "rational mild": Rational(k1=0.5, k2=-0.1, p1=1e-3, p2=-1e-3, k3=0.02, k4=0.8, k5=0.05, k6=0.01),
    "rational with a pole": Rational(k1=-0.3, k4=-0.5),
    "rational tilted": Rational(
        k1=-0.3, k2=0.1, p1=0.002, k4=0.1, k5=0.02, s2=-0.005, s4=0.003, tau_x=0.05, tau_y=-0.08
    ),
    "pfet": Pfet(),
    "pfet mild": Pfet(a2=-0.05, a3=0.01),
    "pfet strong": Pfet(a1=0.9, a2=-0.3, a3=0.05, a4=-0.01, a5=0.002),
    "pfet with a ring": Pfet(a0=0.05, a2=-0.1),
    "pfet with a hole": Pfet(a0=-0.05, a2=-0.1, a3=0.02),
    "fet": Fet(),
    "fet strong": Fet(scale=0.5, l=2.0),
    "fet pincushion": Fet(scale=-10.0, l=-0.1),
    "fov": Fov(),
    "fov tiny": Fov(w=1e-6),
    "fov mild": Fov(w=0.9),
    "fov strong": Fov(w=2.5),
    "division": Division(),
    "division barrel": Division(l=-0.3),
    "division pincushion": Division(l=0.1),
    "kannala_brandt": KannalaBrandt(),
    "kannala_brandt mild": KannalaBrandt(k1=-0.02, k2=0.003),
    "kannala_brandt strong": KannalaBrandt(k1=0.1, k2=-0.03, k3=0.01, k4=-0.001),
    "kannala_brandt folding": KannalaBrandt(k1=-0.2, k2=0.02, k3=-0.01, k4=0.001),
    "stereographic": Stereographic(),
    "double_sphere": DoubleSphere(),
    "double_sphere wide": DoubleSphere(xi=-0.2, alpha=0.6),
    "double_sphere mild": DoubleSphere(xi=0.3, alpha=0.2),
    "double_sphere no distortion": DoubleSphere(xi=0.0, alpha=0.0),
    "eucm": Eucm(),
    "eucm wide": Eucm(alpha=0.7, beta=0.9),
    "eucm mild": Eucm(alpha=0.2, beta=1.3),
    "eucm no distortion": Eucm(alpha=0.0),
}


def displaced(
    base: Formula, half: tuple[float, float], size: float, *, cells: tuple[int, int] = (8, 6), seed: int = 0
) -> FreeLens:
    """The lens with random coefficients of this deviation over the rectangle from -half to half of its
    distorted plane.
    """
    high = np.array(half)
    lattice = Lattice.over(-high, high, cells)
    return FreeLens(
        base, Displacement(lattice, size * np.random.default_rng(seed).standard_normal((lattice.splines, 2)))
    )


def barrel(strength: float) -> FreeLens:
    """No distortion but for a displacement of about -strength r^2 (x, y)."""
    lattice = Lattice.over(np.array([-0.8, -0.8]), np.array([0.8, 0.8]), (16, 16))
    middles = np.linspace(-0.9, 0.9, 19)  # where the splines have theirs
    places = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    return FreeLens(Brown(), Displacement(lattice, -strength * (places**2).sum(1, keepdims=True) * places))


FREE_LENSES_TO_TRY: dict[str, FreeLens] = {
    "free without displacement": displaced(Brown(k1=-0.2, k2=0.05), (0.7, 0.5), 0.0),
    "free over brown": displaced(LENSES_TO_TRY["brown mild"], (0.7, 0.5), 0.003),
    "free over kannala_brandt": displaced(
        LENSES_TO_TRY["kannala_brandt mild"], (2.0, 1.5), 0.02
    ),  # 115 degrees to either side
    "free and steep": displaced(
        Brown(k1=-0.1), (0.7, 0.5), 0.05
    ),  # slopes up to 0.6: distances shrink by half and grow as much
    "free and folding": barrel(
        1.0
    ),  # slope 1 - 3 r^2 in all directions: it ends at 0.58, well inside its lattice
}

for_every_formula = pytest.mark.parametrize("lens", LENSES_TO_TRY.values(), ids=LENSES_TO_TRY.keys())
for_every_lens = pytest.mark.parametrize(
    "lens", [*LENSES_TO_TRY.values(), *FREE_LENSES_TO_TRY.values()], ids=[*LENSES_TO_TRY, *FREE_LENSES_TO_TRY]
)


def directions(lens: Lens) -> tuple[ndarray, ndarray]:
    """Directions in the chart, radians, and the radius at which the domain ends in each (but for directions
    where that leaps).
    """
    domain = lens.domain
    if domain.symmetric:
        return np.linspace(-np.pi, np.pi, 17), np.full(17, domain.outer)
    leap = np.abs(np.diff(1.0 / domain.ends)) > 0.02 / domain.ends.min()
    smooth = ~(np.append(leap, leap[-1:]) | np.insert(leap, 0, leap[0]))
    return domain.angles[smooth], domain.ends[smooth]


def places_over(lens: Lens, *, last: float = 1.0 - 1e-4, widest: float = WIDE) -> tuple[ndarray, ndarray]:
    """Places (x, y) of the chart from the centre (but for a hole there) to the share `last` of each
    direction's end.
    """
    angles, ends = directions(lens)
    first = lens.domain.hole * (1.0 + 1e-9)
    ends = np.minimum(
        ends, widest if np.isfinite(np.tan(lens.chart.reach)) and lens.chart.reach < 2.0 else np.inf
    )
    shares = np.concatenate([[0.0, 1e-9, 1e-5], np.linspace(0.01, last, 60)])
    s = first + (last * ends - first) * shares[:, None] / last
    return (s * np.cos(angles)).ravel(), (s * np.sin(angles)).ravel()


def rays_over(lens: Lens, *, last: float = 1.0 - 1e-4) -> ndarray:
    """Unit rays (n,3) over the lens's domain, the axis among them, up to the share `last` of the way to its
    end.
    """
    return lens.chart.lift(*places_over(lens, last=last))
