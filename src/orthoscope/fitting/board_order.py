"""Boards that look alike both ways up: which way each view lists its corners, decided by all views together.

A chessboard of 9x7 or 8x6 inner corners is its own image turned by half a turn, one of 7x7 by a quarter: a
detector lists its corners from one end in this photograph and from the other in that.  To a flat target it is
all the same, since the pose turns with it; but a real board is bent, stretched and printed unevenly, and then
two orders mean two boards.

With the flat fit linearised, a view that lists its corners turned by g has the residual  y_j + A_j T_g x  for
a camera and one smooth shape x of the board; T_g shows the shape as the view's own list sees it.  Each view
in turn is taken for the one that is right: the shape that it alone tells gives every other view its best
turn, the shape is found anew from all, and so on until nothing changes (of many views, those that tell most
are enough).  The best end is taken where it is surely better than the lists as they came.  A board without a
shape of its own gains by no turn: nothing is changed, and nothing lost.  Of more than a few views a quick
look (turn_gain.py) says first whether any turns can gain so much.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from orthoscope.fitting.board_turns import (
    Turn,
    least_turned,
    shown_by,
    turns_after,
    turns_of,
    whole_turn,
)
from orthoscope.fitting.calibration import Calibration, residuals_of
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.resection import resect
from orthoscope.fitting.slopes.residual_slopes import residual_slopes
from orthoscope.fitting.turn_gain import likely_turns
from orthoscope.geometry.arrays import CalibrationError, Float, Int, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import TargetShape, polynomials
from orthoscope.targets.detections import Detections, View

__all__ = ["in_one_order", "listed_as_known"]

# At least so many views are needed: of two, either may be the one that is turned.
FEWEST_ORDERED_VIEWS = 3
# A smooth shape's coefficients have a standard deviation of this share of the target's size.
LIKELY_SHARE = 1e-3
# Chance gives no gain of this many times the noise's variance for each view that is turned.
SURE_GAIN = 10.0
# From so many views on a quick look says whether to ask them all.
QUICK_LOOK_VIEWS = 10
# A quick look finds more than this share of the gain that is there.
QUICK_LOOK_SHARE = 0.6
# The turns are searched for in so many views, of those that tell most; all others follow from these.
SEARCHED_VIEWS = 60
# So many views, of those that tell most, are taken for the right one in turn.
START_VIEWS = 24
# So many views are looked at together, to keep what is between in a core's cache.
VIEWS_AT_ONCE = 32
# The turns are improved in at most so many rounds.
ROUND_LIMIT = 20


def in_one_order(flat: Calibration) -> Calibration:
    """The calibration with a flat target, the corners of all views listed from the same end of the target;
    poses turn with them. Of several targets each has its own end.
    """
    if flat.camera.lens_frame is not None:
        return flat
    turned = {}
    for rows, alone in _alone(flat):
        turns = turns_of(alone.detections.target)
        turned |= {row: turns[i] for row, i in zip(rows.tolist(), _chosen_of(alone, turns), strict=True) if i}
    return _turned(flat, turned) if turned else flat


def _shown(detections: Detections, view: View) -> int:
    """The number of the target's member that a view shows."""
    return int(detections.member_of(view.ids[:1])[0])


def _alone(flat: Calibration) -> Iterator[tuple[Int[ndarray, " v"], Calibration]]:
    """The calibration of each member by the views that show it, and which these are."""
    target, views = flat.detections.target, flat.detections.views
    if not target.members:
        yield np.arange(len(views)), flat
        return
    shows = np.array([_shown(flat.detections, view) for view in views])
    for number, (part, member) in enumerate(zip(target.parts, target.members, strict=True)):
        rows = np.flatnonzero(shows == number)
        mine = replace(
            flat.detections,
            target=replace(member, points=target.points[part]),
            views=tuple(replace(views[row], ids=views[row].ids - part.start) for row in rows),
            set_aside=(),
            outliers=(),
            remarks=(),
        )
        poses = tuple(flat.camera_from_target[row] for row in rows)
        yield rows, replace(flat, detections=mine, camera_from_target=poses, target_shape=None)


def _chosen_of(flat: Calibration, turns: list[Turn]) -> Int[ndarray, " m"]:
    """The turn of each view, 0 where it stays."""
    views = len(flat.detections.views)
    if len(turns) < 2 or views < FEWEST_ORDERED_VIEWS:
        return np.zeros(views, dtype=np.int64)
    if views >= QUICK_LOOK_VIEWS and not _may_gain(flat, turns):
        return np.zeros(views, dtype=np.int64)
    return _chosen(_Sums.of(flat, turns))


def _turned(flat: Calibration, turned: dict[int, Turn]) -> Calibration:
    """The same with some views listed another way, by their numbers; outliers and poses turn with them."""
    target = flat.detections.target
    views, poses = list(flat.detections.views), list(flat.camera_from_target)
    corners_of = {}
    for row, back in turned.items():
        view, pose, part = views[row], poses[row], target.parts[_shown(flat.detections, views[row])]
        corners = corners_of[view.image] = whole_turn(target, part, back)
        ids, middle = corners[view.ids], target.points[part].mean(0)
        order = np.argsort(ids)
        views[row] = View(view.image, ids[order], view.pixels[order])
        rotation = pose.rotation @ back.rotation.T
        poses[row] = Pose(rotation, pose.translation + pose.rotation @ middle - rotation @ middle)
    outliers = [
        one._replace(id=int(corners_of[one.image][one.id])) if one.image in corners_of else one
        for one in flat.detections.outliers
    ]
    detections = replace(flat.detections, views=tuple(views), outliers=tuple(outliers))
    return replace(flat, detections=detections, camera_from_target=tuple(poses))


def _may_gain(flat: Calibration, turns: list[Turn]) -> bool:
    """Whether turns may be surely better, at a quick look."""
    points = flat.detections.target.points
    smooth = polynomials(points, np.ones(len(points), dtype=bool))
    chosen, gain, noise = likely_turns(
        flat, smooth, [shown_by(turn, smooth, 0) for turn in turns], 1.0 / _likely_size(points) ** 2
    )
    turned = int((least_turned(chosen, turns_after(turns)) > 0).sum())
    return gain > QUICK_LOOK_SHARE * SURE_GAIN * noise * max(turned, 1)


def listed_as_known(camera: Camera, detections: Detections, shape: TargetShape | None) -> Detections:
    """The detections, corners listed from the end of the target that a known shape was learnt from: of each
    view the turn with which it is seen best. Rows keep their order; a view that some turn cannot be fitted
    for is left as it is.

    Args:
        camera: that took them.
        shape: of the target.
    """
    if shape is None or not shape.displacements.any():
        return detections
    target, views = detections.target, []
    turns = [
        [whole_turn(target, part, turn) for turn in turns_of(member)]
        for part, member in zip(target.parts, target.members or (target,), strict=True)
    ]
    if all(len(ways) == 1 for ways in turns):
        return detections
    for view in detections.views:
        ways = turns[_shown(detections, view)]
        listed = [replace(view, ids=corners[view.ids]) for corners in ways]
        views.append(
            min(listed, key=lambda one: _misses(camera, replace(detections, views=(one,)), shape))
            if len(listed) > 1
            else view
        )
    return replace(detections, views=tuple(views))


def _misses(camera: Camera, alone: Detections, shape: TargetShape) -> float:
    """The sum of squared residuals of one view; infinite where it has no pose."""
    try:
        poses = resect(camera, alone, shape=shape)
    except CalibrationError:
        return np.inf
    return float((residuals_of(camera, poses, alone, shape=shape)[0] ** 2).sum())


@dataclass(frozen=True, eq=False)
class _Sums:
    """The normal equations of each view under each turn: gram (m,g,c,c), right (m,g,c); prior (c,c); square:
    |y|^2 of all; freedom: of the residuals when all is fitted; named: how many of the c unknowns are the
    camera's.
    """

    gram: ndarray
    right: ndarray
    prior: ndarray
    square: float
    freedom: int
    named: int
    after: ndarray

    @classmethod
    def of(cls, flat: Calibration, turns: list[Turn]) -> _Sums:
        points, free = flat.detections.target.points, flat.uncertainty.names
        observations = Observations.by_corner(flat.detections)
        poses = observations.poses_of(flat.camera_from_target)
        slopes, residual = residual_slopes(observations, flat.camera, poses, points, free, moves=True)
        m, p = observations.present.shape
        smooth = polynomials(points, np.ones(p, dtype=bool))
        r, k, square = smooth.shape[1], len(free), 0.0
        gram, right = np.empty((m, len(turns), k + 3 * r, k + 3 * r)), np.empty((m, len(turns), k + 3 * r))
        shown = [shown_by(turn, smooth, k) for turn in turns]
        buffer = np.empty((min(m, VIEWS_AT_ONCE), k + 3 * r, 2 * p))
        for start in range(0, m, VIEWS_AT_ONCE):
            rows = slice(start, start + VIEWS_AT_ONCE)
            pose = np.linalg.qr(slopes.pose[rows].transpose(0, 2, 1))[0]
            y = _without(pose, residual[rows, :, None])
            square += float((y**2).sum())
            columns = buffer[: len(y)]
            columns[:, :k] = slopes.camera[rows]
            by_shape = columns[:, k:].reshape(len(y), r, 3, 2, p)
            np.multiply(
                slopes.corner[rows].transpose(0, 3, 2, 1)[:, None], smooth.T[:, None, None], out=by_shape
            )
            by_pose = columns @ pose
            unturned = columns @ columns.transpose(0, 2, 1) - by_pose @ by_pose.transpose(0, 2, 1)
            pulls = (columns @ y)[..., 0]
            for i, turned in enumerate(shown):
                gram[rows, i], right[rows, i] = turned.T @ unturned @ turned, pulls @ turned
        freedom = 2 * observations.corners - 6 * m - k
        precision = square / max(freedom, 1) / _likely_size(points) ** 2
        prior = np.diag(np.concatenate([1e-9 * np.diag(gram[:, 0].sum(0))[:k], np.full(3 * r, precision)]))
        return cls(gram, right, prior, square, freedom, k, turns_after(turns))

    def only(self, views: Int[ndarray, " v"]) -> _Sums:
        """Those of some views."""
        return replace(self, gram=self.gram[views], right=self.right[views])

    def told(
        self, turns: Int[ndarray, "s m"], say: Float[ndarray, "s m"] | None = None
    ) -> tuple[Float[ndarray, "s c"], Float[ndarray, " s"]]:
        """Camera and shape that the views tell together, each turned as said, and the least cost, |y|^2
        apart; of several ways to turn them at once.

        Args:
            say: of each view, 1 by default.
        """
        ways, (m, g) = len(turns), self.gram.shape[:2]
        turned = (turns[..., None] == np.arange(g)) * (1.0 if say is None else say[..., None])
        gram, right = (
            turned.reshape(ways, m * g) @ part.reshape(m * g, -1) for part in (self.gram, self.right)
        )
        x = -np.linalg.solve(gram.reshape(ways, *self.prior.shape) + self.prior, right[..., None])[..., 0]
        return x, (right * x).sum(1)

    def best_turns(self, x: Float[ndarray, "s c"]) -> Int[ndarray, "s m"]:
        """The turn with which each view costs least, for each of several cameras and shapes."""
        pulls = (self.gram.reshape(-1, x.shape[1]) @ x.T).reshape(*self.right.shape, len(x))
        return ((2.0 * self.right[..., None] + pulls) * x.T).sum(2).argmin(1).T

    def telling(self, views: int) -> Int[ndarray, " v"]:
        """The views, at most so many, that tell most of the target's shape by themselves."""
        told = np.trace(self.gram[:, 0, self.named :, self.named :], axis1=1, axis2=2)
        return np.argsort(-told, kind="stable")[:views]

    def likeness(self, turns: Int[ndarray, " m"], x: Float[ndarray, " c"], noise: float) -> float:
        """How much larger smooth patterns are in what is left of each view than independent errors make
        them.
        """
        every = np.arange(len(turns))
        gram = self.gram[every, turns][:, self.named :, self.named :]
        left = (self.right[every, turns] + self.gram[every, turns] @ x)[:, self.named :]
        values, vectors = np.linalg.eigh(gram)
        told = values > 1e-6 * values.max(1, keepdims=True)
        found = (vectors.transpose(0, 2, 1) @ left[..., None])[..., 0] ** 2 / np.where(told, values, 1.0)
        return max(1.0, float(found[told].sum()) / (noise * max(int(told.sum()), 1)))


def _chosen(sums: _Sums) -> Int[ndarray, " m"]:
    """The turn of each view, 0 where it stays; all 0 where no turns are surely better."""
    m = len(sums.gram)
    none = np.zeros(m, dtype=np.int64)
    _, (before,) = sums.told(none[None])
    if m <= SEARCHED_VIEWS:
        best = _searched(sums)
    else:
        some = sums.only(sums.telling(SEARCHED_VIEWS))
        (best,) = _settled(sums, some.told(_searched(some)[None])[0])
    best = least_turned(best, sums.after)
    (x,), (cost,) = sums.told(best[None])
    noise = max(sums.square + cost, 1e-12 * sums.square) / max(sums.freedom, 1)
    needed = SURE_GAIN * noise * max(int((best > 0).sum()), 1)
    if before - cost <= needed:
        return none
    return best if before - cost > needed * sums.likeness(best, x, noise) else none


def _searched(sums: _Sums) -> Int[ndarray, " m"]:
    """The best end that taking one view after the other for the right one comes to."""
    firsts = sums.telling(START_VIEWS)
    none = np.zeros((1 + len(firsts), len(sums.gram)), dtype=np.int64)
    alone = np.zeros((len(firsts), len(sums.gram)))
    alone[np.arange(len(firsts)), firsts] = 1.0
    ends = none.copy()  # the first: as the lists came
    ends[1:] = _settled(sums, sums.told(none[1:], alone)[0])
    costs = sums.told(ends)[1]
    costs[1:] += 1e-9 * sums.square
    return ends[costs.argmin()]


def _settled(sums: _Sums, x: Float[ndarray, "s c"]) -> Int[ndarray, "s m"]:
    """The turns that cameras and shapes come to, which are found anew from all views again and again."""
    tried = np.zeros((len(x), len(sums.gram)), dtype=np.int64)
    for _ in range(ROUND_LIMIT):
        before, tried = tried, sums.best_turns(x)
        if (tried == before).all():
            break
        x, _ = sums.told(tried)
    return tried


def _likely_size(points: Float[ndarray, "p 3"]) -> float:
    """Of a smooth shape's coefficients, metres."""
    return LIKELY_SHARE * float(np.ptp(points[:, :2], axis=0).max())


def _without(basis: Float[ndarray, "m n 6"], columns: Float[ndarray, "m n c"]) -> Float[ndarray, "m n c"]:
    """What a pose cannot do of the columns of each view."""
    return columns - basis @ (basis.transpose(0, 2, 1) @ columns)
