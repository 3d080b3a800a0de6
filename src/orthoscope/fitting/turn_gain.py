"""May some views list a board's corners from its other end?  A quick look before all of them are asked.

As board_order.py has it, a view that lists its corners turned by g has the residual  y_j + A_j T_g x  for a
smooth shape x of the board.  With r_j = A_j'y_j, and the sum of A_j'A_j over all views taken as its mean over
all turns, G, turns g_j lower the cost by

    p'G^-1 p,      p = sum T_g' r_j,

and the best of them follow from products alone: each view takes the turn that its r_j likes best with the
others'.  What views see of the shape is taken for the same whichever way they list it, so the gain is not
exact, and the bar for it is low.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import POSE, Estimate, Places, Reprojection
from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["likely_turns"]

# A corner has so many coordinates.
SPACE = 3
# So many views are taken for the right one in turn.
START_VIEWS = 24
# The turns are improved in at most so many rounds.
ROUND_LIMIT = 20


def likely_turns(
    flat: Calibration, smooth: Float[ndarray, "p r"], shown: Sequence[Float[ndarray, "c c"]], prior: float
) -> tuple[Int[ndarray, " m"], float, float]:
    """The turn of each view that gains most, about by how much, and the noise, px^2 of a coordinate.

    Args:
        flat: a calibration with a flat target.
        smooth: shapes of the target, a column each.
        shown: what each turn shows of their 3r coefficients, the turn by nothing first.
        prior: 1 over the variance of a coefficient.
    """
    pulls, told, square = _sums(flat, smooth)
    freedom = 2 * flat.detections.corners - POSE * len(pulls) - len(flat.uncertainty.names)
    noise = square / max(freedom, 1)
    mean = np.mean([turned.T @ told @ turned for turned in shown], axis=0)
    roots = np.linalg.inv(np.linalg.cholesky(mean + noise * prior * np.eye(len(mean))))
    heard = np.stack([pulls @ turned @ roots.T for turned in shown])  # (g, m, c): their squares are gains
    starts = np.argsort(-(pulls**2).sum(1), kind="stable")[:START_VIEWS]
    sums, turns = heard[0, starts], np.zeros((len(starts), len(pulls)), dtype=np.int64)
    for _ in range(ROUND_LIMIT):
        before, turns = turns, (heard @ sums.T).argmax(0).T
        if (turns == before).all():
            break
        sums = np.sum([(turns == i) @ of_turn for i, of_turn in enumerate(heard)], axis=0)
    gains = (sums**2).sum(1)
    best = int(gains.argmax())
    return turns[best], float(gains[best] - (heard[0].sum(0) ** 2).sum()), noise


def _sums(
    flat: Calibration, smooth: Float[ndarray, "p r"]
) -> tuple[Float[ndarray, "m c"], Float[ndarray, "c c"], float]:
    """A_j'y_j of each view, A'A of all together, and |y|^2; c = 3r, the axes of each shape side by side."""
    points, (p, r) = flat.detections.target.points, smooth.shape
    observations = Observations.by_corner(flat.detections)
    estimate = Estimate(flat.camera, observations.poses_of(flat.camera_from_target))
    problem = Reprojection(observations, points, flat.camera)
    pulls, by_pose = np.empty((len(observations.order), r, SPACE)), []
    by_corner, square = np.zeros((SPACE, SPACE, p)), 0.0
    for chunk in observations.chunks():
        stacked, turn = problem.stack(estimate, chunk, Places(*points.T)), estimate.poses.rotation[chunk.rows]
        views = len(stacked)
        halves = stacked.reshape(views, POSE + 1, 2, p)
        # a corner moves its image as its view's translation does, turned into the target's frame
        products = np.einsum("vahp,vchp->vacp", halves[:, SPACE:POSE], halves)
        by_shape = (products.reshape(-1, p) @ smooth).reshape(views, SPACE, -1)
        by_shape = (
            (turn.transpose(0, 2, 1) @ by_shape).reshape(views, SPACE, POSE + 1, r).transpose(0, 3, 1, 2)
        )
        gram = stacked @ stacked.transpose(0, 2, 1)
        to_basis = np.linalg.inv(np.linalg.cholesky(gram[:, :-1, :-1])).transpose(0, 2, 1)
        poses, y = by_shape[..., :-1].reshape(views, -1, POSE) @ to_basis, gram[:, :-1, -1:]
        of_residual = to_basis.transpose(0, 2, 1) @ y
        pulls[chunk.rows] = by_shape[..., -1] - (poses @ of_residual).reshape(views, r, SPACE)
        square += float(gram[:, -1, -1].sum() - (of_residual**2).sum())
        by_pose.append(poses.transpose(1, 0, 2).reshape(SPACE * r, -1))
        pairs = turn[:, :, :, None, None] * turn[:, None, None]  # (v, b, a, c, d)
        turns = pairs.transpose(2, 4, 0, 1, 3).reshape(SPACE**2, -1)
        by_corner += (turns @ products[:, :, SPACE:POSE].reshape(-1, p)).reshape(SPACE, SPACE, p)
    told = (by_corner[:, :, None] * smooth.T) @ smooth  # (a, b, r, s)
    told = told.transpose(2, 0, 3, 1).reshape(SPACE * r, SPACE * r)
    poses = np.concatenate(by_pose, axis=1)
    return pulls.reshape(len(pulls), -1), told - poses @ poses.T, square
