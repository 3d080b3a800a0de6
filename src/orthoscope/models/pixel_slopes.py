"""The image of points and how it moves: with the point, with K, with the lens, with the lens's frame.

P is a point in the camera frame, P' = M P the ray as the lens meets it, (x, y) = chart(P'), (x_d, y_d) =
lens(x, y) and (u, v) = L (x_d, y_d, 1). L is K and M the identity, unless the lens has a frame of its own:
then L is the frame and M = L^-1 K. Derivatives run backwards: a covector of the distorted plane through the
lens's Jacobian and the chart to d/dP', and M^T takes it to d/dP. An entry (a, b) of L moves component a of
the pixel by (x_d, y_d, 1)_b; in a frame of its own it also moves P' by -L^-1 e_a P'_b, and the same entry of
K then moves P' by L^-1 e_a P_b.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from orthoscope.geometry.arrays import ndarray
from orthoscope.models.lenses.charts import Covector
from orthoscope.models.lenses.newton_inverse import Bent
from orthoscope.models.parameters import FRAME, Parameters

if TYPE_CHECKING:
    from orthoscope.models.camera import Camera

__all__ = ["PixelSlopes"]

# Row and column in the matrix [fx skew cx; 0 fy cy; 0 0 1].
ENTRIES = {"fx": (0, 0), "fy": (1, 1), "cx": (0, 2), "cy": (1, 2), "skew": (0, 1)}


class PixelSlopes:
    """Pixels of points, and their slopes.

    Args:
        camera: that sees them.
        points: X, Y and Z in the camera frame, arrays of one shape, any unit.
        parameters: whose slopes may be asked for.
    """

    def __init__(self, camera: Camera, points: Iterable[ndarray], parameters: Parameters) -> None:
        X, Y, Z = points
        self._point, self._parameters = (X, Y, Z), parameters
        self._frame = camera.lens_frame or camera.intrinsics
        self._turn, self._ray = None, self._point
        if camera.lens_frame is not None:
            self._turn = t = np.linalg.solve(self._frame.matrix, camera.intrinsics.matrix)
            self._ray = tuple(t[i, 0] * X + t[i, 1] * Y + t[i, 2] * Z for i in range(3))
        x, y, self._pull_back = camera.lens.chart.linearise(*self._ray)
        self._at = camera.lens.linearise(x, y, parameters.coefficients)
        self._by_lens = dict(zip(parameters.coefficients, self._at.by, strict=True))
        self.u, self.v = self._frame.pixel(self._at.x, self._at.y)

    @cached_property
    def by_ray(self) -> tuple[Covector, Covector]:
        """d/dP' of u and of v: by the ray in the lens's own frame."""
        at, L = self._at, self._frame
        u_x, u_y = L.fx * at.j_xx, L.fx * at.j_xy
        if L.skew:
            u_x, u_y = u_x + L.skew * at.j_yx, u_y + L.skew * at.j_yy
        return self._pull_back(u_x, u_y), self._pull_back(L.fy * at.j_yx, L.fy * at.j_yy)

    @cached_property
    def by_point(self) -> tuple[Covector, Covector]:
        """d/dP of u and of v: by the point in the camera frame."""
        if self._turn is None:
            return self.by_ray
        t = self._turn
        of_u, of_v = (
            tuple(t[0, i] * g[0] + t[1, i] * g[1] + t[2, i] * g[2] for i in range(3)) for g in self.by_ray
        )
        return of_u, of_v  # type: ignore[return-value]  # three each

    def write(self, i: int, u: ndarray, v: ndarray) -> None:
        """Write d(u, v) by parameter i into two arrays of the points' shape."""
        first, *others = self._parameters.groups[i]
        u[...], v[...] = self._by(first)
        for name in others:
            by_u, by_v = self._by(name)
            u += by_u
            v += by_v

    def by_parameters(self) -> ndarray:
        """(k, 2, *shape): d(u, v) by each parameter."""
        slopes = np.empty((len(self._parameters), 2, *np.shape(self.u)))
        for i, (u, v) in enumerate(slopes):
            self.write(i, u, v)
        return slopes

    def _by(self, name: str) -> tuple[ndarray | float, ndarray | float]:
        """d(u, v) by one name, numbers where it is the same everywhere."""
        if name in self._by_lens:
            x, y = self._by_lens[name]
            u = self._frame.fx * x
            return (u + self._frame.skew * y if self._frame.skew else u), self._frame.fy * y
        if name in FRAME:
            parts = [self._by_frame(entry) for entry in FRAME[name]]
            return sum(u for u, _ in parts), sum(v for _, v in parts)
        if self._turn is None:
            u, v = self._by_entry(name)
            if self._at.bent is None:
                return u, v
            carried_u, carried_v = self._carried(name, self._at.bent)
            return u + carried_u, v + carried_v
        return self._by_turn(name, self._point)

    def _carried(self, entry: str, bent: Bent) -> tuple[ndarray, ndarray]:
        """By an entry of K through a displacement alone: it stands in the image, K moves the plane below.

        Skew moves nothing there: a lattice is shifted and stretched with the image, not sheared.
        """
        L, (row, column) = self._frame, ENTRIES[entry]
        moved = 0.0 if entry == "skew" else (bent.x, bent.y, 1.0)[column]
        x, y = (moved / L.fx, 0.0) if row == 0 else (0.0, moved / L.fy)
        s_x, s_y = bent.s_xx * x + bent.s_xy * y, bent.s_yx * x + bent.s_yy * y
        return L.fx * s_x + L.skew * s_y, L.fy * s_y

    def _by_frame(self, entry: str) -> tuple[ndarray, ndarray]:
        """By an entry of a frame of the lens's own."""
        (u, v), (back_u, back_v) = self._by_entry(entry), self._by_turn(entry, self._ray)
        return u - back_u, v - back_v

    def _by_entry(self, entry: str) -> tuple[ndarray | float, ndarray | float]:
        """By an entry of L, the distorted place held."""
        row, column = ENTRIES[entry]
        moved = (self._at.x, self._at.y, 1.0)[column]
        return (moved, 0.0) if row == 0 else (0.0, moved)

    def _by_turn(self, entry: str, moving: tuple[ndarray, ...]) -> tuple[ndarray, ndarray]:
        """By P' as it moves along L^-1 e_a times a coordinate."""
        row, column = ENTRIES[entry]
        u, v = self._by_row[row]
        return u * moving[column], v * moving[column]

    @cached_property
    def _by_row(self) -> list[tuple[ndarray, ndarray]]:
        """d(u, v) by P' along L^-1 e_1 and along L^-1 e_2."""
        L, ((u_x, u_y, _), (v_x, v_y, _)) = self._frame, self.by_ray
        first = u_x / L.fx, v_x / L.fx
        across = L.skew / (L.fx * L.fy)
        return [first, (u_y / L.fy - u_x * across, v_y / L.fy - v_x * across)]
