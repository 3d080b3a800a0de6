"""What a lens is: a map of a chart's plane to the distorted plane, its inverse, Jacobians and domain.

(x, y) is a ray's place in the lens's chart (charts.py), u = x^2 + y^2 = s^2, (x_d, y_d) its distorted place.
The radial part of every lens is one curve, given as a *gain* in u:

    r_d = s g(u),    h = 2 dg/du,    slope dr_d/ds = g + h u,    J = g I + h (x, y) (x, y)^T

so nothing divides by s and the centre needs no case of its own. The *domain* (domain.py) ends where the map
first folds (its determinant reaches zero), divides by zero or stops being real. Inside it the inverse is
unique and found by Newton (newton_inverse.py).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from typing import ClassVar, TypeVar

import numpy as np

from orthoscope.geometry.arrays import Bool, Float, InputError, frozen, ndarray
from orthoscope.models.lenses.charts import Chart
from orthoscope.models.lenses.chunks import in_chunks
from orthoscope.models.lenses.domain import Domain, find_domain
from orthoscope.models.lenses.inverse_table import Lookup, tabulated
from orthoscope.models.lenses.newton_inverse import Warp, determinant

__all__ = ["Formula", "Lens", "RadialLens", "Warp"]

# A curve is tabulated at this many radii: as start of the inverse, and to find the first fold.
CURVE_SAMPLES = 1024
# The image is parted into so many sectors of directions, of each of which it is known how far it reaches.
SECTOR_COUNT = 32
# A chart is looked at up to this close to the end of its reach, radians.
LEAST_GRAZING_ANGLE = 1e-6
# Half of the cells of the inverse's table lie within this angle from the axis, radians.
MIDDLE_ANGLE = np.pi / 4
# A Newton step shorter than this share leaves less than a rounding, since the error squares.
LAST_NEWTON_STEP = 3e-9
# Newton's error does not square beside a fold or a border, where u_d is beyond this share of its end.
NEWTON_END_SHARE = 0.99
# A radius next to zero, whose square is a number still.
TINY_RADIUS = 1e-150

AnyLens = TypeVar("AnyLens", bound="Lens")
AnyFormula = TypeVar("AnyFormula", bound="Formula")


@dataclass(frozen=True, eq=False)
class Lens(ABC):
    """A lens: `distort` takes rays to its plane, `undistort` takes them back; NaN where there is no image.

    Attributes:
        scaled_by: the coefficient that scales the whole plane, as K does too; None where there is none.
    """

    scaled_by: ClassVar[str | None] = None

    @property
    @abstractmethod
    def chart(self) -> Chart:
        """The plane in which rays are described."""

    @property
    @abstractmethod
    def radially_symmetric(self) -> bool:
        """Whether the lens is its radial curve and nothing else."""

    @property
    @abstractmethod
    def free(self) -> tuple[str, ...]:
        """The coefficients that a joint calibration frees unless told otherwise; the rest keeps its value."""

    @property
    @abstractmethod
    def coefficients(self) -> Float[ndarray, " p"]:
        """The coefficients (p,) that have names, in order."""

    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """The coefficients' names, in order."""

    @abstractmethod
    def with_coefficients(self: AnyLens, **values: float) -> AnyLens:
        """The same lens with some coefficients replaced.

        Args:
            values: the new ones, by name.
        Raises:
            InputError: the lens has no such coefficient.
        """

    @abstractmethod
    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        """g and h of the radial curve at u = s^2."""

    @abstractmethod
    def warp(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        """Places (x_d, y_d) by the formula itself, also beyond the domain (arrays of one shape)."""

    @abstractmethod
    def linearise(self, x: ndarray, y: ndarray, wanted: Sequence[str] = ()) -> Warp:
        """The formula with its derivatives, also beyond the domain.

        Args:
            x: of places in the chart.
            y: of these places, of the same shape.
            wanted: the coefficients by which derivatives are asked for, beside those by x and y.
        """

    @abstractmethod
    def unwarp(self, x_d: ndarray, y_d: ndarray) -> tuple[ndarray, ndarray]:
        """Places in the chart that are distorted to (x_d, y_d); NaN where none in the domain is."""

    @property
    def field_angle(self) -> float:
        """The angle from the axis at which the domain ends, radians, where it is farthest."""
        return float(self.chart.angle(np.float64(self.domain.outer)))

    def distort(self, rays: Float[ndarray, "n 3"], *, beyond: bool = False) -> Float[ndarray, "n 2"]:
        """Where rays fall on the lens's plane.

        Args:
            rays: (n,3), of any length.
            beyond: whether the formula goes on beyond the domain.
        Returns:
            (n,2); NaN where a ray has no image.
        """
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            x, y = self.chart.flatten(rays[:, 0], rays[:, 1], rays[:, 2])
            plane = np.stack(self.warp(x, y), axis=-1)
            if not beyond:
                plane[~self.sees(x, y)] = np.nan
        return plane

    def undistort(self, plane: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit rays (n,3) that fall on these places (n,2) of the lens's plane; NaN where none does."""
        return in_chunks(lambda x_d, y_d: self.chart.lift(*self.unwarp(x_d, y_d)), plane, width=3)

    def sees(self, x: ndarray, y: ndarray) -> ndarray:
        """Which places of the chart lie in the domain."""
        domain = self.domain
        u = x * x + y * y
        seen = u < domain.inner * domain.inner
        if domain.hole:
            seen &= u >= domain.hole * domain.hole
        if self.radially_symmetric or seen.all():
            return seen
        s = np.sqrt(u)
        border = np.flatnonzero(~seen & (s <= 1.01 * domain.outer))
        if len(border):
            at = self.linearise(x[border], y[border])
            seen[border] = (
                (s[border] < domain.ends_towards(x[border], y[border]))
                & (determinant(at) > 0)
                & np.isfinite(at.x)
            )
        return seen

    def sees_all_up_to(self, rays: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether all rays no farther from the axis than each of these lie in the domain, so far as is known.

        In a pin-hole's plane these are a disc: a lens that sees all up to the corners of a rectangle sees all
        of the rectangle.
        """
        with np.errstate(invalid="ignore"):
            x, y = self.chart.flatten(rays[:, 0], rays[:, 1], rays[:, 2])
        return (x * x + y * y < self.domain.inner**2) & (self.domain.hole == 0)

    def invert_curve(self, r_d: ndarray) -> ndarray:
        """s of the radial curve at r_d >= 0; NaN beyond the domain.

        The table gives the start, Newton the rest, and bisection what Newton did not get exact.
        """
        s_table, r_table = self._table
        if len(r_table) == 0:  # a curve that is negative all along
            return np.full_like(r_d, np.nan)
        # At a fold r_d may be a rounding past the table.
        inside = (r_d >= r_table[0]) & (r_d <= r_table[-1] * (1.0 + 1e-15))
        s = np.interp(r_d, r_table, s_table)
        for _ in range(3):
            g, h = self.gain(s * s)
            s = s - (s * g - r_d) / (g + h * (s * s))
        g, _ = self.gain(s * s)
        poor = inside & ~(np.abs(s * g - r_d) <= 1e-15 * (1.0 + r_d))
        if poor.any():
            s[poor] = self._bisect(r_d[poor])
        return np.where(inside, s, np.nan)

    def _bisect(self, r_d: ndarray) -> ndarray:
        """s by Newton kept inside its cell of the table, where free Newton was not exact."""
        s_table, r_table = self._table
        cell = np.searchsorted(r_table, r_d).clip(1, len(r_table) - 1)
        low, high = s_table[cell - 1].copy(), s_table[cell].copy()
        s = 0.5 * (low + high)
        for _ in range(60):
            g, h = self.gain(s * s)
            excess = s * g - r_d
            low, high = np.where(excess <= 0, s, low), np.where(excess >= 0, s, high)
            newton_s = s - excess / (g + h * (s * s))
            s = np.where((newton_s >= low) & (newton_s <= high), newton_s, 0.5 * (low + high))
            if (high - low <= 4e-16 * high).all():
                break
        return s

    def beyond_image(self, x_d: ndarray, y_d: ndarray) -> ndarray:
        """Which places are certainly not in the image of the domain.

        They are farther out than any sample of it in about their direction.
        """
        farthest = self._farthest
        u_d = x_d * x_d + y_d * y_d
        beyond = ~(u_d <= farthest.min() ** 2)
        check = np.flatnonzero(beyond)
        beyond[check] = ~(np.sqrt(u_d[check]) <= farthest[_sector(x_d[check], y_d[check])])
        return beyond

    @cached_property
    def _farthest(self) -> ndarray:
        """How far the domain's image reaches in each sector, with a margin; infinite if not known."""
        ends = self.chart.angle(self.domain.ends)
        s = self.chart.radius(ends * np.linspace(0.0, 1.0 - 1e-12, 65)[:, None])
        with np.errstate(all="ignore"):
            x_d, y_d = (
                part.ravel()
                for part in self.warp(s * np.cos(self.domain.angles), s * np.sin(self.domain.angles))
            )
        reach = np.zeros(SECTOR_COUNT)
        np.maximum.at(reach, _sector(x_d, y_d), np.nan_to_num(np.hypot(x_d, y_d), nan=np.inf))
        reach[reach == 0] = np.inf
        return 1.05 * np.maximum(reach, np.maximum(np.roll(reach, 1), np.roll(reach, -1)))

    @cached_property
    def domain(self) -> Domain:
        """Where the lens has an image."""

        def folded(s: ndarray, cosine: ndarray, sine: ndarray) -> ndarray:
            with np.errstate(all="ignore"):
                at = self.linearise(s * cosine, s * sine)
                g, h = self.gain(s * s + 0.0 * cosine)
                # A radial curve that has come back through zero has folded, whatever its determinant says.
                whole = (determinant(at) > 0) & (g + h * (s * s) > 0) & np.isfinite(at.x) & np.isfinite(at.y)
                return ~whole & (s > self._hole)

        radii = self._radii(self._limit, CURVE_SAMPLES if self.radially_symmetric else CURVE_SAMPLES // 4)[1:]
        return find_domain(folded, radii, hole=self._hole, symmetric=self.radially_symmetric)

    @property
    def _limit(self) -> float:
        """The radius up to which the chart is looked at."""
        return float(self.chart.radius(np.float64(self.chart.reach - LEAST_GRAZING_ANGLE)))

    def _radii(self, end: float, samples: int = CURVE_SAMPLES) -> ndarray:
        """Radii from 0 to the end, dense at the axis, where most is seen, and at the end, where it bends."""
        t = np.linspace(0.0, 1.0, samples)
        return self.chart.radius(self.chart.angle(np.float64(end)) * t**3 * (10.0 + t * (6.0 * t - 15.0)))

    @cached_property
    def _hole(self) -> float:
        """Radius around the centre without image: 0 but for a curve that starts below zero (pfet, a0 < 0)."""
        radii = self._radii(self._limit)[1:]
        with np.errstate(all="ignore"):
            inside_out = ~(self.gain(radii * radii)[0] > 0)
        if not inside_out[0]:
            return 0.0
        if inside_out.all():
            return float(radii[-1])
        first = int(np.argmin(inside_out))
        low, high = radii[first - 1], radii[first]
        for _ in range(64):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.gain(np.full(1, middle * middle))[0][0] > 0 else (middle, high)
        return float(high)

    @cached_property
    def _table(self) -> tuple[ndarray, ndarray]:
        """Radii and their r_d >= 0 over the radial curve's domain."""
        with np.errstate(all="ignore"):
            s = self._radii(self.domain.outer if self.radially_symmetric else self._curve_end)
            s = np.concatenate([[self._hole], s[s > self._hole]])
            r = s * self.gain(s * s)[0]
            if np.isnan(r[0]):  # the limit at the centre of a curve that does not start at 0
                r[0] = TINY_RADIUS * self.gain(np.full(1, TINY_RADIUS * TINY_RADIUS))[0][0]
        usable = np.isfinite(r) & (r >= 0)
        return s[usable], r[usable]

    @cached_property
    def inverse_curve(self) -> Lookup:
        """The inverse of the radial curve, tabulated."""
        s_table, r_table = self._table
        middle = float(
            np.interp(min(float(self.chart.radius(MIDDLE_ANGLE)), 0.5 * s_table[-1]), s_table, r_table)
        )

        def ratio(u_d: ndarray) -> ndarray:
            with np.errstate(all="ignore"):
                r_d = np.maximum(np.sqrt(u_d), TINY_RADIUS)
                return self.invert_curve(r_d) / r_d

        return tabulated(ratio, end=float(r_table[-1] ** 2), last=float(s_table[-1]), middle=middle * middle)

    @property
    def _curve_end(self) -> float:
        """Where the radial curve of a lens with other terms too ends by itself."""
        radii = self._radii(self._limit)[1:]
        g, h = self.gain(radii * radii)
        bad = ~((g + h * radii * radii > 0) & (g > 0))
        return float(radii[bad.argmax() - 1] if bad.any() and bad.argmax() > 0 else radii[-1])


@dataclass(frozen=True, eq=False)
class Formula(Lens):
    """A lens whose coefficients are all there is to it: frozen dataclasses whose fields they are, in order.

    Attributes:
        starts: coefficients from which a fit may have to start to find its minimum.
        several_minima: whether a calibration has a minimum near more than one of them, each to be tried.
    """

    chart: ClassVar[Chart]  # type: ignore[misc]
    radially_symmetric: ClassVar[bool]  # type: ignore[misc]
    free: ClassVar[tuple[str, ...]]  # type: ignore[misc]
    starts: ClassVar[tuple[dict[str, float], ...]] = ({},)
    several_minima: ClassVar[bool] = False

    def __post_init__(self) -> None:
        frozen(
            [getattr(self, name) for name in self.names()], (None,), f"{type(self).__name__}: coefficients"
        )

    def __repr__(self) -> str:
        told = (f"{name}={value:.6g}" for name in self.names() if (value := getattr(self, name)))
        return f"{type(self).__name__}({', '.join(told)})"

    @classmethod
    @cache
    def names(cls) -> tuple[str, ...]:  # type: ignore[override]  # a formula's names are its kind's
        return tuple(field.name for field in fields(cls))

    @property
    def coefficients(self) -> Float[ndarray, " p"]:
        return np.array([getattr(self, name) for name in self.names()], dtype=float)

    def with_coefficients(self: AnyFormula, **values: float) -> AnyFormula:
        unknown = set(values) - set(self.names())
        if unknown:
            raise InputError(
                f"{type(self).__name__} has no coefficient {sorted(unknown)[0]!r}; it has"
                f" {', '.join(self.names())}."
            )
        return replace(self, **{name: float(value) for name, value in values.items()})


@dataclass(frozen=True, eq=False, repr=False)
class RadialLens(Formula):
    """A lens that is nothing but its curve: a subclass says `gain` and `gain_by`, the rest is here."""

    radially_symmetric: ClassVar[bool] = True

    @abstractmethod
    def gain_by(self, name: str, u: ndarray, g: ndarray) -> ndarray:
        """Derivative of the gain g at u by one coefficient."""

    def warp(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        g, _ = self.gain(x * x + y * y)
        return x * g, y * g

    def linearise(self, x: ndarray, y: ndarray, wanted: Sequence[str] = ()) -> Warp:
        u = x * x + y * y
        g, h = self.gain(u)
        h_xy = h * x * y
        by = [(x * slope, y * slope) for slope in (self.gain_by(name, u, g) for name in wanted)]
        return Warp(x * g, y * g, g + h * x * x, h_xy, h_xy, g + h * y * y, by)

    def unwarp(self, x_d: ndarray, y_d: ndarray) -> tuple[ndarray, ndarray]:
        if len(self._table[1]) == 0:  # a curve that is negative all along
            return np.full_like(x_d, np.nan), np.full_like(y_d, np.nan)
        u_d = x_d * x_d + y_d * y_d
        q = self.inverse_curve(u_d)
        u = q * q * u_d
        g, h = self.gain(u)
        step = (q * g - 1.0) / (g + h * u)
        q -= step
        poor = np.flatnonzero(
            ~((np.abs(step) <= LAST_NEWTON_STEP * q) & (u_d <= NEWTON_END_SHARE * self.inverse_curve.end))
        )
        q[poor] = self._exact_ratio(np.sqrt(u_d[poor]))
        return x_d * q, y_d * q

    def _exact_ratio(self, r_d: ndarray) -> ndarray:
        """s / r_d where the table is no good start.

        That is beside a fold, at the centre of a curve that has a corner there, and beyond the domain.
        """
        s = self.invert_curve(r_d)
        centre = r_d == 0
        return np.where(centre, np.where(s == 0, 1.0, np.nan), s / np.where(centre, 1.0, r_d))


def _sector(x: ndarray, y: ndarray) -> ndarray:
    """The number of the sector of directions that each place lies in."""
    turn = np.nan_to_num(np.arctan2(y, x) / (2.0 * np.pi) + 0.5)
    return (turn * SECTOR_COUNT).astype(np.int64) % SECTOR_COUNT
