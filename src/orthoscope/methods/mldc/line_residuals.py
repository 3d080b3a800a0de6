"""Straight lines have to be straight: the lens's own camera from rows and columns of corners, no sizes
needed.

A straight line of space is seen through a lens in the directions of one plane through the lens's centre, a
great circle
    P(t) = a cos t + b sin t,    n = a x b its normal,
and its image is the curve L lens(P(t)). The residual of a corner is its distance, in pixels of the
photograph, from the curve of its line; the foot t of each corner is found anew after every step, so that the
distance stands at right angles to the curve and its derivatives are those of the curve at fixed t. Each line
is a view block of two unknowns, rotations about a and about b.

Nothing is measured in the straight image. There, shrinking the image shortens every distance, and a lens
could gain by shrinking; here the size of the straight image does not occur. It is what straightness cannot
tell (lens_about_centre.py says how it is fixed).

A. Basu and S. Licardie, Alternative models for fish-eye lenses, PRL 16(4), 1995, took lines; distances in the
photograph as in F. Devernay and O. Faugeras, Straight lines have to be straight, MVA 13(1), 2001, but to the
curve itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from orthoscope.fitting.observations import Observations
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.methods.mldc.lines_in_views import SeenLines
from orthoscope.models.camera import Camera
from orthoscope.models.parameters import Parameters
from orthoscope.solve.block_system import NormalEquations
from orthoscope.solve.losses import Loss

__all__ = ["LinesOfSight", "Straightness"]

# A foot is given so many steps; each gains as many digits as the distance is short against the curve's
# radius.
FOOT_STEPS = 8
# A foot that moves less, radians, has been found: what is left to go is far less, and a distance is
# wrong by the square of that.
SETTLED_STEP = 1e-8
# Nothing of a camera is moved.
NO_PARAMETERS = Parameters(())
# A foot never moves farther at once than this, radians.
LONGEST_STRIDE = 0.3


class LinesOfSight(NamedTuple):
    """The unknowns: the lens's own camera, the frame [a b n] of each line, and the foot of each corner on it,
    radians.
    """

    camera: Camera
    frames: Float[ndarray, "l 3 3"]
    feet: Float[ndarray, " n"]


class Straightness:
    """The problem: distances, pixels, of corners from the images of straight lines, over the free parameters
    of the lens's own camera.

    Corners stand one line after the other; one that lies on a row and a column stands twice.
    """

    def __init__(self, pixels: Float[ndarray, "2 n"], line: Int[ndarray, " n"], free: Sequence[str]) -> None:
        """The problem for points of lines.

        Args:
            pixels: one line after the other.
            line: the number of each one's line, from 0 up without gaps.
            free: parameters of the lens's own camera.
        """
        self.parameters = Parameters.of(free)
        self.free = self.parameters.names
        self._line = line
        self._first = np.searchsorted(line, np.arange(line[-1] + 1))
        self.pixels = pixels

    @classmethod
    def of(cls, observations: Observations, lines: SeenLines, free: Sequence[str]) -> Self:
        """The problem for the rows and columns of a target."""
        line, place = np.nonzero(lines.present)
        row, column = lines.row[line], lines.column[line, place]
        return cls(np.stack([observations.u[row, column], observations.v[row, column]]), line, free)

    @property
    def measurements(self) -> int:
        """How many distances there are."""
        return self.pixels.shape[1]

    @property
    def lines(self) -> int:
        """How many lines there are."""
        return len(self._first)

    def start(self, camera: Camera) -> LinesOfSight:
        """Each line through the rays that the camera sees its corners along; NaN feet where it sees none."""
        rays = camera.unproject(self.pixels.T)
        if not np.isfinite(rays).all():
            return LinesOfSight(
                camera, np.broadcast_to(np.eye(3), (self.lines, 3, 3)), np.full(len(rays), np.nan)
            )
        scatter = self._sum((rays[:, :, None] * rays[:, None, :]).reshape(-1, 9).T).T.reshape(-1, 3, 3)
        axes = np.linalg.eigh(scatter)[
            1
        ]  # ascending: normal, across the middle, towards the middle of the line's rays
        a, n = axes[:, :, 2], axes[:, :, 0]
        frames = np.stack([a, np.cross(n, a), n], axis=-1)
        on_line = np.einsum("nij,ni->nj", frames[self._line], rays)
        return self._with_feet(LinesOfSight(camera, frames, np.arctan2(on_line[:, 1], on_line[:, 0])))

    def linearise(self, unknowns: LinesOfSight, loss: Loss) -> NormalEquations:
        """The solver's sums."""
        with np.errstate(all="ignore"):
            pixels, along, across, by_camera = self._curve(unknowns, self.parameters)
            normal = np.stack([-along[1], along[0]]) / np.hypot(*along)
            shared = (by_camera * normal).sum(1)
            tilt = (across * normal).sum(0)
            of_line = np.stack([tilt * np.sin(unknowns.feet), -tilt * np.cos(unknowns.feet)])
            residual = ((pixels - self.pixels) * normal).sum(0)
            squared = residual * residual
            cost = float(loss.cost(squared).sum())
            if (weight := loss.weight(squared)) is not None:
                root = np.sqrt(weight)
                shared, of_line, residual = shared * root, of_line * root, residual * root
        B = self._sum(shared[:, None] * of_line)
        C = self._sum(of_line[:, None] * of_line)
        c = self._sum(of_line * residual)
        return NormalEquations(
            cost, shared @ shared.T, shared @ residual, np.moveaxis(B, -1, 0), np.moveaxis(C, -1, 0), c.T
        )

    def move(
        self, unknowns: LinesOfSight, shared: Float[ndarray, " k"], views: Float[ndarray, "l 2"]
    ) -> LinesOfSight:
        """The unknowns after a step, the feet where they then belong."""
        camera, frames, feet = unknowns
        turned = rotation_from_vector(np.einsum("lij,lj->li", frames[:, :, :2], views)) @ frames
        return self._with_feet(LinesOfSight(self.parameters.moved(camera, shared), turned, feet))

    def _with_feet(self, unknowns: LinesOfSight) -> LinesOfSight:
        """The same with every foot moved to the place of its curve nearest to its corner."""
        for _ in range(FOOT_STEPS):
            with np.errstate(all="ignore"):
                pixels, along, *_ = self._curve(unknowns)
                step = (along * (pixels - self.pixels)).sum(0) / (along * along).sum(0)
                unknowns = unknowns._replace(
                    feet=unknowns.feet - np.clip(step, -LONGEST_STRIDE, LONGEST_STRIDE)
                )
            if not np.abs(step).max() > SETTLED_STEP:
                break
        return unknowns

    def _directions(
        self, unknowns: LinesOfSight
    ) -> tuple[Float[ndarray, "3 n"], Float[ndarray, "3 n"], Float[ndarray, "3 n"]]:
        """P of each foot, dP/dt and the normal of its line."""
        axes = np.ascontiguousarray(unknowns.frames.transpose(2, 1, 0))
        a, b, n = axes[:, :, self._line]
        cosine, sine = np.cos(unknowns.feet), np.sin(unknowns.feet)
        return a * cosine + b * sine, b * cosine - a * sine, n

    def _curve(
        self, unknowns: LinesOfSight, parameters: Parameters = NO_PARAMETERS
    ) -> tuple[Float[ndarray, "2 n"], Float[ndarray, "2 n"], Float[ndarray, "2 n"], Float[ndarray, "k 2 n"]]:
        """Pixels of the feet, their slopes along the curve, when P moves along the line's normal, by the
        parameters.
        """
        direction, onward, normal = self._directions(unknowns)
        image = unknowns.camera.linearise(direction, parameters)
        along, across = (
            np.stack([g[0] * v[0] + g[1] * v[1] + g[2] * v[2] for g in image.by_point])
            for v in (onward, normal)
        )
        return np.stack([image.u, image.v]), along, across, image.by_parameters()

    def _sum(self, terms: Float[ndarray, "*batch n"]) -> Float[ndarray, "*batch l"]:
        """Sums over the corners of each line."""
        return np.add.reduceat(terms, self._first, axis=-1)
