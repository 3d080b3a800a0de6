"""The paper's eq. (7) as it stands: corrected points and pin-hole searched for together.

The unknowns are K, the poses R_j, t_j and, of every view, the n corrected points q.  Minimised is
J = w_PH J_PH + w_CR J_CR + w_ST J_ST:

    J_PH  (4)  sum |g(K, R_j, t_j, p) - q|^2              the points are where the pin-hole sees the target
    J_CR  (5)  sum (CR(q1, q2, q3, q4) - CR(p1, p2, p3, p4))^2   four corners of a row or column keep the
                                                          cross-ratio that they have on the target
    J_ST  (6)  sum (a u + b v + c)^2, a^2 + b^2 = 1       points of a row or column lie on the line that is
                                                          nearest to them

The line is refitted wherever J is evaluated, and moves with its points in the derivatives. The paper does not
print which of the six cross-ratios CR is, nor in what unit; here it is 4/3 for equal distances
(projective.py), a bare number beside distances in pixels. A view is one block of 6 + 2n unknowns: its pose,
then u, v of each point. Of a partial or thinned board every four consecutive corners of a line that were
seen take part, neighbours or not: the target tells the cross-ratio of any four.

**J does not determine the camera.**  The detected corners are in no term; they are only where the search for
q starts. For any K, R_j, t_j the points q = g(K, R_j, t_j, p) make all terms 0. So the minimum is a manifold
with as many dimensions as the pin-hole and its poses have parameters, 5 + 6m for m views, and which of its
members is found depends on the start, the weights and the damping. docs/paper.md has the experiment, and what
is wrong with the paper's count of residuals, eq. (8).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.observations import Observations, Poses
from orthoscope.fitting.reprojection import POSE, Estimate
from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.geometry.projective import cross_ratio, cross_ratio_slope
from orthoscope.methods.mldc.lines_in_views import SeenLines
from orthoscope.methods.mldc.straightened_lines import distances
from orthoscope.models.parameters import Parameters
from orthoscope.solve.block_system import NormalEquations
from orthoscope.solve.losses import Loss
from orthoscope.targets.target import Target

__all__ = ["CorrectedPoints", "Eq7"]


class CorrectedPoints(NamedTuple):
    """The unknowns: the pin-hole with its poses, and q of the table's corners (0 in its padding)."""

    pinhole: Estimate
    q: Float[ndarray, "m n 2"]


class Terms(NamedTuple):
    """Residuals of the lines, (l, r), and their derivatives by the points of each, (l, r, w, 2)."""

    residual: Float[ndarray, "l r"]
    slope: Float[ndarray, "l r w 2"]


class Eq7:
    """The problem of eq. (7); weights: of J_PH, J_CR and J_ST.

    Raises:
        InputError: weights that leave the points free.
    """

    def __init__(
        self,
        observations: Observations,
        target: Target,
        free: Sequence[str],
        *,
        weights: Sequence[float] = (1.0, 1.0, 1.0),
    ) -> None:
        if len(weights) != 3 or not all(0 <= weight < np.inf for weight in weights) or not weights[0] > 0:
            raise InputError(
                f"weights are {tuple(weights)}; expected three numbers from 0 up, for J_PH (more than 0),"
                " J_CR and J_ST."
            )
        self.parameters = Parameters.of(free)
        self._weights = tuple(map(float, weights))
        self._present = observations.present
        self._points = target.points[observations.ids]
        self._lines = lines = SeenLines.of(observations, target)
        self._runs = lines.present[:, 3:]  # which four consecutive seen corners of a line there are, (l, r)
        with np.errstate(invalid="ignore", divide="ignore"):  # in the padding
            self._ratio = cross_ratio(_fours(self._points[lines.row[:, None], lines.column, :2]))
        # Where the unknowns of each line stand in c of all views, and each pair of them in C, laid out flat.
        width = POSE + 2 * self._present.shape[1]
        of_line = (POSE + 2 * lines.column[..., None] + np.arange(2)).reshape(len(lines.row), -1)
        of_view = lines.row[:, None] * width + of_line
        self._in_c = of_view.ravel()
        self._in_C = (of_view[:, :, None] * width + of_line[:, None, :]).ravel()

    def start(self, pinhole: Estimate, observations: Observations) -> CorrectedPoints:
        """The paper's start: the pin-hole given, the points where the corners were detected."""
        return CorrectedPoints(pinhole, observations.pixels())

    @property
    def counts(self) -> tuple[int, int, int]:
        """How many residuals J_PH, J_CR and J_ST have."""
        return 2 * int(self._present.sum()), int(self._runs.sum()), int(self._lines.present.sum())

    def terms(self, unknowns: CorrectedPoints) -> tuple[float, float, float]:
        """J_PH, J_CR and J_ST, without their weights."""
        residual = self._of_pinhole(unknowns)[2]
        across, ratios = self._straightness(unknowns.q).residual, self._cross_ratios(unknowns.q).residual
        return float((residual**2).sum()), float((ratios**2).sum()), float((across**2).sum())

    def linearise(self, unknowns: CorrectedPoints, loss: Loss) -> NormalEquations:
        """The solver's sums; the loss is not asked, since no residual here is a measurement."""
        of_pinhole, of_ratio, of_line = self._weights
        with np.errstate(all="ignore"):
            by_camera, by_pose, residual = self._of_pinhole(unknowns)
            m, n = self._present.shape
            k, width = len(self.parameters), POSE + 2 * n
            S, V, e = (
                by_camera.reshape(m, k, 2 * n),
                by_pose.reshape(m, POSE, 2 * n),
                residual.reshape(m, 2 * n),
            )
            A, a = (
                of_pinhole * (S @ S.transpose(0, 2, 1)).sum(0),
                of_pinhole * (S @ e[:, :, None]).sum(0)[:, 0],
            )
            B = of_pinhole * np.concatenate([S @ V.transpose(0, 2, 1), -S], axis=2)
            C, c = np.zeros((m, width, width)), np.empty((m, width))
            C[:, :POSE, :POSE], C[:, :POSE, POSE:] = of_pinhole * V @ V.transpose(0, 2, 1), -of_pinhole * V
            C[:, POSE:, :POSE] = C[:, :POSE, POSE:].transpose(0, 2, 1)
            C[:, range(POSE, width), range(POSE, width)] = of_pinhole
            c[:, :POSE], c[:, POSE:] = of_pinhole * (V @ e[:, :, None])[:, :, 0], -of_pinhole * e
            cost = of_pinhole * float((e * e).sum())
            for weight, terms in (
                (of_ratio, self._cross_ratios(unknowns.q)),
                (of_line, self._straightness(unknowns.q)),
            ):
                cost += weight * float((terms.residual**2).sum())
                self._add(C, c, weight, terms)
        return NormalEquations(cost, A, a, B, C, c)

    def move(
        self, unknowns: CorrectedPoints, shared: Float[ndarray, " k"], views: Float[ndarray, "m p"]
    ) -> CorrectedPoints:
        """The unknowns after a step."""
        (camera, poses), q = unknowns
        rotation = rotation_from_vector(views[:, :3]) @ poses.rotation
        moved = Estimate(
            self.parameters.moved(camera, shared), Poses(rotation, poses.translation + views[:, 3:POSE])
        )
        return CorrectedPoints(moved, q + views[:, POSE:].reshape(q.shape))

    def _of_pinhole(
        self, unknowns: CorrectedPoints
    ) -> tuple[Float[ndarray, "m k n 2"], Float[ndarray, "m 6 n 2"], Float[ndarray, "m n 2"]]:
        """d g / d K, d g / d pose and g - q; 0 in the padding."""
        (camera, poses), q = unknowns
        turned = self._points @ np.swapaxes(poses.rotation, 1, 2)
        image = camera.linearise(np.moveaxis(turned + poses.translation[:, None], -1, 0), self.parameters)
        by_point = np.array(image.by_point)  # (2, 3, m, n)
        by_turn = np.cross(np.moveaxis(turned, -1, 0)[None], by_point, axis=1)
        by_pose = np.concatenate([by_turn, by_point], axis=1).transpose(2, 1, 3, 0)
        by_camera = image.by_parameters().transpose(2, 0, 3, 1)
        present = self._present[..., None]
        return (
            by_camera * present[:, None],
            by_pose * present[:, None],
            (np.stack([image.u, image.v], axis=-1) - q) * present,
        )

    def _cross_ratios(self, q: Float[ndarray, "m n 2"]) -> Terms:
        """J_CR's: of every four consecutive seen corners of a line."""
        fours = _fours(self._on_lines(q))
        lines, runs = self._runs.shape
        with np.errstate(invalid="ignore", divide="ignore"):  # in the padding
            residual = np.where(self._runs, cross_ratio(fours) - self._ratio, 0.0)
            of_four = np.where(self._runs[..., None, None], cross_ratio_slope(fours), 0.0)
        slope = np.zeros((lines, runs, runs + 3, 2))
        for i in range(4):
            slope[:, np.arange(runs), np.arange(runs) + i] = of_four[:, :, i]
        return Terms(residual, slope)

    def _straightness(self, q: Float[ndarray, "m n 2"]) -> Terms:
        """J_ST's: distances across the line nearest to its points."""
        return Terms(*distances(self._on_lines(q), self._lines.present))

    def _on_lines(self, q: Float[ndarray, "m n 2"]) -> Float[ndarray, "l w 2"]:
        return q[self._lines.row[:, None], self._lines.column]

    def _add(self, C: Float[ndarray, "m p p"], c: Float[ndarray, "m p"], weight: float, terms: Terms) -> None:
        """Adds D^T D and D^T r of the lines to the blocks of their views."""
        D = terms.slope.reshape(*terms.residual.shape, -1)
        turned = weight * D.transpose(0, 2, 1)
        C += np.bincount(self._in_C, (turned @ D).ravel(), C.size).reshape(C.shape)
        c += np.bincount(self._in_c, (turned @ terms.residual[:, :, None]).ravel(), c.size).reshape(c.shape)


def _fours(points: Float[ndarray, "l w 2"]) -> Float[ndarray, "l r 4 2"]:
    """Every four consecutive points of lines; none where all lines are shorter."""
    if points.shape[1] < 4:
        return np.empty((len(points), 0, 4, 2))
    return np.lib.stride_tricks.sliding_window_view(points, 4, axis=1).transpose(0, 1, 3, 2)
