"""Do the photographs agree on one camera?  A test of what each of them would have liked K to be.

A lens that zooms or focuses between photographs, a stabiliser, a rolling shutter, two cameras in one folder:
in each view the residuals then ask for another K.  With the fit linearised (linearised.py), C_j what
a few changes of K do to the residuals of view j, its pose fitted, B_j what its own say in the fit explains,
s2 the noise:

    T_j = C_j'(I - B_j) C_j,    s_j = C_j'e_j,    the view's wish  kappa_j = -T_j^-1 s_j,
    F = sum s_j'T_j^+ s_j / (s2 sum rank T_j)

F is far above 1 on photographs that agree, since the errors of one view are alike (boards bend from view to
view, and what bends is of the second order).  So it is divided by how far the views' residuals follow second-
order patterns of the board that no change of K makes: tau, the same ratio for these patterns, C_j projected
out.  F2 = F / max(1, tau) has Fisher's distribution where views agree but bend.  The fit must be the one with
every corner free and a free lens: else the target's shape, which each view sees from another side, is taken
for a camera that changes.

How much the camera changes is the spread of the wishes without their noise: kappa_j ~ N(0, S), S by
expectation maximisation, and the rms movement of the image that S makes, a rotation fitted out.  A shutter
that reads row after row shears the image, which is no change of K, and is tested in the same way.  The focal
length alone and the principal point alone are tested too: one wish out of many stands out more by itself.

What changes is named where it stands out: the F2 of the focal length, of the principal point, of the lens's
first coefficient or of the shear is NAMED_MARGIN times that of any other.  What none of them explains by
itself has no name, and is `mixed`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.misfit.f_distribution import f_survival
from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.leave_one_out import say_of
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.difference import image_difference
from orthoscope.models.parameters import Parameters
from orthoscope.targets.detections import Detections

__all__ = [
    "AGREED",
    "Disagreement",
    "Views",
    "Wishes",
    "changes_of",
    "disagreement",
    "spread_of",
    "wishes",
    "with_spread",
]

# A change of K that counts as 1 is this share of the focal length or of the image's width.
STEP_SHARE = 0.01
# An eigenvalue of T_j below this share of the largest is no wish.
FAINT_WISH_SHARE = 1e-3
# A pattern with a singular value below this, C_j projected out, is one that K makes too.
LEAST_OWN_SINGULAR_VALUE = 0.3
# Views do not agree when F2 is above this and p is below DISAGREEING_P_VALUE.
LARGE_F2 = 3.0
# Four tests share the chance, and real boards flex in more ways than the patterns of the null: with 1e-4 one
# clean real set in ten was blamed.
DISAGREEING_P_VALUE = 1e-6
# With fewer views it cannot be told whether they agree.
FEWEST_TESTED_VIEWS = 5
# Columns: scale, cx, cy, the shears of a shutter, and the lens's first coefficient, where there is one.
KINDS = {"zoom": [0], "centre": [1, 2], "shutter": [3, 4], "lens": [5]}
# These kinds are tested; a lens that changes shows in K as well, and is only named.
TESTED_KINDS = ("zoom", "centre", "shutter")
# What stands out no more than so many times as much as anything else has no name.
NAMED_MARGIN = 1.4
# Expectation maximisation has so many rounds.
SPREADING_ROUNDS = 200
# An image's movement is looked at in so many pixels.
SAMPLE_COUNT = 300


class Wishes(NamedTuple):
    """What each of m views would have liked c changes of K to be.

    Attributes:
        kappa: (m,c) the wish, in the changes' own steps; 0 where the view has none.
        told: (m,c,c) T_j over the noise and tau: the inverse of the wish's covariance.
        f2: F over max(1, tau).
        p_value: of f2.
        tau: how alike errors within a view are.
    """

    kappa: Float[ndarray, "m c"]
    told: Float[ndarray, "m c c"]
    f2: float
    p_value: float
    tau: float

    @property
    def certain(self) -> bool:
        """Whether the views surely differ."""
        return self.f2 > LARGE_F2 and self.p_value < DISAGREEING_P_VALUE

    @property
    def spread(self) -> Float[ndarray, "c c"]:
        """Covariance of the wishes without their noise."""
        return spread_of(-(self.told @ self.kappa[..., None])[..., 0], self.told)


@dataclass(frozen=True, eq=False)
class Disagreement:
    """Whether photographs agree on one camera.

    Attributes:
        f2, p_value: of the test; NaN where the views do not suffice for one.
        certain: whether they surely do not.
        kind: what changes between them: `zoom`, `centre`, `lens`, `shutter`, or `mixed` where none stands
            out; empty where they agree.
        by_px: how far the image moves from photograph to photograph, rms over the seen pixels and the
            photographs, after a rotation; 0 where it is one and the same camera, whose image was sheared.
        focal: standard deviation of the focal length over photographs, as a share of it.
        centre_px: standard deviation of the principal point, pixels.
        wishes: of scale, cx and cy, and of k1 where the lens changes; None where there was no test, or it was
            read from a file.
    """

    f2: float
    p_value: float
    certain: bool
    kind: str
    by_px: float
    focal: float
    centre_px: float
    wishes: Wishes | None = None


AGREED = Disagreement(float("nan"), float("nan"), False, "", 0.0, 0.0, 0.0)


def disagreement(fit: Linearised, detections: Detections) -> Disagreement:
    """Whether the views of a fit agree on one camera.

    Args:
        fit: with every corner free and a free lens, of these detections.
    """
    names, changes = changes_of(fit)
    points = detections.target.points
    if fit.views < FEWEST_TESTED_VIEWS or len(names) < 3:
        return AGREED
    shears = fit.without_pose(fit.root[..., None] * _shears(detections))
    of_lens = changes_of(fit, ("k1",))[1][:, len(names) :]
    moves = np.concatenate([fit.moves(changes), shears, fit.moves(of_lens)], axis=2)
    views = Views.of(fit, points, moves)
    of_K = wishes(views, range(len(names)))
    by_kind = {
        kind: wishes(views, columns) for kind, columns in KINDS.items() if columns[-1] < moves.shape[2]
    }
    tests = [of_K, *(by_kind[kind] for kind in TESTED_KINDS)]
    strongest = min(tests, key=lambda test: (not test.certain, test.p_value))
    if not strongest.certain:
        return replace(AGREED, f2=of_K.f2, p_value=of_K.p_value, wishes=of_K)
    kind = _kind(by_kind)
    of_camera = wishes(views, [0, 1, 2, 5]) if kind == "lens" else of_K
    found = Disagreement(strongest.f2, strongest.p_value, True, kind, 0.0, 0.0, 0.0, of_camera)
    sure = any(test.certain for test in (of_K, by_kind["zoom"], by_kind["centre"]))
    if kind == "shutter" or (kind == "mixed" and not sure):
        return found
    return with_spread(found, fit, detections)


def with_spread(found: Disagreement, fit: Linearised, detections: Detections) -> Disagreement:
    """By how much the cameras of views that differ do so.

    Args:
        fit, detections: that were tested.
    """
    if found.wishes is None:
        return found
    spread, width = found.wishes.spread, fit.camera.image_size[0]
    changes = changes_of(fit, ("k1",))[1][:, : len(spread)]
    pixels = np.concatenate([view.pixels for view in detections.views])
    return replace(
        found,
        by_px=_movement(fit, changes, spread, pixels),
        focal=STEP_SHARE * float(np.sqrt(spread[0, 0])),
        centre_px=STEP_SHARE * width * float(np.sqrt(spread[1, 1] + spread[2, 2])),
    )


def changes_of(fit: Linearised, more: tuple[str, ...] = ()) -> tuple[tuple[str, ...], Float[ndarray, "q c"]]:
    """The changes of the camera that a view may wish for, as steps of a fit's unknowns, and their names.

    Args:
        more: names of coefficients beside scale, cx and cy, each with a step of its own size, where the fit
            has them.
    """
    K, width = fit.camera.intrinsics, fit.camera.image_size[0]
    parts = [name.split("=") for name in fit.names]
    scale = {i: STEP_SHARE * getattr(K, part[0]) for i, part in enumerate(parts) if part[0] in ("fx", "fy")}
    steps: dict[str, dict[int, float]] = {"scale": scale} if scale else {}
    for name in ("cx", "cy"):
        if [name] in parts:
            steps[name] = {parts.index([name]): STEP_SHARE * width}
    steps |= {name: {parts.index([name]): STEP_SHARE} for name in more if [name] in parts}
    changes = np.zeros((fit.unknowns, len(steps)))
    for column, step in enumerate(steps.values()):
        changes[list(step), column] = list(step.values())
    return tuple(steps), changes


class Views(NamedTuple):
    """What is asked of the views of a fit.

    Attributes:
        moves: (m,n,c) C_j of all changes, weighted residuals with the pose of each view fitted.
        patterns: (m,n,6) second-order patterns of the board, of length 1, as these.
        told: (m,c+6,c+6) R_j'(I - B_j) R_j of both, R_j, side by side.
        errors: (m,n) e_j.
        noise: px^2 of a coordinate.
    """

    moves: Float[ndarray, "m n c"]
    patterns: Float[ndarray, "m n p"]
    told: Float[ndarray, "m d d"]
    errors: Float[ndarray, "m n"]
    noise: float

    @classmethod
    def of(cls, fit: Linearised, points: Float[ndarray, "p 3"], moves: Float[ndarray, "m n c"]) -> Views:
        """points: the target's corners, metres."""
        x, y = (points[:, :2] - points[:, :2].mean(0)).T / max(float(np.ptp(points[:, :2])), 1e-300)
        shapes, zero = np.stack([x * x, x * y, y * y], axis=1), np.zeros((len(points), 3))
        patterns = fit.without_pose(fit.root[..., None] * np.block([[shapes, zero], [zero, shapes]]))
        patterns = patterns / _lengths(patterns)
        both = np.concatenate([moves, patterns], axis=2)
        told = both.transpose(0, 2, 1) @ both - say_of(fit, both)[0]
        return cls(moves, patterns, 0.5 * (told + told.transpose(0, 2, 1)), fit.errors, fit.noise)


def wishes(views: Views, changes: Sequence[int]) -> Wishes:
    """What the views wish of some of the changes, and whether the wishes differ."""
    some = list(changes)
    moves, told = views.moves[:, :, some], views.told[:, some][:, :, some]
    score = (moves * views.errors[..., None]).sum(1)
    inverse, rank = _pseudo_inverse(told)
    kappa = -(inverse @ score[..., None])[..., 0]
    f = float((score * -kappa).sum() / (views.noise * max(rank.sum(), 1)))
    tau, freedom = _alike(views, some)
    f2, tested = f / max(1.0, tau), float(rank.sum() - len(some))
    p_value = f_survival(f2, tested, freedom) if tested > 0 and freedom > 0 else float("nan")
    return Wishes(kappa, told / (views.noise * max(1.0, tau)), f2, p_value, tau)


def _pseudo_inverse(told: Float[ndarray, "m c c"]) -> tuple[Float[ndarray, "m c c"], Float[ndarray, " m"]]:
    """T_j^+ and the ranks, faint directions left out; columns are scaled alike in all views first."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(told, axis1=1, axis2=2).max(0), 1e-300))
    values, vectors = np.linalg.eigh(told * scale * scale[:, None])
    strong = values > FAINT_WISH_SHARE * max(values.max(), 1e-300)
    inverse = (
        vectors * np.where(strong, 1.0 / np.where(strong, values, 1.0), 0.0)[:, None]
    ) @ vectors.transpose(0, 2, 1)
    return inverse * scale * scale[:, None], strong.sum(1).astype(float)


def _alike(views: Views, some: list[int]) -> tuple[float, float]:
    """tau of the second-order patterns that these changes do not make, and their degrees of freedom."""
    moves, patterns = views.moves[:, :, some], views.patterns
    lengths = _lengths(moves)
    basis, triangle = np.linalg.qr(moves / lengths)
    shared = basis.transpose(0, 2, 1) @ patterns
    vectors, values, turned = np.linalg.svd(patterns - basis @ shared, full_matrices=False)
    own = values > LEAST_OWN_SINGULAR_VALUE
    # the vectors as sums of moves and patterns
    by_pattern = turned.transpose(0, 2, 1) * np.where(own, 1.0 / np.where(own, values, 1.0), 0.0)[:, None]
    by_move = -np.linalg.pinv(triangle) @ shared @ by_pattern / lengths.transpose(0, 2, 1)
    sums = np.concatenate([by_move, by_pattern], axis=1)
    columns = [*some, *range(views.moves.shape[2], views.told.shape[1])]
    told = views.told[:, columns][:, :, columns]
    freedom = float((sums * (told @ sums)).sum())
    energy = float((((vectors * own[:, None]).transpose(0, 2, 1) @ views.errors[..., None]) ** 2).sum())
    return energy / (views.noise * max(freedom, 1e-9)), freedom


def _lengths(columns: Float[ndarray, "m n c"]) -> Float[ndarray, "m 1 c"]:
    return np.maximum(np.sqrt((columns**2).sum(1, keepdims=True)), 1e-300)


def spread_of(score: Float[ndarray, "m c"], told: Float[ndarray, "m c c"]) -> Float[ndarray, "c c"]:
    """Covariance S of changes k_j ~ N(0, S), of which view j tells exp(-k's_j - k'T_j k / 2)."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(told, axis1=1, axis2=2).mean(0), 1e-300))
    heard, told = -score * scale, told * scale * scale[:, None]
    spread = np.eye(len(scale))
    for _ in range(SPREADING_ROUNDS):
        posterior = np.linalg.inv(np.linalg.inv(spread) + told)
        mean = (posterior @ heard[..., None])[..., 0]
        spread = (mean[:, :, None] * mean[:, None] + posterior).mean(0)
        spread += 1e-9 * np.trace(spread) * np.eye(len(spread))
    return spread * scale * scale[:, None]


def _movement(fit: Linearised, changes: ndarray, spread: ndarray, pixels: Float[ndarray, "n 2"]) -> float:
    """How far the image moves for changes of this covariance, rms over the pixels, after a rotation."""
    values, vectors = np.linalg.eigh(spread)
    squares = 0.0
    for value, vector in zip(values, vectors.T, strict=True):
        step = np.sqrt(max(float(value), 0.0)) * changes[: len(fit.names)] @ vector
        squares += _moved_squared(fit.camera, fit.names, step, pixels)
    return float(np.sqrt(squares))


def _moved_squared(camera: Camera, names: tuple[str, ...], step: ndarray, pixels: ndarray) -> float:
    sample = pixels[:: max(1, len(pixels) // SAMPLE_COUNT)]
    difference = image_difference(camera, Parameters.of(names).moved(camera, step), sample)
    return float(np.nanmean((difference**2).sum(1)))


def _kind(by_kind: Mapping[str, Wishes]) -> str:
    """Which of KINDS stands out; `mixed` where none does."""
    first, second = sorted(by_kind, key=lambda kind: -by_kind[kind].f2)[:2]
    return first if by_kind[first].f2 > NAMED_MARGIN * by_kind[second].f2 else "mixed"


def _shears(detections: Detections) -> Float[ndarray, "m n 2"]:
    """What a shutter does that reads row after row while the target moves: u, or v, moves with the row."""
    corners, height = len(detections.target.points), detections.image_size[1]
    shears = np.zeros((len(detections.views), 2 * corners, 2))
    for shear, view in zip(shears, detections.views, strict=True):
        row = view.pixels[:, 1] / height - 0.5
        shear[view.ids, 0], shear[corners + view.ids, 1] = row, row
    return shears
