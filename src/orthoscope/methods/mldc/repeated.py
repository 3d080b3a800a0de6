"""The paper's two steps again and again, until nothing changes: `mldc` as it finds the camera.

With g(phi) the straight pixels of the corners, phi = K and all poses, and D(g; theta) the lens about its own
centre, theta = its coefficients and the centre, both steps lower one cost,

    C(phi, theta) = sum over views and corners of |q - D(g(phi); theta)|^2,

step 1 (3.1, eq. 4) over phi with the lens held, its residual in the photograph, and step 2 (3.2, eq. 9 and
10) over theta, and the size of the straight image, with the corrected points g held. So C never rises and
where nothing changes any more it is stationary in both (L. Grippo and M. Sciandrone, Oper. Res. Lett. 26,
2000): the rounds end where the full calibration ends when it is given this lens with a centre of its own
(`fccm` with own_centre).

Plain rounds take hundreds: what the centre moves, poses make up for. To first order a round takes theta + d
to theta + M d, M = (B'B)^-1 B'P B with B = dD/dtheta and P the projector on what phi can do. So instead of
theta_new the next round starts from theta + (I - M)^-1 (theta_new - theta), if C does not rise by that, or
else from a shorter step the same way. That difference, in pixels, is the way still to go; a round's own step
says little of it.

The size of the straight image is a gauge (K stretched about the centre, coefficients scaled): a slope at the
centre is 1 at the end and K stretched instead, or errors that are told in units of fx would go with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from orthoscope.fitting.lens_fit import FOCAL
from orthoscope.fitting.observations import Poses
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.starts.initial_camera import StartingCameras
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.methods.mldc.lens_about_centre import (
    CENTRE,
    GAUGE,
    fit_centred_lens,
    paired_parameters,
    parse_centred_lens,
    refit_centred_lens,
)
from orthoscope.methods.mldc.pairs import pairs_of
from orthoscope.models.camera import Camera, image_border
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import Fet, Pfet
from orthoscope.models.parameters import Parameters
from orthoscope.solve.block_system import NormalEquations
from orthoscope.solve.least_squares import Options, Solution, Status, solve
from orthoscope.solve.losses import Loss

__all__ = ["Ended", "Rounds", "in_gauge", "joint_parameters", "repeat"]

# Where a round moves corners by less, and less is still to go, px rms, nothing changes any more.
SETTLED_PX = 1e-6
# These shares of the predicted way are tried in turn.
WAY_SHARES = (1.0, 0.25, 0.0625)
# A step within a round starts where the last one ended, and stops where numbers do.
INNER_OPTIONS = Options(max_steps=4, tolerance=1e-16)
# A staged start frees these coefficients of the paper's polynomial, after one another.
STAGES: tuple[tuple[str, ...], ...] = (("a3",), ("a3", "a5"))
# Each stage is given so many rounds.
STAGED_ROUNDS = 8


# A plain round that raises the cost by more than this share is none of numbers' roundings.
RAISED_SHARE = 1e-9
# An eigenvalue of M this near to 1 is a direction in which nothing is known; the stretch, whose is 1, is
# taken out.
OPEN_MARGIN = 1e-6


class Ended(NamedTuple):
    """How the rounds ended.

    Attributes:
        rounds: how many.
        moved_px: what the last moved the corners by, rms.
        way_px: what was still to go then, rms.
        rate: by which the plain rounds' steps shrink, the largest eigenvalue of M.
        raised: the share by which a plain round raised the cost, which in exact numbers it cannot.
    """

    rounds: int
    moved_px: float
    way_px: float
    rate: float
    raised: float = 0.0

    @property
    def settled(self) -> bool:
        """Whether nothing changes any more."""
        return self.moved_px < SETTLED_PX and self.way_px < SETTLED_PX

    @property
    def status(self) -> str:
        """A sentence."""
        if self.raised > RAISED_SHARE:
            return (
                f"stopped after {self.rounds} rounds: a plain round raised the cost by {self.raised:.1g}"
                " of it, which both steps cannot; the corners have no minimum nearby. Take more"
                " photographs or another lens"
            )
        if self.settled:
            return Status.CONVERGED.value
        if self.rate > 1.0 - OPEN_MARGIN:
            return (
                f"stopped after {self.rounds} rounds: steps of plain rounds do not shrink ({self.rate:.6f}"
                " each), so the views leave a direction of the lens open; free fewer coefficients"
            )
        return (
            f"stopped after {self.rounds} rounds: a round still moves the corners by {self.moved_px:.2g}"
            f" px, and {self.way_px:.2g} px are to go (the steps of plain rounds shrink by {self.rate:.4f}"
            " each); allow more rounds"
        )


@dataclass(frozen=True, eq=False)
class Rounds:
    """Where repeating ended: camera and poses, the cost there, how it ended, the sums of all parameters
    there.
    """

    estimate: Estimate
    cost: float
    ended: Ended
    sums: NormalEquations

    @property
    def folds(self) -> bool:
        """Whether the lens has no image somewhere in the frame."""
        camera = self.estimate.camera
        return not np.isfinite(camera.unproject(image_border(camera.image_size))).all()


def joint_parameters(of_pinhole: Sequence[str], lens: str) -> Parameters:
    """All that the two steps find: K's parameters, the lens's coefficients but for the gauge, and the"
    " centre."""
    kind, coefficients = parse_centred_lens(lens)
    held = ("stretch", GAUGE.get(kind))
    return Parameters.of(
        (*of_pinhole, *(name for name in paired_parameters(kind, coefficients) if name not in held))
    )


def repeat(
    bases: StartingCameras,
    nearest: Estimate,
    lens: str,
    *,
    rounds: int,
    loss: Loss,
    staged: bool = False,
    progress: Callable[[int, float], None] | None = None,
) -> Rounds:
    """Step 1 and step 2 in turn until nothing changes.

    Args:
        bases: the corners, and which parameters of K they tell.
        nearest: the pin-hole that is fitted without a lens, where the first step 2 starts.
        lens: as `parse_centred_lens` reads it.
        rounds: at most so many.
        loss: how both steps count large errors.
        staged: whether the lens's coefficients are freed one after the other and the centre last, for few
            views, whose first pin-hole is far off.
        progress: called after each round with (round, cost).
    Raises:
        CalibrationError: the lens cannot see the corners.
    """
    pairs = pairs_of(bases, nearest.poses)
    start = nearest
    if staged:
        start = _through_stages(bases, nearest, lens, loss)
    else:
        fit = fit_centred_lens(*pairs, pinhole=nearest.camera, lens=lens, loss=loss)
        start = Estimate(in_gauge(fit.unknowns, bases.narrowing.free), nearest.poses)
    own = _Repetition(bases, joint_parameters(bases.narrowing.free, lens), loss)
    return own.run(start, rounds, progress)


def _through_stages(bases: StartingCameras, nearest: Estimate, lens: str, loss: Loss) -> Estimate:
    """The first coefficients about the image's centre, then more of them."""
    kind, coefficients = parse_centred_lens(lens)
    stages = [tuple(name for name in stage if name in coefficients) for stage in STAGES]
    shape = [name for name in joint_parameters((), lens).names if name not in CENTRE]
    stages = [stage for stage in stages if stage] or [tuple(shape[:1])]
    stages = [stage for stage in stages if stage]  # a lens may have nothing but a centre to be freed
    width, height = nearest.camera.image_size
    K = nearest.camera.intrinsics
    focal = 0.5 * (K.fx + K.fy)
    frame = replace(K, fx=focal, fy=focal, cx=0.5 * (width - 1), cy=0.5 * (height - 1), skew=0.0)
    here = Estimate(replace(nearest.camera, lens=kind(**kind.starts[0]), lens_frame=frame), nearest.poses)
    for stage in stages:
        free = Parameters.of((*bases.narrowing.free, *stage))
        here = _Repetition(bases, free, loss).run(here, STAGED_ROUNDS, None).estimate
    return here


def in_gauge(camera: Camera, of_pinhole: Sequence[str]) -> Camera:
    """The same image with slope 1 at the centre: K stretched about it instead, so far as K's parameters
    move.
    """
    frame, gauge = camera.lens_frame, UNIT_SLOPES.get(type(camera.lens))
    if gauge is None or frame is None:
        return camera
    slope, values = gauge(camera.lens)
    K = camera.intrinsics
    stretched = replace(K, fx=slope * K.fx, fy=slope * K.fy, skew=slope * K.skew)
    if set(FOCAL) <= set(of_pinhole):
        cx, cy = frame.cx + slope * (K.cx - frame.cx), frame.cy + slope * (K.cy - frame.cy)
        stretched = replace(stretched, cx=cx, cy=cy)
    return replace(camera, intrinsics=stretched, lens=camera.lens.with_coefficients(**values))


def _of_polynomial(lens: Pfet) -> tuple[float, dict[str, float]]:
    """The slope at the centre, and the coefficients of the curve over a radius that is so much larger."""
    return lens.a1, {f"a{t}": getattr(lens, f"a{t}") / lens.a1**t for t in range(6)}


def _of_logarithm(lens: Fet) -> tuple[float, dict[str, float]]:
    """The same of s log(1 + l r)."""
    return lens.scale * lens.l, {"l": 1.0 / lens.scale}


# Of lenses that have a slope of their own at the centre.
UNIT_SLOPES: dict[type[Lens], Callable[[Any], tuple[float, dict[str, float]]]] = {
    Pfet: _of_polynomial,
    Fet: _of_logarithm,
}


class _Round(NamedTuple):
    """A round's outcome: the estimate after step 2, and its cost."""

    estimate: Estimate
    cost: float


class _Repetition:
    """The rounds for given corners and free parameters: those of K, then theta."""

    def __init__(self, bases: StartingCameras, free: Parameters, loss: Loss) -> None:
        self._bases, self._loss, self._free = bases, loss, free
        self._k = len(bases.narrowing.free)
        self._theta = Parameters.of(free.names[self._k :])
        # One and two views hold a part of K, which a stretched image would move.
        self._stretches = set(FOCAL) <= set(bases.narrowing.free)
        self._of_pinhole: Reprojection | None = None
        self._of_all: Reprojection | None = None

    def run(self, start: Estimate, rounds: int, progress: Callable[[int, float], None] | None) -> Rounds:
        """Rounds from a start until nothing changes, or so many."""
        camera = start.camera
        self._of_pinhole = Reprojection(
            self._bases.observations, self._bases.points, camera, self._bases.narrowing.free
        )
        self._of_all = Reprojection(self._bases.observations, self._bases.points, camera, self._free)
        before, here = start, self._round(start)
        if here is None:
            raise CalibrationError(
                "the corrected points cannot be told from these corners: no pin-hole with the lens of the"
                " first step 2 sees them. Take more photographs, or use a lens with fewer coefficients,"
                " as in --lens pfet:a1,a3."
            )
        for number in range(1, rounds + 1):
            sums = self._of_all.linearise(here.estimate, self._loss)
            step = self._theta.values(here.estimate.camera) - self._theta.values(before.camera)
            ended, way = self._ended(number, sums, here.estimate.camera, step)
            if progress:
                progress(number, here.cost)
            if ended.settled or number == rounds:
                return self._outcome(here, ended)
            last = here.cost
            before, here = self._onward(before, here, way)
            if here.cost > last * (1.0 + RAISED_SHARE):
                raised = here.cost / last - 1.0
                return self._outcome(here, ended._replace(raised=raised))
        raise AssertionError("the last round returns")

    def _outcome(self, here: _Round, ended: Ended) -> Rounds:
        """The end of the rounds, in the gauge that every method's cameras have."""
        assert self._of_all is not None
        estimate = here.estimate._replace(camera=in_gauge(here.estimate.camera, self._bases.narrowing.free))
        return Rounds(estimate, here.cost, ended, self._of_all.linearise(estimate, self._loss))

    def _onward(self, before: Estimate, here: _Round, way: ndarray) -> tuple[Estimate, _Round]:
        """Where the next round starts, and that round: along the predicted way if that raises no cost."""
        for share in WAY_SHARES if np.isfinite(way).all() else ():
            step = self._theta.values(before.camera) + share * way - self._theta.values(here.estimate.camera)
            ahead = here.estimate._replace(camera=self._theta.moved(here.estimate.camera, step))
            after = self._round(ahead)
            if after is not None and after.cost <= here.cost * (1.0 + 1e-13):
                return ahead, after
        plain = self._round(here.estimate)
        return here.estimate, plain or here

    def _round(self, estimate: Estimate) -> _Round | None:
        """Step 1 and step 2 from an estimate; None where it has no cost."""
        assert self._of_pinhole is not None
        pinhole = solve(self._of_pinhole, estimate, loss=self._loss, options=INNER_OPTIONS)
        if pinhole.status is Status.NO_COST:
            return None
        camera, poses = pinhole.unknowns
        fit = self._step_two(camera, poses)
        if fit.status is Status.NO_COST:
            return None
        return _Round(Estimate(fit.unknowns, poses), fit.cost)

    def _step_two(self, camera: Camera, poses: Poses) -> Solution[Camera]:
        free = (*self._theta.names, "stretch") if self._stretches else self._theta.names
        return refit_centred_lens(
            *pairs_of(self._bases, poses), start=camera, free=free, loss=self._loss, options=INNER_OPTIONS
        )

    def _ended(
        self, number: int, sums: NormalEquations, camera: Camera, step: Float[ndarray, " t"]
    ) -> tuple[Ended, Float[ndarray, " t"]]:
        """How far the rounds have come, and the way still to go from where the last one started."""
        k, corners = self._k, self._bases.observations.corners
        A, stretch = sums.A, self._stretch(camera)
        eliminated = A - (sums.B @ np.linalg.inv(sums.C) @ sums.B.transpose(0, 2, 1)).sum(0)
        try:
            of_theta = eliminated[k:, k:] - eliminated[k:, :k] @ np.linalg.solve(
                eliminated[:k, :k], eliminated[:k, k:]
            )
            within = A[k:, k:] - of_theta  # B'PB
            square = A[k:, k:].copy()
            if self._stretches:
                along = A[k:, :k] @ stretch
                straight = np.outer(along, along) / (stretch @ A[:k, :k] @ stretch)
                square -= straight  # B'B with the stretch projected out; the projector P keeps it whole
                within -= straight
            M = np.linalg.solve(square, within)
            way = np.linalg.solve(np.eye(len(M)) - M, step)
            rate = float(np.abs(np.linalg.eigvals(M)).max())
        except np.linalg.LinAlgError:
            square, way, rate = A[k:, k:], np.full_like(step, np.nan), 1.0
        return Ended(number, _size(square, step, corners), _size(square, way, corners), rate), way

    def _stretch(self, camera: Camera) -> Float[ndarray, " k"]:
        """How K's parameters move when the straight image is stretched about the centre."""
        K, frame = camera.intrinsics, camera.lens_frame
        assert frame is not None
        moves = {"fx": K.fx, "fy": K.fy, "cx": K.cx - frame.cx, "cy": K.cy - frame.cy, "skew": K.skew}
        return np.array([moves[group[0]] for group in Parameters.of(self._bases.narrowing.free).groups])


def _size(square: ndarray, step: ndarray, corners: int) -> float:
    """A step of theta in pixels, rms over the corners."""
    return float(np.sqrt(max(step @ square @ step, 0.0) / corners)) if np.isfinite(step).all() else np.inf
