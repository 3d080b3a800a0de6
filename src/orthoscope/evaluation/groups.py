"""Which photographs one camera took and which the other: the groups of views that do not agree.

What each view would have liked the camera to be (disagreement.py) is a quadratic, q_j(k) = 2 k's_j + k'T_j k,
of a few changes k of the camera.  Two cameras are two changes, and each view belongs to the one at which its
quadratic is lower. Two questions, and either makes two groups of photographs:

1. *Is it two values, or a spread?*  exp(-q_j / 2) is the likelihood of a view.  Two changes, each view with
   one of them, are compared with changes that are normally distributed (a lens that focuses anew for every
   photograph): groups are named where the logarithm of their ratio is LEAST_LOG_RATIO.  A view whose
   likelihoods differ too little to tell belongs to neither.
2. *Do two cameras foresee the photographs far better?*  Groupings of the linear step are refined by a fit for
   each group, each view going to the camera that sees it with less error (by leave-one-out in its own group),
   until nothing changes. Photographs are of two cameras where these foresee them with less than APART_SHARE
   of the error of one for all, and each agrees on its camera by itself.

The first finds what is small beside the noise, the second what is too large to be linear.
S. Lloyd, Least squares quantization in PCM, IEEE Trans. Inf. Theory 28(2), 1982 (k-means, here on
quadratics).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.disagreement import Disagreement, changes_of, disagreement, spread_of
from orthoscope.fitting.calibration import Calibration, residuals_of
from orthoscope.fitting.resection import resect
from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.leave_one_out import LeaveOneOut, leave_one_out, say_of
from orthoscope.geometry.arrays import Bool, CalibrationError, Float, ndarray
from orthoscope.methods.decoupled.fitters import COMPARED
from orthoscope.methods.decoupled.step_one import StepOneFit, fit_step_one
from orthoscope.methods.decoupled.step_one_linearised import linearised
from orthoscope.models.lenses.table import FREE

__all__ = ["Groups", "two_groups"]

# Two cameras leave less than this share of the error of one camera for all: the halves of what is merely
# spread leave .5 of it where the spread is even, .6 where it is normal.
APART_SHARE = 0.45
# The logarithm of the likelihood ratio, of two values against a spread, is at least this.
LEAST_LOG_RATIO = 2.5
# A view with less than this for either group is in none.
CERTAIN_LIKELIHOOD = 0.95
# The linear step must explain this share of the squared residuals before fits are worth their time.
LEAST_EXPLAINED_SHARE = 0.3
# A grouping that leaves more than this share of it at first does not come below that by single views.
HOPELESS_SHARE = 0.7
# After so many groupings without hope no other is tried: they come in the order of what the linear step says.
HOPELESS_GROUPINGS = 3
# A group has at least this many views: with fewer, none can be left out.
FEWEST_GROUP_VIEWS = 4
# K-means starts from so many groupings that are drawn at random.
RANDOM_STARTS = 60
# A grouping is refined so many times.
REFINING_ROUNDS = 6
# K-means, and the likelihoods, have so many rounds.
SETTLING_ROUNDS = 60
# So many groupings are refined.
REFINED_GROUPINGS = 6


class Groups(NamedTuple):
    """Two groups of views.

    Attributes:
        first, second: indices of the views, ascending; the larger group first.
        unsure: of views that may be in either.
    """

    first: tuple[int, ...]
    second: tuple[int, ...]
    unsure: tuple[int, ...] = ()


class _Cameras:
    """Cameras of groups of the views, every corner free and a free lens, each fitted once.

    Args:
        together: one camera for all, with a flat target: what each group's fit starts from.
    """

    def __init__(self, together: Calibration) -> None:
        self._together = together
        self._fitted, self.squares = cache(self._fit), cache(self._squares)

    def agree(self, group: tuple[int, ...]) -> bool:
        """Whether the views of a group agree on one camera: halves of a zoom in many steps, or of photographs
        by a rolling shutter, are better than the whole, but are no cameras.
        """
        known = linearised(self._fitted(group))
        return not disagreement(known, self._together.detections.only(group)).certain

    def _fit(self, group: tuple[int, ...]) -> StepOneFit:
        start = replace(
            self._together,
            detections=self._together.detections.only(group),
            camera_from_target=tuple(self._together.camera_from_target[i] for i in group),
        )
        return fit_step_one(start, shape="free", first_lens=FREE, ending=COMPARED)

    def _squares(self, group: tuple[int, ...]) -> Float[ndarray, " m"]:
        """Squared error of each view by a group's camera: left out where it is of the group."""
        detections, fit = self._together.detections, self._fitted(group)
        shape, camera = fit.shape, fit.estimate.camera
        poses = resect(camera, detections, shape=shape, near=self._together.camera_from_target)
        squares = np.array([(e**2).sum() for e in residuals_of(camera, poses, detections, shape=shape)])
        squares[list(group)] = leave_one_out(linearised(fit)).squares
        return squares


class _Quadratics(NamedTuple):
    """What the views say of a change k: 2 k's_j + k'T_j k, over the noise.  score (m,c), told (m,c,c)."""

    score: ndarray
    told: ndarray

    def at(self, change: Float[ndarray, "*s c"]) -> Float[ndarray, "*s m"]:
        """Of each view, for each of the changes."""
        squares = (change[..., :, None] * change[..., None, :]).reshape(*change.shape[:-1], -1)
        return 2.0 * change @ self.score.T + squares @ self.told.reshape(len(self.told), -1).T

    def lowest(self, say: Float[ndarray, "*s m"]) -> Float[ndarray, "*s c"]:
        """The change at which the sum over views, each with its say, is lowest."""
        c = self.score.shape[1]
        told = (say @ self.told.reshape(len(self.told), -1)).reshape(*say.shape[:-1], c, c)
        scale = 1.0 / np.sqrt(np.maximum(np.diagonal(told, axis1=-2, axis2=-1), 1e-300))
        system = told * scale[..., None] * scale[..., None, :] + 1e-9 * np.eye(c)
        return -scale * np.linalg.solve(system, (scale * (say @ self.score))[..., None])[..., 0]


def two_groups(
    fit: Linearised, found: Disagreement, whole: LeaveOneOut, together: Calibration
) -> Groups | None:
    """The two groups that photographs which do not agree fall into; None where they fall into no two.

    Args:
        fit: of all views, every corner free and a free lens.
        found: how they disagree.
        whole: each view left out of the fit; one by one, since copies may be of two cameras.
        together: the same views by one camera and a flat target, its lens the formula under the free one.
    """
    if found.wishes is None or fit.views < 2 * FEWEST_GROUP_VIEWS:
        return None
    noise = fit.noise * max(1.0, found.wishes.tau)
    groupings = _groupings(_quadratics(fit, noise, ("k1",)))
    explained = -noise * groupings[0][0] / float((fit.errors**2).sum()) if groupings else 0.0
    joint = float(np.nansum(whole.squares))
    starts = [each for _, each in groupings[:REFINED_GROUPINGS]] if explained > LEAST_EXPLAINED_SHARE else []
    cameras = _Cameras(together)
    squares, second = _best_refined(cameras, starts, joint)
    if second is not None and np.sqrt(squares / joint) < APART_SHARE:
        if not all(cameras.agree(group) for group in _parts(second)):
            return None
        return _named(second, np.ones(len(second), dtype=bool))
    return None if found.kind == "shutter" else _two_values(_quadratics(fit, noise))


def _quadratics(fit: Linearised, noise: float, more: tuple[str, ...] = ()) -> _Quadratics:
    _, changes = changes_of(fit, more)
    moves = fit.moves(changes)
    told = moves.transpose(0, 2, 1) @ moves - say_of(fit, moves)[0]
    return _Quadratics(
        (moves * fit.errors[..., None]).sum(1) / noise, 0.5 * (told + told.transpose(0, 2, 1)) / noise
    )


def _groupings(say: _Quadratics) -> list[tuple[float, Bool[ndarray, " m"]]]:
    """Groupings by k-means, and the best cut of each wish as it is: the sum of the quadratics, who is in the
    second; best first.
    """
    views = len(say.score)
    faint = 1e-9 * np.eye(say.score.shape[1]) * np.trace(say.told.mean(0))
    wishes = -np.linalg.solve(say.told + faint, say.score[..., None])[..., 0]
    cuts = [wish > np.sort(wish)[FEWEST_GROUP_VIEWS - 1 : -FEWEST_GROUP_VIEWS, None] for wish in wishes.T]
    random = np.random.default_rng(0).random((RANDOM_STARTS, views)) < 0.5
    best_cuts = [of_wish[_values(say, of_wish).argmin()] for of_wish in cuts]
    ends = np.concatenate([_clustered(say, np.concatenate([random, *cuts])), best_cuts])
    count = ends.sum(1)
    able = ends[(count >= FEWEST_GROUP_VIEWS) & (count <= views - FEWEST_GROUP_VIEWS)]
    distinct = list({(second ^ second[0]).tobytes(): second for second in able}.values())
    values = _values(say, np.array(distinct, dtype=bool).reshape(-1, views)).tolist()
    return sorted(zip(values, distinct, strict=True), key=lambda entry: entry[0])


def _clustered(say: _Quadratics, second: Bool[ndarray, "s m"]) -> Bool[ndarray, "s m"]:
    """k-means on quadratics from each of the starts."""
    second, moving = second.copy(), np.arange(len(second))
    for _ in range(SETTLING_ROUNDS):
        count = second[moving].sum(1)
        moving = moving[(count >= 1) & (count < second.shape[1])]
        tried = second[moving]
        moved = say.at(say.lowest(tried.astype(float))) < say.at(say.lowest((~tried).astype(float)))
        second[moving] = moved
        moving = moving[(moved != tried).any(1)]
        if not len(moving):
            break
    return second


def _values(say: _Quadratics, second: Bool[ndarray, "s m"]) -> Float[ndarray, " s"]:
    """Of each grouping the sum of the quadratics, each at its group's lowest."""
    first, other = (
        (say.at(say.lowest(group)) * group).sum(1)
        for group in (second.astype(float), (~second).astype(float))
    )
    return first + other


def _two_values(say: _Quadratics) -> Groups | None:
    """Question 1."""
    groupings = _groupings(say)
    if not groupings:
        return None
    share = np.stack([~groupings[0][1], groupings[0][1]]).astype(float)
    likely = np.zeros(share.shape[1])
    for _ in range(SETTLING_ROUNDS):
        weight = np.maximum(share.mean(1), 1e-6)
        each = np.log(weight)[:, None] - 0.5 * say.at(say.lowest(share))
        likely = np.logaddexp(*each)
        share = np.exp(each - likely)
    if likely.sum() - _likelihood_of_spread(say) < LEAST_LOG_RATIO:
        return None
    second, sure = share[1] > share[0], share.max(0) > CERTAIN_LIKELIHOOD
    few = min((sure & second).sum(), (sure & ~second).sum()) < FEWEST_GROUP_VIEWS
    return None if few else _named(second, sure)


def _likelihood_of_spread(say: _Quadratics) -> float:
    """Logarithm of the likelihood of all views where changes are normally distributed."""
    spread = spread_of(say.score, say.told)
    c = len(spread)
    mean = np.linalg.solve(np.linalg.inv(spread) + say.told, say.score[..., None])[..., 0]
    return float(
        (0.5 * (say.score * mean).sum(1) - 0.5 * np.linalg.slogdet(np.eye(c) + spread @ say.told)[1]).sum()
    )


def _best_refined(
    cameras: _Cameras, starts: list[Bool[ndarray, " m"]], joint: float
) -> tuple[float, Bool[ndarray, " m"] | None]:
    """The refined grouping with the least squares; no more starts where two have come to it, or some are
    without hope.

    A grouping in which some photographs have changed places can be far better than one camera for all and
    still be the wrong one: refining moves single views, and does not undo a swap.
    """
    best: tuple[float, ndarray | None] = (np.inf, None)
    hopeless = 0
    for start in starts:
        refined = _refined(cameras, start, joint)
        if refined is None:
            continue
        hopeless += refined[0] > HOPELESS_SHARE**2 * joint
        if hopeless >= HOPELESS_GROUPINGS:
            break
        if best[1] is not None and len(np.unique(refined[1] ^ best[1])) == 1:
            break  # another start ends where the best one did
        if refined[0] < best[0]:
            best = refined
    return best


def _parts(second: Bool[ndarray, " m"]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The indices of the first group's views and of the second's."""
    return tuple(np.flatnonzero(~second).tolist()), tuple(np.flatnonzero(second).tolist())


def _refined(
    cameras: _Cameras, second: Bool[ndarray, " m"], joint: float
) -> tuple[float, Bool[ndarray, " m"]] | None:
    """Question 2: the squares of two cameras, and who is in the second group; None where a group gives no
    camera.

    Args:
        joint: the squares of one camera for all; where two leave too much of them, or one alone does, views
            stay where they are.
    """
    seen: set[bytes] = set()
    best: tuple[float, ndarray] | None = None
    for _ in range(REFINING_ROUNDS):
        parts, total = _parts(second), 0.0
        if second.tobytes() in seen or min(map(len, parts)) < FEWEST_GROUP_VIEWS:
            break
        seen.add(second.tobytes())
        try:
            for part in sorted(parts, key=len):
                total += float(cameras.squares(part)[list(part)].sum())
                if not total <= HOPELESS_SHARE**2 * joint:
                    break
        except CalibrationError:
            break
        if np.isfinite(total) and (best is None or total < best[0]):
            best = total, second
        if not total <= HOPELESS_SHARE**2 * joint:
            break
        second = cameras.squares(parts[1]) < cameras.squares(parts[0])
    return best


def _named(second: Bool[ndarray, " m"], sure: Bool[ndarray, " m"]) -> Groups:
    groups = sorted(
        (np.flatnonzero(group & sure).tolist() for group in (~second, second)),
        key=lambda group: (-len(group), group),
    )
    return Groups(tuple(groups[0]), tuple(groups[1]), tuple(np.flatnonzero(~sure).tolist()))
