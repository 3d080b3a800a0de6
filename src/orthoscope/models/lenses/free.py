"""A lens that no formula limits: a formula, and a spline displacement of its distorted plane on top.

(x_d, y_d) = b + s(b),  b = base(x, y). The displacement acts where the image is formed, so it needs no plane
through the rays: a base of the angle takes it past 90 degrees. J = (I + ds/db) J_base. Away from its lattice
s is zero and the lens its base. The camera's K and the base's coefficients say the same as some displacements
do; who fits them settles that by what a displacement costs (spline.py), so it has no part that K could take.
After M. Grossberg and S. Nayar's generic lenses and T. Schoeps et al., Why having 10,000 parameters in your
camera model is better than twelve, CVPR 2020, but as a difference to a formula.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.models.lenses.charts import Chart
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.newton_inverse import Bent, Warp, invert
from orthoscope.models.lenses.spline import Displacement

__all__ = ["FreeLens"]

# So many rounds of b <- (x_d, y_d) - s(b) give the inverse a start that is good to the third power of the
# displacement's slope.
BACK_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class FreeLens(Lens):
    """A formula, `base`, and a displacement of its distorted plane by bicubic splines, `over`; named
    coefficients are the formula's.

    Raises:
        InputError: the base is a free lens itself.
    """

    base: Lens
    over: Displacement

    def __post_init__(self) -> None:
        if isinstance(self.base, FreeLens):
            raise InputError(
                "the base of a free lens is a free lens; expected a formula. Add the two displacements into"
                " one."
            )

    def __repr__(self) -> str:
        columns, rows = self.over.lattice.shape
        return f"FreeLens({self.base!r}, {columns}x{rows} splines on top)"

    @property
    def chart(self) -> Chart:
        return self.base.chart

    @property
    def radially_symmetric(self) -> bool:
        return False

    @property
    def free(self) -> tuple[str, ...]:
        return self.base.free

    @property
    def coefficients(self) -> Float[ndarray, " p"]:
        return self.base.coefficients

    def names(self) -> tuple[str, ...]:
        return self.base.names()

    def with_coefficients(self, **values: float) -> FreeLens:
        return replace(self, base=self.base.with_coefficients(**values))

    def gain(self, u: ndarray) -> tuple[ndarray, ndarray]:
        return self.base.gain(u)

    def warp(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        b_x, b_y = self.base.warp(x, y)
        s = self.over.shift(b_x, b_y)
        return b_x + s[..., 0], b_y + s[..., 1]

    def linearise(self, x: ndarray, y: ndarray, wanted: Sequence[str] = ()) -> Warp:
        at = self.base.linearise(x, y, wanted)
        s, by_x, by_y = self.over.at(at.x, at.y)
        xx, xy, yx, yy = 1.0 + by_x[..., 0], by_y[..., 0], by_x[..., 1], 1.0 + by_y[..., 1]
        return Warp(
            at.x + s[..., 0],
            at.y + s[..., 1],
            xx * at.j_xx + xy * at.j_yx,
            xx * at.j_xy + xy * at.j_yy,
            yx * at.j_xx + yy * at.j_yx,
            yx * at.j_xy + yy * at.j_yy,
            [(xx * b_x + xy * b_y, yx * b_x + yy * b_y) for b_x, b_y in at.by],
            Bent(at.x, at.y, by_x[..., 0], by_y[..., 0], by_x[..., 1], by_y[..., 1]),
        )

    def unwarp(self, x_d: ndarray, y_d: ndarray) -> tuple[ndarray, ndarray]:
        b_x, b_y = x_d, y_d
        for _ in range(BACK_ROUNDS):
            s = self.over.shift(b_x, b_y)
            b_x, b_y = x_d - s[..., 0], y_d - s[..., 1]
        start = self.base.unwarp(b_x, b_y)
        outside = self.beyond_image(x_d, y_d)
        start[0][outside] = np.nan
        further = ~np.isfinite(start[0]) & ~outside  # the base ends here, this lens perhaps not yet
        if further.any():
            start[0][further], start[1][further] = 0.0, 0.0
        return invert(self.linearise, self.sees, start, (x_d, y_d))
