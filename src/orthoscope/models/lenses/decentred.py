"""Lenses with more than a curve: OpenCV's, radial with decentering, thin prism and sensor tilt added.

Symbols as in lens.py: u = s^2, r_d = s g(u), h = 2 dg/du. D. Brown, Close-range camera calibration, 1971;
coefficients, their order and the tilt as in OpenCV.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from orthoscope.geometry.arrays import ndarray
from orthoscope.models.lenses.charts import GNOMONIC
from orthoscope.models.lenses.inverse_table import Lookup
from orthoscope.models.lenses.lens import Formula, Warp
from orthoscope.models.lenses.newton_inverse import invert

__all__ = ["Brown", "Rational"]


@dataclass(frozen=True, eq=False, repr=False)
class _Decentred(Formula):
    """A radial curve with decentering p, thin prism s and sensor tilt tau (radians) added, as by OpenCV."""

    chart = GNOMONIC
    radially_symmetric: ClassVar[bool] = False

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @property
    def prism(self) -> tuple[float, ...]:
        """s1, s2, s3, s4, which stand after a subclass's own coefficients, as in OpenCV's order."""
        return tuple(getattr(self, name) for name in ("s1", "s2", "s3", "s4"))

    @property
    def tilt(self) -> tuple[float, ...]:
        """tau_x, tau_y."""
        return tuple(getattr(self, name) for name in ("tau_x", "tau_y"))

    @abstractmethod
    def bare_gain(self, u: ndarray) -> ndarray:
        """The gain g without its slope."""

    @abstractmethod
    def gain_slopes(self, u: ndarray, g: ndarray) -> dict[str, ndarray]:
        """Derivatives of the gain g at u by all radial coefficients, since each is made of the one before."""

    def warp(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        u = x * x + y * y
        g = self.bare_gain(u)
        if self.p1 or self.p2:
            g = g + ((2.0 * self.p1) * y + (2.0 * self.p2) * x)
            x_d, y_d = x * g + self.p2 * u, y * g + self.p1 * u
        else:
            x_d, y_d = x * g, y * g
        s1, s2, s3, s4 = self.prism
        if s1 or s2 or s3 or s4:
            x_d += (s1 + s2 * u) * u
            y_d += (s3 + s4 * u) * u
        return _through(self._tilt_matrix, x_d, y_d) if any(self.tilt) else (x_d, y_d)

    def linearise(self, x: ndarray, y: ndarray, wanted: Sequence[str] = ()) -> Warp:
        u = x * x + y * y
        radial, h = self.gain(u)
        p1, p2 = 2.0 * self.p1, 2.0 * self.p2
        g = radial + (p1 * y + p2 * x)
        x_d = x * g + self.p2 * u
        y_d = y * g + self.p1 * u
        h_x = h * x
        j_xy = h_x * y + (p1 * x + p2 * y)
        j_xx = g + x * (h_x + 2.0 * p2)
        j_yy = g + y * (h * y + 2.0 * p1)
        j_yx = j_xy
        s1, s2, s3, s4 = self.prism
        if s1 or s2 or s3 or s4:
            x_d, y_d = x_d + (s1 + s2 * u) * u, y_d + (s3 + s4 * u) * u
            along_x, along_y = 2.0 * (s1 + 2.0 * s2 * u), 2.0 * (s3 + 2.0 * s4 * u)
            j_xx, j_xy = j_xx + along_x * x, j_xy + along_x * y
            j_yx, j_yy = j_yx + along_y * x, j_yy + along_y * y
        slopes = self.gain_slopes(u, radial) if wanted else {}
        by = [_by(name, x, y, u, slopes) for name in wanted]
        flat = Warp(x_d, y_d, j_xx, j_xy, j_yx, j_yy, by)
        return (
            self._tilted(flat, wanted) if any(self.tilt) or "tau_x" in wanted or "tau_y" in wanted else flat
        )

    def unwarp(self, x_d: ndarray, y_d: ndarray) -> tuple[ndarray, ndarray]:
        level = self._level
        if level is not self:  # seen on a level sensor, the goal is nearer to the radial curve
            m = np.linalg.inv(self._tilt_matrix)
            # Past the horizon of the tilted plane nothing is seen.
            in_front = m[2, 0] * x_d + m[2, 1] * y_d + m[2, 2] > 0
            x_d, y_d = _through(m, np.where(in_front, x_d, np.nan), y_d)
        x, y = x_d.astype(np.float32), y_d.astype(np.float32)  # a start needs no more digits
        with np.errstate(all="ignore"):
            q = level._rough_inverse(x * x + y * y)
        q[level.beyond_image(x_d, y_d)] = np.nan
        return invert(level.linearise, self.sees, (x * q, y * q), (x_d, y_d), formula=level.warp)

    @cached_property
    def _level(self) -> _Decentred:
        """The same lens with its sensor square to the axis."""
        return self.with_coefficients(tau_x=0.0, tau_y=0.0) if any(self.tilt) else self

    @cached_property
    def _rough_inverse(self) -> Lookup:
        """The inverse of the radial curve, in single precision."""
        return self.inverse_curve.single()

    @cached_property
    def _tilt_matrix(self) -> ndarray:
        """The homography from the level sensor to the tilted one."""
        return _tilt(*self.tilt)[0]

    def _tilted(self, at: Warp, wanted: Sequence[str]) -> Warp:
        """Everything seen on the tilted sensor: a homography of the plane, so the chain rule."""
        matrix, by_tau_x, by_tau_y = _tilt(*self.tilt)
        m = matrix
        w = 1.0 / (m[2, 0] * at.x + m[2, 1] * at.y + m[2, 2])
        x, y = (
            (m[0, 0] * at.x + m[0, 1] * at.y + m[0, 2]) * w,
            (m[1, 0] * at.x + m[1, 1] * at.y + m[1, 2]) * w,
        )
        h_xx, h_xy = (m[0, 0] - x * m[2, 0]) * w, (m[0, 1] - x * m[2, 1]) * w
        h_yx, h_yy = (m[1, 0] - y * m[2, 0]) * w, (m[1, 1] - y * m[2, 1]) * w

        def chained(a: ndarray, b: ndarray) -> tuple[ndarray, ndarray]:
            return h_xx * a + h_xy * b, h_yx * a + h_yy * b

        def by_angle(d: ndarray) -> tuple[ndarray, ndarray]:
            top, middle, bottom = (d[i, 0] * at.x + d[i, 1] * at.y + d[i, 2] for i in range(3))
            return (top - x * bottom) * w, (middle - y * bottom) * w

        angles = {"tau_x": by_tau_x, "tau_y": by_tau_y}
        by = [
            by_angle(angles[name]) if name in angles else chained(*pair)
            for name, pair in zip(wanted, at.by, strict=True)
        ]
        (j_xx, j_yx), (j_xy, j_yy) = chained(at.j_xx, at.j_yx), chained(at.j_xy, at.j_yy)
        return Warp(x, y, j_xx, j_xy, j_yx, j_yy, by)


@dataclass(frozen=True, eq=False, repr=False)
class Brown(_Decentred):
    """Radial k1 k2 k3, decentering p1 p2, thin prism s1..s4, tilt tau_x tau_y.

    These are OpenCV's vectors of 4 and 5, and of 12 and 14 without k4..k6.
    """

    free: ClassVar[tuple[str, ...]] = ("k1", "k2", "p1", "p2", "k3")

    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0
    s4: float = 0.0
    tau_x: float = 0.0
    tau_y: float = 0.0

    def bare_gain(self, u: ndarray) -> ndarray:
        return 1.0 + u * (self.k1 + u * (self.k2 + u * self.k3))

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        return self.bare_gain(u), 2.0 * self.k1 + u * (4.0 * self.k2 + (6.0 * self.k3) * u)

    def gain_slopes(self, u: ndarray, g: ndarray) -> dict[str, ndarray]:
        u2 = u * u
        return {"k1": u, "k2": u2, "k3": u2 * u}


@dataclass(frozen=True, eq=False, repr=False)
class Rational(_Decentred):
    """(1 + k1 u + k2 u^2 + k3 u^3) / (1 + k4 u + k5 u^2 + k6 u^3), with p1 p2, s1..s4, tau_x tau_y added.

    These are OpenCV's vectors of 8, 12 and 14.
    """

    free: ClassVar[tuple[str, ...]] = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0
    s4: float = 0.0
    tau_x: float = 0.0
    tau_y: float = 0.0

    def bare_gain(self, u: ndarray) -> ndarray:
        return (1.0 + u * (self.k1 + u * (self.k2 + u * self.k3))) / self._denominator(u)

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        below = 1.0 / self._denominator(u)
        g = (1.0 + u * (self.k1 + u * (self.k2 + u * self.k3))) * below
        slope_above = 2.0 * self.k1 + u * (4.0 * self.k2 + (6.0 * self.k3) * u)  # twice, as h is
        slope_below = 2.0 * self.k4 + u * (4.0 * self.k5 + (6.0 * self.k6) * u)
        return g, (slope_above - g * slope_below) * below

    def gain_slopes(self, u: ndarray, g: ndarray) -> dict[str, ndarray]:
        k1 = u / self._denominator(u)
        k2, k4 = u * k1, -g * k1
        k3, k5 = u * k2, u * k4
        return {"k1": k1, "k2": k2, "k3": k3, "k4": k4, "k5": k5, "k6": u * k5}

    def _denominator(self, u: ndarray) -> ndarray:
        """What the gain is divided by."""
        return 1.0 + u * (self.k4 + u * (self.k5 + u * self.k6))


def _by(name: str, x: ndarray, y: ndarray, u: ndarray, slopes: dict[str, ndarray]) -> tuple[ndarray, ndarray]:
    """Derivative of the place on a level sensor by one coefficient.

    Args:
        name: of the coefficient.
        x: of places in the chart.
        y: of these places.
        u: their x^2 + y^2.
        slopes: derivatives of the gain by the radial coefficients.
    """
    if name in slopes:
        return x * slopes[name], y * slopes[name]
    if name == "p1":
        return (2.0 * x) * y, u + (2.0 * y) * y
    if name == "p2":
        return u + (2.0 * x) * x, (2.0 * x) * y
    zero = np.zeros_like(u)
    match name:
        case "s1":
            return u, zero
        case "s2":
            return u * u, zero
        case "s3":
            return zero, u
        case "s4":
            return zero, u * u
    return zero, zero  # tau_x and tau_y: filled in by _tilted, where the untilted place is known


def _through(m: ndarray, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
    """Places through a homography of the plane."""
    w = 1.0 / (m[2, 0] * x + m[2, 1] * y + m[2, 2])
    return (m[0, 0] * x + m[0, 1] * y + m[0, 2]) * w, (m[1, 0] * x + m[1, 1] * y + m[1, 2]) * w


def _tilt(tau_x: float, tau_y: float) -> tuple[ndarray, ndarray, ndarray]:
    """OpenCV's matrix of a sensor turned by tau_x, then tau_y, and its derivatives by both."""
    (c_x, s_x), (c_y, s_y) = (np.cos(tau_x), np.sin(tau_x)), (np.cos(tau_y), np.sin(tau_y))
    about_x = np.array([[1, 0, 0], [0, c_x, s_x], [0, -s_x, c_x]])
    d_about_x = np.array([[0, 0, 0], [0, -s_x, c_x], [0, -c_x, -s_x]])
    about_y = np.array([[c_y, 0, -s_y], [0, 1, 0], [s_y, 0, c_y]])
    d_about_y = np.array([[-s_y, 0, -c_y], [0, 0, 0], [c_y, 0, -s_y]])

    # It is linear in the rotation but for the constant, so it does for the derivatives too.
    def projector(turned: ndarray) -> ndarray:
        return np.array([[turned[2, 2], 0, -turned[0, 2]], [0, turned[2, 2], -turned[1, 2]], [0, 0, 0]])

    constant = np.diag([0.0, 0.0, 1.0])
    turned = about_y @ about_x
    matrix = (projector(turned) + constant) @ turned
    by = [
        projector(d) @ turned + (projector(turned) + constant) @ d
        for d in (about_y @ d_about_x, d_about_y @ about_x)
    ]
    return matrix, by[0], by[1]
