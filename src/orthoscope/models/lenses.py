"""The lens formulas, each the few lines that are its own, and `LENSES`, the table that everything else goes by.

Floor 1.  Symbols as in lens.py: u = s^2, r_d = s g(u), h = 2 dg/du.

brown, rational   D. Brown, Close-range camera calibration, 1971; coefficients, order and tilt as in OpenCV.
pfet, fet         A. Basu and S. Licardie, Alternative models for fish-eye lenses, PRL 16(4), 1995; the paper's eq. (1).
fov               F. Devernay and O. Faugeras, Straight lines have to be straight, MVA 13(1), 2001.
division          A. Fitzgibbon, Simultaneous linear estimation of multiple view geometry and lens distortion, CVPR 2001.
kannala_brandt    J. Kannala and S. Brandt, A generic camera model and calibration method, TPAMI 28(8), 2006;
                  OpenCV's fisheye, Kalibr's equidistant.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.models.charts import EQUIDISTANT, GNOMONIC
from orthoscope.models.lens import Lens, RadialLens, Warp
from orthoscope.models.warp import invert

__all__ = ["LENSES", "Brown", "Division", "Fet", "Fov", "KannalaBrandt", "Pfet", "Rational", "lens_name", "lens_with_values", "parse_lens"]


@dataclass(frozen=True, eq=False)
class _Decentred(Lens):
    """A radial curve with decentering (p), thin prism (s) and sensor tilt (tau, radians) added, as OpenCV adds them."""

    chart = GNOMONIC
    radially_symmetric: ClassVar[bool] = False

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @property
    @abstractmethod
    def prism(self) -> tuple[float, float, float, float]: ...

    @property
    @abstractmethod
    def tilt(self) -> tuple[float, float]: ...

    @abstractmethod
    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray | None:
        """Derivative of the gain by a radial coefficient; None where the name is another kind of coefficient."""

    def warp(self, x, y):
        u = x * x + y * y
        g, _ = self.gain(u)
        x_d, y_d = x * g, y * g
        if self.p1 or self.p2:
            cross = 2.0 * (self.p1 * y + self.p2 * x)
            x_d += x * cross + self.p2 * u
            y_d += y * cross + self.p1 * u
        s1, s2, s3, s4 = self.prism
        if s1 or s2 or s3 or s4:
            x_d += (s1 + s2 * u) * u
            y_d += (s3 + s4 * u) * u
        return _through(self._tilt_matrix, x_d, y_d) if any(self.tilt) else (x_d, y_d)

    def linearise(self, x, y, wanted=()):
        u = x * x + y * y
        g, h = self.gain(u)
        cross = 2.0 * (self.p1 * y + self.p2 * x)
        x_d = x * (g + cross) + self.p2 * u
        y_d = y * (g + cross) + self.p1 * u
        j_xy = h * x * y + 2.0 * (self.p1 * x + self.p2 * y)
        j_xx = g + cross + x * (h * x + 4.0 * self.p2)
        j_yy = g + cross + y * (h * y + 4.0 * self.p1)
        j_yx = j_xy
        s1, s2, s3, s4 = self.prism
        if s1 or s2 or s3 or s4:
            x_d, y_d = x_d + (s1 + s2 * u) * u, y_d + (s3 + s4 * u) * u
            along_x, along_y = 2.0 * (s1 + 2.0 * s2 * u), 2.0 * (s3 + 2.0 * s4 * u)
            j_xx, j_xy = j_xx + along_x * x, j_xy + along_x * y
            j_yx, j_yy = j_yx + along_y * x, j_yy + along_y * y
        by = [self._by(name, x, y, u, g) for name in wanted]
        flat = Warp(x_d, y_d, j_xx, j_xy, j_yx, j_yy, by)
        return self._tilted(flat, wanted) if any(self.tilt) or "tau_x" in wanted or "tau_y" in wanted else flat

    def unwarp(self, x_d, y_d):
        level = self._level
        if level is not self:  # seen on a level sensor, the goal is nearer to the radial curve
            m = np.linalg.inv(self._tilt_matrix)
            in_front = m[2, 0] * x_d + m[2, 1] * y_d + m[2, 2] > 0  # past the horizon of the tilted plane nothing is seen
            x_d, y_d = _through(m, np.where(in_front, x_d, np.nan), y_d)
        r_d = np.sqrt(x_d * x_d + y_d * y_d)
        s_table, r_table = level._table
        ratio = np.interp(r_d, r_table, s_table) / np.maximum(r_d, 1e-300)  # past the end: starts at it, Newton says
        ratio[level.beyond_image(x_d, y_d)] = np.nan
        return invert(level.linearise, self.sees, (x_d * ratio, y_d * ratio), (x_d, y_d))

    def _by(self, name: str, x: ndarray, y: ndarray, u: ndarray, g: ndarray) -> tuple[ndarray, ndarray]:
        zero = np.zeros_like(x)
        match name:
            case "p1":
                return 2.0 * x * y, u + 2.0 * y * y
            case "p2":
                return u + 2.0 * x * x, 2.0 * x * y
            case "s1":
                return u, zero
            case "s2":
                return u * u, zero
            case "s3":
                return zero, u
            case "s4":
                return zero, u * u
            case "tau_x" | "tau_y":
                return zero, zero  # filled in by _tilted, where the untilted place is known
        slope = self.gain_by(name, u, g)
        assert slope is not None, name
        return x * slope, y * slope

    @cached_property
    def _level(self) -> _Decentred:
        """The same lens with its sensor square to the axis."""
        return self.with_coefficients(tau_x=0.0, tau_y=0.0) if any(self.tilt) else self

    @cached_property
    def _tilt_matrix(self) -> ndarray:
        return _tilt(*self.tilt)[0]

    def _tilted(self, at: Warp, wanted) -> Warp:
        """Everything seen on the tilted sensor: a homography of the plane, so the chain rule."""
        matrix, by_tau_x, by_tau_y = _tilt(*self.tilt)
        m = matrix
        w = 1.0 / (m[2, 0] * at.x + m[2, 1] * at.y + m[2, 2])
        x, y = (m[0, 0] * at.x + m[0, 1] * at.y + m[0, 2]) * w, (m[1, 0] * at.x + m[1, 1] * at.y + m[1, 2]) * w
        h_xx, h_xy = (m[0, 0] - x * m[2, 0]) * w, (m[0, 1] - x * m[2, 1]) * w
        h_yx, h_yy = (m[1, 0] - y * m[2, 0]) * w, (m[1, 1] - y * m[2, 1]) * w

        def chained(a, b):
            return h_xx * a + h_xy * b, h_yx * a + h_yy * b

        def by_angle(d):
            top, middle, bottom = (d[i, 0] * at.x + d[i, 1] * at.y + d[i, 2] for i in range(3))
            return (top - x * bottom) * w, (middle - y * bottom) * w

        angles = {"tau_x": by_tau_x, "tau_y": by_tau_y}
        by = [by_angle(angles[name]) if name in angles else chained(*pair) for name, pair in zip(wanted, at.by, strict=True)]
        (j_xx, j_yx), (j_xy, j_yy) = chained(at.j_xx, at.j_yx), chained(at.j_xy, at.j_yy)
        return Warp(x, y, j_xx, j_xy, j_yx, j_yy, by)


@dataclass(frozen=True, eq=False)
class Brown(_Decentred):
    """Radial k1 k2 k3, decentering p1 p2, thin prism s1..s4, tilt tau_x tau_y (OpenCV's 4, 5; 12 and 14 without k4..k6)."""

    free: ClassVar[tuple[str, ...]] = ("k1", "k2", "p1", "p2", "k3")

    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0
    s4: float = 0.0
    tau_x: float = 0.0
    tau_y: float = 0.0

    @property
    def prism(self):
        return self.s1, self.s2, self.s3, self.s4

    @property
    def tilt(self):
        return self.tau_x, self.tau_y

    def gain(self, u):
        return (
            1.0 + u * (self.k1 + u * (self.k2 + u * self.k3)),
            2.0 * (self.k1 + u * (2.0 * self.k2 + (3.0 * self.k3) * u)),
        )

    def gain_by(self, name, u, g):
        match name:
            case "k1":
                return u
            case "k2":
                return u * u
            case "k3":
                return u * u * u
        return None


@dataclass(frozen=True, eq=False)
class Rational(_Decentred):
    """(1 + k1 u + k2 u^2 + k3 u^3) / (1 + k4 u + k5 u^2 + k6 u^3) with the same additions (OpenCV's 8, 12 and 14)."""

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

    @property
    def prism(self):
        return self.s1, self.s2, self.s3, self.s4

    @property
    def tilt(self):
        return self.tau_x, self.tau_y

    def gain(self, u):
        below = 1.0 / self._denominator(u)
        g = (1.0 + u * (self.k1 + u * (self.k2 + u * self.k3))) * below
        slope_above = self.k1 + u * (2.0 * self.k2 + (3.0 * self.k3) * u)
        slope_below = self.k4 + u * (2.0 * self.k5 + (3.0 * self.k6) * u)
        return g, 2.0 * (slope_above - g * slope_below) * below

    def gain_by(self, name, u, g):
        power = {"k1": 1, "k2": 2, "k3": 3, "k4": 1, "k5": 2, "k6": 3}.get(name)
        if power is None:
            return None
        slope = u**power / self._denominator(u)
        return -g * slope if name in ("k4", "k5", "k6") else slope

    def _denominator(self, u: ndarray) -> ndarray:
        return 1.0 + u * (self.k4 + u * (self.k5 + u * self.k6))


@dataclass(frozen=True, eq=False)
class Pfet(RadialLens):
    """Polynomial fish-eye transform, r_d = a0 + a1 s + ... + a5 s^5 (the paper's eq. 1).

    In a joint calibration a1 stays 1, since K scales the plane too, and a0 stays 0: any other a0 tears the image at its
    centre (a ring of radius |a0| without preimage), where the place is NaN.
    """

    chart = GNOMONIC
    free: ClassVar[tuple[str, ...]] = ("a2", "a3", "a4", "a5")

    a0: float = 0.0
    a1: float = 1.0
    a2: float = 0.0
    a3: float = 0.0
    a4: float = 0.0
    a5: float = 0.0

    def gain(self, u):
        s = np.sqrt(u)
        g = self.a1 + s * (self.a2 + s * (self.a3 + s * (self.a4 + s * self.a5)))
        slope = self.a2 + s * (2 * self.a3 + s * (3 * self.a4 + s * 4 * self.a5))  # dg/ds; h = slope / s
        if self.a0 == 0.0:
            return g, _over(slope, s)
        return g + self.a0 / s, slope / s - self.a0 / (u * s)

    def gain_by(self, name, u, g):
        power = int(name[1]) - 1
        return np.sqrt(u) ** power if power >= 0 else 1.0 / np.sqrt(u)


@dataclass(frozen=True, eq=False)
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

    def gain(self, u):
        s = np.sqrt(u)
        z = self.l * s
        g = self.scale * self.l * _log_ratio(z)
        return g, _over(self.scale * self.l / (1.0 + z) - g, u)

    def gain_by(self, name, u, g):
        s = np.sqrt(u)
        return g / self.scale if name == "scale" else self.scale / (1.0 + self.l * s)


@dataclass(frozen=True, eq=False)
class Fov(RadialLens):
    """Field of view, r_d = atan(2 s tan(w/2)) / w, w in radians; w = 0 is no distortion."""

    chart = GNOMONIC
    free: ClassVar[tuple[str, ...]] = ("w",)
    starts = ({"w": 0.3}, {"w": 0.9}, {"w": 1.5})  # at w = 0 the slope by w is 0: no fit would leave it

    w: float = 0.0

    def gain(self, u):
        m, _ = self._stretch()
        z = m * m * u * self.w * self.w
        return m * _atan_ratio(z), 2.0 * m**3 * self.w * self.w * _atan_ratio_slope(z)

    def gain_by(self, name, u, g):
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


@dataclass(frozen=True, eq=False)
class Division(RadialLens):
    """Division, s = r_d / (1 + l r_d^2)."""

    chart = GNOMONIC
    free: ClassVar[tuple[str, ...]] = ("l",)
    starts = ({}, {"l": -0.3}, {"l": -1.0})

    l: float = 0.0  # noqa: E741  the formula's own letter

    def gain(self, u):
        root = np.sqrt(1.0 - 4.0 * self.l * u)
        g = 2.0 / (1.0 + root)
        return g, 2.0 * self.l * g * g / root

    def gain_by(self, name, u, g):
        return u * g * g / np.sqrt(1.0 - 4.0 * self.l * u)


@dataclass(frozen=True, eq=False)
class KannalaBrandt(RadialLens):
    """r_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)."""

    chart = EQUIDISTANT
    free: ClassVar[tuple[str, ...]] = ("k1", "k2", "k3", "k4")

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0

    def gain(self, u):
        k1, k2, k3, k4 = self.k1, self.k2, self.k3, self.k4
        return 1.0 + u * (k1 + u * (k2 + u * (k3 + u * k4))), 2.0 * (k1 + u * (2 * k2 + u * (3 * k3 + 4 * k4 * u)))

    def gain_by(self, name, u, g):
        return u ** int(name[1])


LENSES: dict[str, type[Lens]] = {
    "brown": Brown,
    "rational": Rational,
    "pfet": Pfet,
    "fet": Fet,
    "fov": Fov,
    "division": Division,
    "kannala_brandt": KannalaBrandt,
}


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

    def projector(turned):  # and, linear in the rotation, of its derivative but for the constant
        return np.array([[turned[2, 2], 0, -turned[0, 2]], [0, turned[2, 2], -turned[1, 2]], [0, 0, 0]])

    constant = np.diag([0.0, 0.0, 1.0])
    turned = about_y @ about_x
    matrix = (projector(turned) + constant) @ turned
    by = [projector(d) @ turned + (projector(turned) + constant) @ d for d in (about_y @ d_about_x, d_about_y @ about_x)]
    return matrix, by[0], by[1]


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


def parse_lens(text: str) -> tuple[type[Lens], tuple[str, ...]]:
    """The lens of a description such as `brown` or `brown:k1,k2`, and the coefficients that a calibration is to free.

    Raises InputError for a lens or a coefficient that is not there.
    """
    name, _, listed = text.strip().partition(":")
    if name not in LENSES:
        raise InputError(f"lens {name!r} is not known; expected one of {', '.join(LENSES)}, as in --lens brown or --lens brown:k1,k2.")
    lens = LENSES[name]
    free = tuple(part.strip() for part in listed.split(",") if part.strip()) if listed else lens.free
    for coefficient in free:
        if coefficient not in lens.names():
            raise InputError(f"lens {name!r} has no coefficient {coefficient!r}; it has {', '.join(lens.names())}.")
    return lens, free


def lens_with_values(text: str) -> Lens:
    """The lens of a description with values, such as `brown:k1=-0.3,k2=0.1`; coefficients that are not named keep their usual value.

    Raises InputError for a lens, a coefficient or a value that is none.
    """
    name, _, listed = text.strip().partition(":")
    lens, _ = parse_lens(name)
    try:
        values = {key.strip(): float(value) for key, value in (part.split("=") for part in listed.split(",") if part.strip())}
    except ValueError as error:
        raise InputError(f"lens {text!r} is not understood; expected a name and values, such as brown:k1=-0.3,k2=0.1.") from error
    return lens().with_coefficients(**values)


def lens_name(lens: Lens) -> str:
    """The name of a lens in LENSES."""
    return next(name for name, kind in LENSES.items() if type(lens) is kind)
