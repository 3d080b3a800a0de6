"""The radial curve without a formula: how far out the lens puts what belongs at a radius, from planar grids.

About the centre a corner at radius r belongs, in the straight image of its view, at radius |(h_1, h_2) X| /
(h_3 X).
So the ratio of both,

    d = r (h_3 X) / |(h_1, h_2) X|,

is linear in the third row h_3 of the view's homography, three unknowns a view; and d is one function of r for
all views. No formula is needed: corners that lie at about the same radius, of whichever view, must have about
the same d. R. Hartley and S. B. Kang (PAMI 29(8), 2007) sort all corners by radius and let d differ as little
as possible from one to the next, a linear problem. Corners have noise, so here d is to be a straight line in
r^2 within each group of neighbours. Errors of d are those of pixels over r: rows are weighted by r. Together
with h_3 the curve has a scale, which K takes up; d is 1 on average.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.methods.radial_curve.radial_lines import GridView, radial_view

__all__ = ["RadialCurve", "curve_of_views"]

# A group has as many neighbours as this times the views, so that it holds corners of most of them; at least
# so many, and the corners make at least so many groups.
PER_VIEW, LEAST_GROUP, LEAST_GROUPS = 3, 16, 6


class RadialCurve(NamedTuple):
    """d at knots of the radius, with straight lines in r^2 between and beyond.

    Attributes:
        centre: pixels.
        squares: (k,) of the radii, pixels^2, ascending.
        ratios: (k,) d there: a radius of the photograph over that of the straight image.
    """

    centre: Float[ndarray, "2"]
    squares: Float[ndarray, " k"]
    ratios: Float[ndarray, " k"]

    def straightened(self, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        """Where these pixels belong in the straight image."""
        out = pixels - self.centre
        u = (out * out).sum(1)
        d = np.interp(u, self.squares, self.ratios)
        for past, (one, other) in ((u < self.squares[0], (0, 1)), (u > self.squares[-1], (-2, -1))):
            slope = (self.ratios[other] - self.ratios[one]) / (self.squares[other] - self.squares[one])
            d = np.where(past, self.ratios[one] + slope * (u - self.squares[one]), d)
        return self.centre + out / np.maximum(d, 1e-6)[:, None]


def curve_of_views(views: Sequence[GridView], centre: Float[ndarray, "2"]) -> RadialCurve:
    """The curve about a centre.

    Raises:
        CalibrationError: the corners are too few to be grouped.
    """
    rows, radius = _rows(views, centre)
    group = max(PER_VIEW * len(views), LEAST_GROUP)
    groups = max(len(radius) // group, LEAST_GROUPS)
    if len(radius) < 4 * groups or len(radius) - 2 * groups < 3 * len(views):
        raise CalibrationError(
            f"{len(radius)} corners of {len(views)} views are too few to tell a curve without a formula."
            " Take more photographs, or use fccm."
        )
    order = np.argsort(radius, kind="stable")
    parts = np.array_split(order, groups)
    deviations = np.concatenate([_off_line(rows[part], radius[part]) for part in parts])
    h = _least(deviations, (rows * radius[:, None]).sum(0) / radius.sum())
    d = rows @ h
    if not (d > 0).all():
        raise CalibrationError(
            "the corners do not agree on one radial curve: some would lie behind the camera. Check the order"
            " of the corners, or use fccm."
        )
    knots = [_line(d[part], radius[part]) for part in parts]
    squares, ratios = np.array(knots).T
    return RadialCurve(centre, squares, ratios)


def _rows(
    views: Sequence[GridView], centre: Float[ndarray, "2"]
) -> tuple[Float[ndarray, "n k"], Float[ndarray, " n"]]:
    """d = rows h for all corners, h the third rows of all views, and the corners' radii."""
    blocks, radii = [], []
    for number, view in enumerate(views):
        outwards = radial_view(view, centre).outwards
        radius = np.hypot(*(view.pixels - centre).T)
        block = np.zeros((len(radius), 3 * len(views)))
        ratio = radius / np.maximum(np.hypot(*outwards.T), 1e-12)
        block[:, 3 * number : 3 * number + 3] = ratio[:, None] * view.places
        blocks.append(block)
        radii.append(radius)
    return np.concatenate(blocks), np.concatenate(radii)


def _off_line(rows: Float[ndarray, "n k"], radius: Float[ndarray, " n"]) -> Float[ndarray, "n k"]:
    """What of a group's rows no straight line in r^2 explains, in pixels."""
    line = radius[:, None] * np.column_stack(
        [np.ones(len(radius)), radius**2 / max(float(radius[-1] ** 2), 1e-12)]
    )
    basis = np.linalg.qr(line)[0]
    weighted = rows * radius[:, None]
    return weighted - basis @ (basis.T @ weighted)


def _least(deviations: Float[ndarray, "n k"], scale: Float[ndarray, " k"]) -> Float[ndarray, " k"]:
    """The h with the least deviations whose scale @ h is 1."""
    R: ndarray = np.linalg.qr(deviations).R
    towards = np.linalg.lstsq(R.T, scale, rcond=None)[0]
    h = np.linalg.lstsq(R, towards, rcond=None)[0]
    return h / (scale @ h)


def _line(d: Float[ndarray, " n"], radius: Float[ndarray, " n"]) -> tuple[float, float]:
    """The middle of a group, r^2, and d there by its line."""
    squares, weight = radius**2, radius
    middle = float((weight * squares).sum() / weight.sum())
    columns = weight[:, None] * np.column_stack([np.ones(len(d)), squares - middle])
    return middle, float(np.linalg.lstsq(columns, weight * d, rcond=None)[0][0])
