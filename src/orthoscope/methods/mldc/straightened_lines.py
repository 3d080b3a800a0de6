"""Straight lines as one measures them at first: distances in the straightened image.

Every corner is taken back through the lens, a line is fitted to those of a row or column, and the sum of the
squared distances from it is minimised over the lens (A. Basu and S. Licardie, Alternative models for fish-eye
lenses, PRL 16(4), 1995, as it is commonly read). With x = (X/Z, Y/Z) of the ray that the lens takes to a
corner's pixel, its slope by a parameter is -J^-1 dq/dparameter, J the slope of the pixel by x.

What is wrong with it: a lens that shrinks the straight image shortens all distances, and the noisier the
corners the more it pays. Lenses of few coefficients are bent by that (at 1 px of noise by ten times what the
noise itself does), `pfet` with all of its own then shrinks the image to a point. line_residuals.py measures
in the photograph, where the size of the straight image does not occur.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.observations import Observations
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.projective import fitted_lines
from orthoscope.methods.mldc.lines_in_views import SeenLines
from orthoscope.models.camera import Camera
from orthoscope.models.parameters import Parameters
from orthoscope.solve.block_system import NormalEquations
from orthoscope.solve.losses import Loss

__all__ = ["OwnCamera", "StraightenedLines", "by_lens", "distances"]


# A straight image that is smaller than this share of the photograph is no image of the lines any more.
SHRUNK_SHARE = 0.1


class OwnCamera(NamedTuple):
    """The unknown: the lens's own camera."""

    camera: Camera


class StraightenedLines:
    """The problem: distances of straightened corners from the lines nearest to them.

    They are in the unit of the photograph's pixels at the image's centre, as the camera that starts the
    search has them.
    """

    def __init__(self, observations: Observations, lines: SeenLines, free: Sequence[str]) -> None:
        self.parameters = Parameters.of(free)
        self.free = self.parameters.names
        self._present = lines.present
        seen = observations.present > 0
        self._detected = observations.pixels()[seen]
        number = np.cumsum(seen).reshape(seen.shape) - 1
        self._corner = number[lines.row[:, None], lines.column]  # of each place of each line

    @property
    def measurements(self) -> int:
        """How many distances there are."""
        return int(self._present.sum())

    @property
    def lines(self) -> int:
        """How many lines there are."""
        return len(self._present)

    def start(self, camera: Camera) -> OwnCamera:
        """The unknown from a camera."""
        return OwnCamera(camera)

    def shrinks(self, unknowns: OwnCamera) -> bool:
        """Whether the lens makes next to nothing of the straight image."""
        on_lines = self._detected[np.unique(self._corner[self._present])]
        straight = unknowns.camera.undistort_pixels(on_lines)
        return not np.ptp(straight, axis=0).max() > SHRUNK_SHARE * np.ptp(on_lines, axis=0).max()

    def linearise(self, unknowns: OwnCamera, loss: Loss) -> NormalEquations:
        """The solver's sums."""
        k, present = len(self.free), self._present
        camera, unit = unknowns.camera, float(max(unknowns.camera.image_size))
        with np.errstate(all="ignore"):
            rays = camera.unproject(self._detected)
            x = (rays[:, :2] / np.where(rays[:, 2:] > 0, rays[:, 2:], np.nan)).T
            slopes = by_lens(camera, x, self.parameters)
            places = np.concatenate([x[None], slopes])[:, :, self._corner] * (unit * present)
            residual, columns = (
                part[..., present] for part in distances_with(places[0], places[1:], present)
            )
            squared = residual * residual
            cost = float(loss.cost(squared).sum())
            if (weight := loss.weight(squared)) is not None:
                columns, residual = columns * np.sqrt(weight), residual * np.sqrt(weight)
        empty = np.empty((0, k, 0)), np.empty((0, 0, 0)), np.empty((0, 0))
        return NormalEquations(cost, columns @ columns.T, columns @ residual, *empty)

    def move(self, unknowns: OwnCamera, shared: Float[ndarray, " k"], views: ndarray) -> OwnCamera:
        """The unknown after a step."""
        return OwnCamera(self.parameters.moved(unknowns.camera, shared))


def by_lens(camera: Camera, x: Float[ndarray, "2 n"], parameters: Parameters) -> Float[ndarray, "k 2 n"]:
    """How straightened points move with parameters of the lens's own camera, where corners stay in the
    photograph.

    Args:
        x: the points, in the plane at distance 1.
    """
    image = camera.linearise((*x, np.ones_like(x[0])), parameters)
    (a, b, _), (c, d, _) = image.by_point
    by_u, by_v = np.moveaxis(image.by_parameters(), 1, 0)
    return -np.stack([d * by_u - b * by_v, a * by_v - c * by_u], axis=1) / (a * d - b * c)


def distances_with(
    points: Float[ndarray, "2 l w"], slopes: Float[ndarray, "k 2 l w"], present: ndarray
) -> tuple[Float[ndarray, "l w"], Float[ndarray, "k l w"]]:
    """Distances of points from the line nearest to them, as `distances`, and how they change with what moves
    the points.

    Args:
        points: of each line.
        slopes: of the points, by each parameter.
        present: (l,w) which of them there are.
    """
    line = fitted_lines(np.moveaxis(points, 0, -1), present.astype(float))
    (l_x, l_y), along, across = line.direction.T[:, :, None], line.along * present, line.across * present
    onward = slopes[:, 0] * l_x + slopes[:, 1] * l_y
    aside = slopes[:, 1] * l_x - slopes[:, 0] * l_y
    turn = (across * onward + along * aside).sum(-1) / line.gap
    own = aside - (aside.sum(-1) / present.sum(1))[..., None]
    return across, own - along * turn[..., None]


def distances(
    points: Float[ndarray, "l w 2"], present: ndarray
) -> tuple[Float[ndarray, "l w"], Float[ndarray, "l w w 2"]]:
    """Distances of points from the line nearest to them, for each of many lines, and their slopes by the
    points.

    The line through the mean runs along l, n is its normal, t and d are the parts of a point along and across
    it. When the points move, l turns towards n by the sum of (d l + t n) . dq over the points, divided by the
    gap; a distance then loses t times that.

    Args:
        points: of each line.
        present: (l,w) which of them there are.
    """
    present = present.astype(float)
    line = fitted_lines(points, present)
    normal = np.stack([-line.direction[:, 1], line.direction[:, 0]], axis=-1)
    along, across = line.along * present, line.across * present
    turn = (across[..., None] * line.direction[:, None] + along[..., None] * normal[:, None]) / line.gap[
        :, None, None
    ]
    own = present[:, :, None] * (
        np.eye(present.shape[1]) - present[:, None, :] / present.sum(1)[:, None, None]
    )
    return across, own[..., None] * normal[:, None, None] - along[:, :, None, None] * turn[:, None]
