"""How a camera scatters: what its own fit says of it, and what leaving views out says.

Covariances of a camera's unknowns (its named parameters, then its displacement's coefficients), all of
them by one linear step:

model      independent errors of corners, and the priors' own scatter: noise H^-1
prior      the second of these alone: noise H^-1 L H^-1
repeated   the first of these alone, `model` without the priors' part: noise H^-1 A'A H^-1, the scatter over
           photographs that are taken again, which is what can be sampled
alike      `model`, with errors that are alike within a view: smooth patterns of order 2, 3 and 4 over the
           board count tau_o times, as often as they are larger in the residuals than independent errors make
           them
stretch    what a stretch and a shear of the board by STRETCH_SHARE would do where no view shows them:
           boards that all stand upright leave the pixels' aspect to the board's, and of that the prior of
           its shape, found from finer patterns, says what it cannot know; it is in `prior` and in `alike`
jackknife  from how the camera moves when each view is left out (leave_one_out.py); it sees what lives in the
           camera itself, such as a focal length that breathes, and boards that bend from view to view

`alike` knows independent errors best and few views well; the jackknife holds whatever the errors are, but
leaves out what no view can show, so the priors' part is added to it.  Neither is ever too large by much, so
the larger of the two is believed (camera_error.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.leave_one_out import LeaveOneOut, say_of
from orthoscope.geometry.arrays import Float, evenly, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import polynomials

__all__ = [
    "ORDERS",
    "STRETCH_SHARE",
    "Likeness",
    "Scatter",
    "likenesses",
    "patterns_over_views",
    "scatter_of",
]

# Patterns over a board have these orders: a pose takes those below, and of those above errors are as good as
# independent.
ORDERS = (
    2,
    3,
    4,
)
# So many views tell how alike errors are.
VIEW_COUNT = 40
# What is left of a pattern after pose and patterns before it is rounding when it is no more than this share
# of its length.
THIN_SHARE = 1e-6
# No print is known to be truer along one side than along the other, or at right angles, than this share.
STRETCH_SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class Scatter:
    """What is known of how far a camera is from the true one, to first order.

    Attributes:
        camera: where its fit ended.
        names: of its k parameters that moved; the displacement's coefficients, along x and then along y, come
            after them.
        model, alike, prior: (d,d) covariances.
        stretch: (2,d) rows whose products sum to what is called so above.
        left_out: (m,d) rows whose products sum to the jackknife's covariance; NaN for views that the others
            cannot tell.
    """

    camera: Camera
    names: tuple[str, ...]
    model: Float[ndarray, "d d"]
    alike: Float[ndarray, "d d"]
    prior: Float[ndarray, "d d"]
    left_out: Float[ndarray, "m d"]
    stretch: Float[ndarray, "s d"]

    @cached_property
    def jackknife(self) -> Float[ndarray, "d d"]:
        """The jackknife's covariance, views that the others cannot tell left out."""
        known = self.left_out[np.isfinite(self.left_out).all(1)]
        return known.T @ known

    @property
    def repeated(self) -> Float[ndarray, "d d"]:
        """What independent errors of corners make alone."""
        return self.model - (self.prior - self.stretch.T @ self.stretch)

    @property
    def parameters(self) -> Float[ndarray, "k k"]:
        """Covariance of the named parameters: of each the larger deviation, correlated as the model says."""
        k = len(self.names)
        model = self.alike[:k, :k]
        of_model = np.sqrt(np.maximum(np.diag(model), 1e-300))
        by_views = np.sqrt(np.maximum(np.diag(self.jackknife + self.prior)[:k], 0.0))
        larger = np.maximum(by_views / of_model, 1.0)
        return model * larger * larger[:, None]


class Likeness(NamedTuple):
    """Of patterns of one order.

    Attributes:
        tau: 1 or more, how much larger they are in the residuals than independent errors would make them.
        moved: (m,d,c) how the camera moves by each of them, as errors of a view.
    """

    tau: float
    moved: Float[ndarray, "m d c"]


def scatter_of(fit: Linearised, left_out: LeaveOneOut, points: Float[ndarray, "p 3"]) -> Scatter:
    """The scatter of a camera that was fitted together with poses and shape.

    Args:
        points: the target's corners, nominal.
    """
    some = fit.only(evenly(fit.views, VIEW_COUNT))
    camera = np.zeros((fit.of_camera, fit.of_camera))
    for larger, moved in likenesses(some, patterns_over_views(some, points)):
        by_camera = moved.transpose(1, 0, 2).reshape(fit.of_camera, -1)
        camera += (larger - 1.0) * by_camera @ by_camera.T
    stretch = _by_stretch(fit, points)
    hidden = stretch.T @ stretch
    alike = fit.camera_covariance + fit.noise * fit.views / some.views * camera + hidden
    prior = fit.prior_covariance + hidden
    return Scatter(fit.camera, fit.names, fit.camera_covariance, alike, prior, left_out.scatter, stretch)


def _by_stretch(fit: Linearised, points: Float[ndarray, "p 3"]) -> Float[ndarray, "2 d"]:
    """Rows whose products are added to the camera's covariance where the shape's prior is no surer of stretch
    and shear than STRETCH_SHARE; nothing where views show them, or where the prior is no surer.

    W'x is how much of each mode there is, P what the prior knows of them, D what the views know, so that
    (W'H^-1 W)^-1 = D + P.  P - E in the place of P adds H^-1 W (E + E (D + P - E)^-1 E) W'H^-1.
    """
    r, surface = fit.slopes.sizes[2], fit.slopes.surface
    if not r or fit.noise <= 0.0:
        return np.zeros((2, fit.of_camera))
    seen = np.any(surface != 0.0, axis=1)
    (x, y), zero = ((points[:, :2] - points[seen, :2].mean(0)) * seen[:, None]).T, np.zeros(len(points))
    precision, W, known = fit.shape_precision[: 3 * r], np.zeros((fit.unknowns, 2)), np.zeros(2)
    for i, mode in enumerate((np.stack([x, -y, zero]), np.stack([y, x, zero]))):
        unit = np.linalg.lstsq(surface, 0.5 * mode.T, rcond=None)[0].ravel()
        known[i] = unit @ (precision * unit)
        W[fit.of_camera : fit.of_camera + 3 * r, i] = precision * unit / known[i]
    solved = fit.solved(W)
    excess = np.diag(np.maximum(known - fit.noise / STRETCH_SHARE**2, 0.0))
    by_views, vectors = np.linalg.eigh(np.linalg.inv(W.T @ solved) - np.diag(known))
    data = (vectors * np.maximum(by_views, 0.0)) @ vectors.T  # rounding may leave less than nothing
    added = excess + excess @ np.linalg.solve(data + np.diag(known) - excess, excess)
    sizes, vectors = np.linalg.eigh(0.5 * fit.noise * (added + added.T))
    return np.sqrt(np.maximum(sizes, 0.0))[:, None] * (solved[: fit.of_camera] @ vectors).T


def patterns_over_views(
    fit: Linearised, points: Float[ndarray, "p 3"], *, orders: Sequence[int] = ORDERS
) -> list[Float[ndarray, "_ _ _"]]:
    """Smooth patterns over the board, in u and in v, as weighted residuals of each view: orthonormal, pose
    and lower orders taken out.

    Args:
        points: the target's corners, nominal.
    Returns:
        For each order its patterns; those that a view's corners cannot show are 0 there.
    """
    seen = np.any(fit.root[:, : len(points)] > 0, axis=0)
    columns, sizes = [], []
    for order in orders:
        smooth = polynomials(points, seen, orders=(order,))
        zero = np.zeros_like(smooth)
        columns.append(np.block([[smooth, zero], [zero, smooth]]))
        sizes.append(columns[-1].shape[1])
    raw = fit.root[..., None] * np.concatenate(columns, axis=1)
    rows = fit.without_pose(raw)
    basis, triangle = np.linalg.qr(rows)
    kept = np.abs(np.diagonal(triangle, axis1=1, axis2=2)) > THIN_SHARE * np.sqrt((raw**2).sum(1))
    basis = fit.without_pose(basis * kept[:, None])
    return np.split(basis, np.cumsum(sizes)[:-1], axis=2)


def likenesses(fit: Linearised, patterns: Sequence[Float[ndarray, "_ _ _"]]) -> list[Likeness]:
    """Of each order's patterns, as `patterns_over_views` has them."""
    explained, moved = say_of(fit, np.concatenate(patterns, axis=2))
    own = np.diagonal(explained, axis1=1, axis2=2)
    ends = np.cumsum([rows.shape[2] for rows in patterns])[:-1]
    found = []
    for rows, share, by_rows in zip(patterns, np.split(own, ends, 1), np.split(moved, ends, 2), strict=True):
        in_residuals = ((fit.errors[:, None] @ rows) ** 2).sum()
        by_chance = fit.noise * float((rows**2).sum() - share.sum())
        found.append(Likeness(max(1.0, float(in_residuals) / max(by_chance, 1e-300)), by_rows))
    return found
