"""Lenses that project onto a surface first and from a point beside its centre then: r_d = sin(theta) / D.

Symbols as in lens.py, in the equidistant chart: u = theta^2; w = 1 - cos(theta), which keeps its digits near
the axis; D is each lens's own. With sinc = sin(theta) / theta

    g = sinc / D,    dw/du = sinc / 2,    dg/du = (dsinc/du - g dD/dw sinc / 2) / D

and beyond D = 0 there is no image.

double_sphere     V. Usenko, N. Demmel and D. Cremers, The double sphere camera model, 3DV 2018; Kalibr's and
                  basalt's ds.
eucm              B. Khomutenko, G. Garcia and P. Martinet, An enhanced unified camera model, RA-L 1(1), 2016;
                  Kalibr's and basalt's eucm; with beta = 1 basalt's ucm and, in other letters, Kalibr's omni.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from orthoscope.geometry.arrays import ndarray
from orthoscope.models.lenses.charts import EQUIDISTANT
from orthoscope.models.lenses.lens import RadialLens

__all__ = ["DoubleSphere", "Eucm"]

# Up to this theta^2 the slope of the sinc is its series, exact to rounding.
SINC_SERIES_LIMIT = 1e-2


@dataclass(frozen=True, eq=False, repr=False)
class _ThroughASurface(RadialLens):
    """r_d = sin(theta) / D(w)."""

    chart = EQUIDISTANT

    @abstractmethod
    def _below(self, w: ndarray) -> tuple[ndarray, ndarray]:
        """D and dD/dw."""

    @abstractmethod
    def _below_by(self, name: str, w: ndarray) -> ndarray:
        """dD by a coefficient."""

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        theta = np.sqrt(u)
        sinc, slope = _sinc(theta)
        below, falls = self._below(_from_axis(theta))
        g = sinc / below
        return g, (2.0 * slope - g * falls * sinc) / below

    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        w = _from_axis(np.sqrt(u))
        return -g * self._below_by(name, w) / self._below(w)[0]


@dataclass(frozen=True, eq=False, repr=False)
class DoubleSphere(_ThroughASurface):
    """D = alpha sqrt(1 + xi^2 + 2 xi cos(theta)) + (1 - alpha) (xi + cos(theta)).

    As it comes it is stereographic; xi = alpha = 0 is no distortion. The slope at the centre is 1 / (1 + xi).
    """

    free: ClassVar[tuple[str, ...]] = ("xi", "alpha")
    starts = ({"xi": -0.2}, {"xi": 0.2}, {"alpha": 0.1})
    several_minima: ClassVar[bool] = True  # one on either side of the sphere

    xi: float = 0.0
    alpha: float = 0.5

    def _below(self, w: ndarray) -> tuple[ndarray, ndarray]:
        first = self.xi + 1.0 - w
        second = self._second(w)
        return (
            self.alpha * second + (1.0 - self.alpha) * first,
            -self.alpha * self.xi / second - (1.0 - self.alpha),
        )

    def _below_by(self, name: str, w: ndarray) -> ndarray:
        first, second = self.xi + 1.0 - w, self._second(w)
        return self.alpha * first / second + 1.0 - self.alpha if name == "xi" else second - first

    def _second(self, w: ndarray) -> ndarray:
        """The distance from the second sphere's centre."""
        return np.sqrt((1.0 + self.xi) * (1.0 + self.xi) - 2.0 * self.xi * w)


@dataclass(frozen=True, eq=False, repr=False)
class Eucm(_ThroughASurface):
    """D = alpha sqrt(beta sin(theta)^2 + cos(theta)^2) + (1 - alpha) cos(theta).

    As it comes it is stereographic; alpha = 0 is no distortion. beta = 1 is a sphere.
    """

    free: ClassVar[tuple[str, ...]] = ("alpha", "beta")
    starts = ({"alpha": 0.5}, {"alpha": 0.7}, {"alpha": 0.2})

    alpha: float = 0.5
    beta: float = 1.0

    def _below(self, w: ndarray) -> tuple[ndarray, ndarray]:
        cosine, root = 1.0 - w, self._distance(w)
        return (
            self.alpha * root + (1.0 - self.alpha) * cosine,
            self.alpha * (self.beta - 1.0) * cosine / root - (1.0 - self.alpha),
        )

    def _below_by(self, name: str, w: ndarray) -> ndarray:
        root = self._distance(w)
        return root - (1.0 - w) if name == "alpha" else 0.5 * self.alpha * w * (2.0 - w) / root

    def _distance(self, w: ndarray) -> ndarray:
        """The distance from the centre of the surface, which is an ellipsoid."""
        return np.sqrt(self.beta * w * (2.0 - w) + (1.0 - w) ** 2)


def _from_axis(theta: ndarray) -> ndarray:
    """1 - cos(theta), by the half angle."""
    return 2.0 * np.sin(0.5 * theta) ** 2


def _sinc(theta: ndarray) -> tuple[ndarray, ndarray]:
    """sin(theta) / theta and its derivative by theta^2; at 0 they are 1 and -1/6."""
    u = theta * theta
    small = u < SINC_SERIES_LIMIT
    safe = np.where(small, 1.0, theta)
    series = 1.0 - u / 6.0 * (1.0 - u / 20.0 * (1.0 - u / 42.0 * (1.0 - u / 72.0 * (1.0 - u / 110.0))))
    slope = -1 / 6 + u * (1 / 60 - u * (1 / 1680 - u * (1 / 90720 - u / 7983360)))
    sinc = np.where(small, series, np.sin(safe) / safe)
    return sinc, np.where(small, slope, 0.5 * (np.cos(safe) - sinc) / (safe * safe))
