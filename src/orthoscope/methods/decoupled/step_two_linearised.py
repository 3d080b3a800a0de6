"""A formula from pairs, each view left out of both steps by one linear step.

Without view j step 1 moves by d_j (leave_one_out.py), the poses of the other views with it, and so the
corrected corners that the formula is fitted to; view j's own pairs are gone.  With T_i the slopes of the
formula's residuals by its parameters in view i, and D_i those by what step 1 found (corners, and the pose
that goes with them),

    (sum T'T - T_j'T_j) theta_j = T_j' r_j - (sum M - M_j) d_j,        M_i = T_i' D_i.

The formula's own scatter comes from errors of corners on both ways: through the pairs, and through step 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.slopes.residual_slopes import residual_slopes
from orthoscope.fitting.unseen.leave_one_out import LeaveOneOut, scattered
from orthoscope.fitting.unseen.near_copies import summed_over
from orthoscope.fitting.unseen.scatter import Scatter, likenesses, patterns_over_views
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.decoupled.step_one import StepOneFit
from orthoscope.methods.decoupled.step_one_linearised import roots_of
from orthoscope.models.camera import Camera

__all__ = ["PairsLeftOut"]


class PairsLeftOut:
    """A formula from the pairs of a fit of step 1, and what leaving each view out does to it.

    Args:
        fit, known, left_out: of step 1.
        camera: with the formula.
        free: its parameters that were fitted.
    """

    def __init__(
        self, fit: StepOneFit, known: Linearised, left_out: LeaveOneOut, camera: Camera, free: Sequence[str]
    ) -> None:
        self.camera, self.names, self._known, self._fit = camera, tuple(free), known, fit
        observations, points = fit.problem.measurements.observations, fit.problem.corners(fit.estimate)
        slopes, residual = residual_slopes(
            observations, camera, fit.estimate.poses, points, free, moves=bool(known.slopes.corner.shape[1])
        )
        root = roots_of(fit.loss, residual, observations.present)
        T = root[..., None] * slopes.camera.transpose(0, 2, 1)  # (m, n, f)
        self._T, self._gram = T, T.transpose(0, 2, 1) @ T
        self._by_shared, self._by_pose = self._steps_one(slopes.corner, slopes.pose, root)
        groups = left_out.groups
        without = self._gram.sum(0) - summed_over(groups, self._gram)
        right = summed_over(groups, (T * (root * residual)[..., None]).sum(1)) - np.einsum(
            "mfq,mq->mf", self._by_shared.sum(0) - summed_over(groups, self._by_shared), left_out.changes
        )
        self._groups = groups
        self.changes = np.linalg.solve(without, right[..., None])[..., 0]
        moved = residual + (slopes.camera.transpose(0, 2, 1) @ self.changes[..., None])[..., 0]
        if slopes.corner.shape[1]:
            moved += known.changes_by_shape(slopes.corner, left_out.changes[..., None])[..., 0]
        pose = np.linalg.qr(slopes.pose.transpose(0, 2, 1))[0]
        self.residuals = moved - (pose @ (pose.transpose(0, 2, 1) @ moved[..., None]))[..., 0]

    @property
    def squares(self) -> Float[ndarray, " m"]:
        """Of each view, left out, the sum of its squared residuals, px^2."""
        return (self.residuals**2).sum(1)

    def scatter(self) -> Scatter:
        """Of the formula's camera."""
        known, solved = self._known, np.linalg.inv(self._gram.sum(0))
        by_prior = -solved @ self._by_shared.sum(0)  # (f, q): what step 1's unknowns move
        back = known.solved(by_prior.T)  # H^-1 M'
        k, g, _, _ = known.slopes.sizes
        prior = back[k + 2 * g :].T @ (known.shape_precision[:, None] * back[k + 2 * g :])
        for i in (0, 1):
            part = back[k + i * g : k + (i + 1) * g]
            prior += part.T @ known.spline_precision @ part
        # by an error of each row: through its own pairs, through its own pose, and through step 1
        by_error = -solved @ (self._T.transpose(0, 2, 1) - self._by_pose) - known.moves(back).transpose(
            0, 2, 1
        )
        patterns = patterns_over_views(known, self._fit.problem.points)
        model = np.einsum("mfn,mgn->fg", by_error, by_error) + prior
        alike = model.copy()
        for rows, likeness in zip(patterns, likenesses(known, patterns), strict=True):
            through = by_error @ rows
            alike += (likeness.tau - 1.0) * np.einsum("mfc,mgc->fg", through, through)
        s2 = known.noise
        return Scatter(
            self.camera,
            self.names,
            s2 * model,
            s2 * alike,
            s2 * prior,
            scattered(self.changes, self._groups),
            np.zeros((0, len(model))),
        )

    def _steps_one(
        self, corner: ndarray, pose: ndarray, root: ndarray
    ) -> tuple[Float[ndarray, "m f q"], Float[ndarray, "m f n"]]:
        """M_i, and T_i' times how the formula's residuals move with the pose that an error of each row of
        step 1 gives its view.
        """
        known = self._known
        P = known.root[..., None] * known.slopes.pose.transpose(0, 2, 1)
        scale = np.maximum(np.sqrt((P**2).sum(1, keepdims=True)), 1e-300)
        to_pose = np.linalg.pinv(P / scale) / scale.transpose(0, 2, 1)  # (m, 6, n)
        weighted = self._T * root[..., None]
        by_pose = weighted.transpose(0, 2, 1) @ pose.transpose(0, 2, 1) @ to_pose  # (m, f, n)
        rows = by_pose.transpose(0, 2, 1) * known.root[..., None]
        by_shared = -known.gathered(rows)
        if corner.shape[1]:
            by_shared += known.gathered_by_shape(corner, weighted)
        return by_shared.transpose(0, 2, 1), by_pose
