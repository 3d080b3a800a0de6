"""What a lens is: a map of one chart's plane to the distorted plane, its inverse, its Jacobians and its domain.

Floor 1.  (x, y) is a ray's place in the lens's chart (charts.py), u = x^2 + y^2 = s^2, (x_d, y_d) its distorted place.  The radial
part of every lens is one curve, given as a *gain* in u:

    r_d = s g(u),    h = 2 dg/du,    slope dr_d/ds = g + h u,    J = g I + h (x, y) (x, y)^T

so nothing divides by s and the centre needs no case of its own.  The *domain* ends where the map first folds (its determinant
reaches zero), divides by zero or stops being real.  Inside it the inverse is unique and found by safeguarded Newton.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, Self

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray
from orthoscope.models.charts import Chart

__all__ = ["Lens", "RadialLens", "Warp"]

SAMPLES = 1024  # radii at which a curve is tabulated: as start of the inverse, and to find the first fold
STEEPEST = 1e-6  # a gnomonic chart is looked at up to this close to 90 degrees (radians)


class Warp(NamedTuple):
    """A distorted place with its derivatives: j_xy is d x_d / d y; by[i] is d(x_d, y_d) by the i-th coefficient asked for."""

    x: ndarray
    y: ndarray
    j_xx: ndarray
    j_xy: ndarray
    j_yx: ndarray
    j_yy: ndarray
    by: list[tuple[ndarray, ndarray]]


@dataclass(frozen=True, eq=False)
class Lens(ABC):
    """A lens: `distort` takes rays to its plane, `undistort` takes them back; NaN where there is no image.

    Subclasses are frozen dataclasses whose fields are the coefficients, in order.
    """

    chart: ClassVar[Chart]
    free: ClassVar[tuple[str, ...]]  # what a joint calibration frees unless told otherwise; the rest keeps its value
    radially_symmetric: ClassVar[bool]

    def __post_init__(self) -> None:
        frozen([getattr(self, name) for name in self.names()], (None,), f"{type(self).__name__}: coefficients")

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """The coefficients' names, in order."""
        return tuple(field.name for field in fields(cls))

    @property
    def coefficients(self) -> Float[ndarray, " p"]:
        """The coefficients (p,), in order."""
        return np.array([getattr(self, name) for name in self.names()], dtype=float)

    def with_coefficients(self, **values: float) -> Self:
        """The same lens with some coefficients replaced."""
        unknown = set(values) - set(self.names())
        if unknown:
            raise InputError(f"{type(self).__name__} has no coefficient {sorted(unknown)[0]!r}; it has {', '.join(self.names())}.")
        return replace(self, **{name: float(value) for name, value in values.items()})

    @abstractmethod
    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        """g and h of the radial curve at u = s^2."""

    @abstractmethod
    def warp(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        """The formula itself, also beyond the domain (arrays of one shape)."""

    @abstractmethod
    def linearise(self, x: ndarray, y: ndarray, wanted: Sequence[str] = ()) -> Warp:
        """The formula with its derivatives by x, y and the wanted coefficients, also beyond the domain."""

    @abstractmethod
    def unwarp_start(self, x_d: ndarray, y_d: ndarray) -> tuple[ndarray, ndarray]:
        """Where Newton starts: exact for a radial lens, near for others."""

    @property
    def field_angle(self) -> float:
        """The angle from the axis at which the domain ends, radians (in the direction where it reaches farthest)."""
        return float(self.chart.angle(self._domain[1]))

    def distort(self, rays: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2"]:
        """Where rays (n,3), any length, fall on the lens's plane; NaN beyond the domain."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            x, y = self.chart.flatten(rays[:, 0], rays[:, 1], rays[:, 2])
            plane = np.stack(self.warp(x, y), axis=-1)
            plane[~self.sees(x, y)] = np.nan
        return plane

    def undistort(self, plane: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit rays (n,3) that fall on these places (n,2) of the lens's plane; NaN where none does."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return self.chart.lift(*self.unwarp(plane[:, 0], plane[:, 1]))

    def sees(self, x: ndarray, y: ndarray) -> ndarray:
        """Which places of the chart lie in the domain."""
        inner, outer = self._domain
        s = np.hypot(x, y)
        seen = (s < inner) & (s >= self._hole)
        border = (s >= inner) & (s < outer)
        if border.any():
            seen[border] = _determinant(self.linearise(x[border], y[border])) > 0
        return seen

    def unwarp(self, x_d: ndarray, y_d: ndarray) -> tuple[ndarray, ndarray]:
        """Places in the chart that are distorted to (x_d, y_d); NaN where none in the domain is."""
        x, y = self.unwarp_start(x_d, y_d)
        if self.radially_symmetric:
            return x, y
        x, y = self._newton(x, y, x_d, y_d)
        lost = ~self.sees(x, y) | (np.hypot(*_minus(self.warp(x, y), (x_d, y_d))) > 1e-10 * (1.0 + np.hypot(x_d, y_d)))
        x[lost] = y[lost] = np.nan
        return x, y

    def invert_curve(self, r_d: ndarray) -> ndarray:
        """s of the radial curve at r_d >= 0: table, Newton, and bisection where Newton leaves its cell; NaN beyond the domain."""
        s_table, r_table = self._table
        s = np.interp(r_d, r_table, s_table, left=np.nan, right=np.nan)
        for _ in range(3):
            g, h = self.gain(s * s)
            s = s - (s * g - r_d) / (g + h * (s * s))
        g, _ = self.gain(s * s)
        poor = ~(np.abs(s * g - r_d) <= 1e-15 * (1.0 + r_d)) & (r_d >= r_table[0]) & (r_d <= r_table[-1])
        s[(r_d < r_table[0]) | (r_d > r_table[-1])] = np.nan
        if poor.any():
            s[poor] = self._bisect(r_d[poor])
        return s

    def _bisect(self, r_d: ndarray) -> ndarray:
        """Newton kept inside its cell of the table by bisection, for the few places where free Newton was not exact."""
        s_table, r_table = self._table
        cell = np.clip(np.searchsorted(r_table, r_d), 1, len(r_table) - 1)
        low, high = s_table[cell - 1].copy(), s_table[cell].copy()
        s = 0.5 * (low + high)
        for _ in range(60):
            g, h = self.gain(s * s)
            excess = s * g - r_d
            low, high = np.where(excess <= 0, s, low), np.where(excess >= 0, s, high)
            newton = s - excess / (g + h * (s * s))
            s = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
            if (high - low <= 4e-16 * high).all():
                break
        return s

    def _newton(self, x: ndarray, y: ndarray, x_d: ndarray, y_d: ndarray) -> tuple[ndarray, ndarray]:
        """Newton in the plane, a few steps for all and more for those that still move."""
        x, y = x.copy(), y.copy()
        active = np.flatnonzero(np.isfinite(x))
        for _ in range(20):
            at = self.linearise(x[active], y[active])
            e_x, e_y = at.x - x_d[active], at.y - y_d[active]
            determinant = _determinant(at)
            step_x = (at.j_yy * e_x - at.j_xy * e_y) / determinant
            step_y = (at.j_xx * e_y - at.j_yx * e_x) / determinant
            size = np.hypot(step_x, step_y)
            limit = 0.5 * (0.1 + np.hypot(x[active], y[active]))  # near a fold a full step may leave the domain
            shorten = np.minimum(1.0, limit / np.maximum(size, 1e-300))
            x[active] -= shorten * step_x
            y[active] -= shorten * step_y
            active = active[size > 1e-9 * (1.0 + np.hypot(x[active], y[active]))]  # quadratic: the next is below 1e-16
            if not len(active):
                break
        return x, y

    @cached_property
    def _domain(self) -> tuple[float, float]:
        """(inner, outer) radius in the chart: all below inner is in the domain, none above outer; between, the determinant says."""
        directions = 1 if self.radially_symmetric else 32
        phi = 2.0 * np.pi * np.arange(directions) / directions
        ends = self._first_fold(np.cos(phi), np.sin(phi))
        if self.radially_symmetric:
            return float(ends[0]), float(ends[0])
        limit = self._limit
        return 0.999 * float(ends.min()), min(limit, 1.001 * float(ends.max()))

    @property
    def _limit(self) -> float:
        return float(self.chart.radius(np.float64(self.chart.reach - STEEPEST)))

    def _radii(self, end: float) -> ndarray:
        """Radii from 0 to end, dense near the axis, even in angle squared."""
        return self.chart.radius(self.chart.angle(np.float64(end)) * np.linspace(0.0, 1.0, SAMPLES) ** 2)

    @cached_property
    def _hole(self) -> float:
        """Radius around the centre without image: 0 but for a curve that starts below zero (pfet with a0 < 0)."""
        radii = self._radii(self._limit)[1:]
        with np.errstate(all="ignore"):
            inside_out = ~(self.gain(radii * radii)[0] > 0)
        if not inside_out[0]:
            return 0.0
        first = int(np.argmin(inside_out))
        low, high = (radii[first - 1], radii[first]) if first else (radii[-1], radii[-1])
        for _ in range(64):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.gain(middle * middle)[0] > 0 else (middle, high)
        return float(high)

    def _first_fold(self, cosine: ndarray, sine: ndarray) -> ndarray:
        """For each direction, the radius at which the map first folds or stops being finite."""

        def folded(s):
            with np.errstate(all="ignore"):
                at = self.linearise(s * cosine, s * sine)
                g, h = self.gain(s * s + 0.0 * cosine)
                # a radial curve that has come back through zero has folded, whatever its determinant says
                return ~((_determinant(at) > 0) & (g + h * (s * s) > 0) & np.isfinite(at.x)) & (s > self._hole)

        radii = self._radii(self._limit)[1:]
        bad = folded(radii[:, None])
        first = np.where(bad.any(0), bad.argmax(0), len(radii) - 1)
        low, high = np.where(first > 0, radii[np.maximum(first - 1, 0)], 0.0), radii[first].copy()
        for _ in range(64):
            middle = 0.5 * (low + high)
            inside = ~folded(middle)
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return np.where(bad.any(0), low, radii[-1])

    @cached_property
    def _table(self) -> tuple[ndarray, ndarray]:
        """Radii and their r_d >= 0 over the radial curve's domain."""
        with np.errstate(all="ignore"):
            end = self._domain[0] if self.radially_symmetric else float(_curve_end(self))
            s = self._radii(end)
            r = s * self.gain(s * s)[0]
        usable = np.isfinite(r) & (r >= 0) & (s >= self._hole)
        return s[usable], r[usable]


@dataclass(frozen=True, eq=False)
class RadialLens(Lens):
    """A lens that is nothing but its curve: a subclass says `gain` and `gain_by`, the rest is here."""

    radially_symmetric: ClassVar[bool] = True

    @abstractmethod
    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        """Derivative of the gain g by one coefficient."""

    def warp(self, x, y):
        g, _ = self.gain(x * x + y * y)
        return x * g, y * g

    def linearise(self, x, y, wanted=()):
        u = x * x + y * y
        g, h = self.gain(u)
        h_xy = h * x * y
        by = [(x * slope, y * slope) for slope in (self.gain_by(name, u, g) for name in wanted)]
        return Warp(x * g, y * g, g + h * x * x, h_xy, h_xy, g + h * y * y, by)

    def unwarp_start(self, x_d, y_d):
        r_d = np.hypot(x_d, y_d)
        s = self.invert_curve(r_d)
        centre = r_d == 0
        ratio = np.where(centre, 1.0, s) / np.where(centre, 1.0, r_d)
        ratio = np.where(centre & ~np.isfinite(s), np.nan, ratio)
        return x_d * ratio, y_d * ratio


def _determinant(at: Warp) -> ndarray:
    return at.j_xx * at.j_yy - at.j_xy * at.j_yx


def _minus(a: tuple[ndarray, ndarray], b: tuple[ndarray, ndarray]) -> tuple[ndarray, ndarray]:
    return a[0] - b[0], a[1] - b[1]


def _curve_end(lens: Lens) -> float:
    """Where the radial curve of a lens with other terms too ends by itself."""
    radii = lens._radii(lens._limit)[1:]
    g, h = lens.gain(radii * radii)
    bad = ~((g + h * radii * radii > 0) & (g > 0))
    return radii[bad.argmax() - 1] if bad.any() and bad.argmax() > 0 else radii[-1]
