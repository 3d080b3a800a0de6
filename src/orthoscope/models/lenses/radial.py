"""Lenses that are nothing but a curve, each the few lines that are its own.

Symbols as in lens.py: u = s^2, r_d = s g(u), h = 2 dg/du.

pfet, fet         A. Basu and S. Licardie, Alternative models for fish-eye lenses, PRL 16(4), 1995; the
                  paper's eq. (1).
fov               F. Devernay and O. Faugeras, Straight lines have to be straight, MVA 13(1), 2001.
division          A. Fitzgibbon, Simultaneous linear estimation of multiple view geometry and lens
                  distortion, CVPR 2001.
kannala_brandt    J. Kannala and S. Brandt, A generic camera model and calibration method, TPAMI 28(8), 2006;
                  OpenCV's fisheye, Kalibr's equidistant.
stereographic     mrcal's; J. P. Snyder, Map Projections: A Working Manual, USGS 1395, 1987.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import ClassVar

import numpy as np

from orthoscope.geometry.arrays import ndarray
from orthoscope.models.lenses.charts import EQUIDISTANT, GNOMONIC
from orthoscope.models.lenses.lens import RadialLens

__all__ = ["Division", "Fet", "Fov", "KannalaBrandt", "Pfet", "Stereographic"]

# Up to this theta^2 a series is exact to rounding where a closed form loses its digits.
SERIES_LIMIT = 1e-4


@dataclass(frozen=True, eq=False, repr=False)
class Pfet(RadialLens):
    """Polynomial fish-eye transform, r_d = a0 + a1 s + ... + a5 s^5 (the paper's eq. 1).

    In a joint calibration a1 stays 1, since K scales the plane too, and a0 stays 0: any other a0 tears the
    image at its centre (a ring of radius |a0| without preimage), where the place is NaN.
    """

    chart = GNOMONIC
    free: ClassVar[tuple[str, ...]] = ("a2", "a3", "a4", "a5")

    a0: float = 0.0
    a1: float = 1.0
    a2: float = 0.0
    a3: float = 0.0
    a4: float = 0.0
    a5: float = 0.0

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        s = np.sqrt(u)
        g = self.a1 + s * (self.a2 + s * (self.a3 + s * (self.a4 + s * self.a5)))
        slope = self.a2 + s * (2 * self.a3 + s * (3 * self.a4 + s * 4 * self.a5))  # dg/ds; h = slope / s
        if self.a0 == 0.0:
            return g, _over(slope, s)
        return g + self.a0 / s, slope / s - self.a0 / (u * s)

    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        s, power = np.sqrt(u), int(name[1]) - 1
        return prod([s] * power, start=np.ones_like(s)) if power >= 0 else 1.0 / s


@dataclass(frozen=True, eq=False, repr=False)
class Fet(RadialLens):
    """Fish-eye transform, r_d = s log(1 + l r); scale * l is the slope at the centre.

    In a joint calibration the scale keeps its value, since K scales the plane too.
    """

    chart = GNOMONIC
    free: ClassVar[tuple[str, ...]] = ("l",)
    scaled_by = "scale"
    starts = tuple({"scale": 1.0 / slope, "l": slope} for slope in (0.1, 0.5, 1.0, 2.0, 4.0))

    scale: float = 10.0
    l: float = 0.1  # noqa: E741  the formula's own letter

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        s = np.sqrt(u)
        z = self.l * s
        g = self.scale * self.l * _log_ratio(z)
        return g, _over(self.scale * self.l / (1.0 + z) - g, u)

    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        s = np.sqrt(u)
        return g / self.scale if name == "scale" else self.scale / (1.0 + self.l * s)


@dataclass(frozen=True, eq=False, repr=False)
class Fov(RadialLens):
    """Field of view, r_d = atan(2 s tan(w/2)) / w, w in radians; w = 0 is no distortion."""

    chart = GNOMONIC
    free: ClassVar[tuple[str, ...]] = ("w",)
    starts = ({"w": 0.3}, {"w": 0.9}, {"w": 1.5})  # at w = 0 the slope by w is 0: no fit would leave it

    w: float = 0.0

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        m, _ = self._stretch()
        z = m * m * u * self.w * self.w
        return m * _atan_ratio(z), 2.0 * m**3 * self.w * self.w * _atan_ratio_slope(z)

    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        m, dm = self._stretch()
        z = m * m * u * self.w * self.w
        dz = 2.0 * m * u * self.w * (dm * self.w + m)
        return dm * _atan_ratio(z) + m * _atan_ratio_slope(z) * dz

    def _stretch(self) -> tuple[float, float]:
        """m = 2 tan(w/2) / w, the slope at the centre, and dm/dw."""
        w = self.w
        if abs(w) < 1e-3:
            return 1.0 + w * w / 12.0 + w**4 / 120.0, w / 6.0 + w**3 / 30.0
        tangent = np.tan(0.5 * w)
        return 2.0 * tangent / w, (1.0 + tangent * tangent) / w - 2.0 * tangent / (w * w)


@dataclass(frozen=True, eq=False, repr=False)
class Division(RadialLens):
    """Division, s = r_d / (1 + l r_d^2)."""

    chart = GNOMONIC
    free: ClassVar[tuple[str, ...]] = ("l",)
    starts = ({}, {"l": -0.3}, {"l": -1.0})

    l: float = 0.0  # noqa: E741  the formula's own letter

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        root = np.sqrt(1.0 - 4.0 * self.l * u)
        g = 2.0 / (1.0 + root)
        return g, 2.0 * self.l * g * g / root

    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        return u * g * g / np.sqrt(1.0 - 4.0 * self.l * u)


@dataclass(frozen=True, eq=False, repr=False)
class KannalaBrandt(RadialLens):
    """r_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)."""

    chart = EQUIDISTANT
    free: ClassVar[tuple[str, ...]] = ("k1", "k2", "k3", "k4")

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        k1, k2, k3, k4 = self.k1, self.k2, self.k3, self.k4
        return 1.0 + u * (k1 + u * (k2 + u * (k3 + u * k4))), 2.0 * (
            k1 + u * (2 * k2 + u * (3 * k3 + 4 * k4 * u))
        )

    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        return prod([u] * int(name[1]), start=np.ones_like(u))  # many times faster than a power


@dataclass(frozen=True, eq=False, repr=False)
class Stereographic(RadialLens):
    """r_d = 2 tan(theta / 2): small shapes keep their shape; no coefficients."""

    chart = EQUIDISTANT
    free: ClassVar[tuple[str, ...]] = ()

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        small = u < SERIES_LIMIT
        safe = np.where(small, 1.0, u)
        s = np.sqrt(safe)
        t = np.tan(0.5 * s)
        series = 1.0 + u * (1 / 12 + u * (1 / 120 + u * 17 / 20160))
        slope = 1 / 6 + u * (1 / 30 + u * 17 / 3360)
        return (
            np.where(small, series, 2.0 * t / s),
            np.where(small, slope, ((1.0 + t * t) * s - 2.0 * t) / (safe * s)),
        )

    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        raise AssertionError(f"a stereographic lens has no coefficient {name}")


def _over(above: ndarray, below: ndarray) -> ndarray:
    """above / below; 0 where below is 0 (there the quotient is only ever multiplied by below)."""
    return np.where(below == 0, 0.0, above / np.where(below == 0, 1.0, below))


def _log_ratio(z: ndarray) -> ndarray:
    """log(1 + z) / z, 1 at 0."""
    zero = z == 0
    return np.where(zero, 1.0, np.log1p(z) / np.where(zero, 1.0, z))


def _atan_ratio(z: ndarray) -> ndarray:
    """atan(sqrt z) / sqrt z, 1 at 0."""
    root = np.sqrt(z)
    small = root < 1e-8
    return np.where(small, 1.0, np.arctan(root) / np.where(small, 1.0, root))


def _atan_ratio_slope(z: ndarray) -> ndarray:
    """Derivative of atan(sqrt z) / sqrt z by z; by its series where the closed form loses its digits."""
    small = z < 1e-2
    series = -1 / 3 + z * (2 / 5 - z * (3 / 7 - z * (4 / 9 - z * (5 / 11 - z * (6 / 13 - z * 7 / 15)))))
    safe = np.where(small, 1.0, z)
    return np.where(small, series, 0.5 * (1.0 / (safe * (1.0 + safe)) - np.arctan(np.sqrt(safe)) / safe**1.5))
