"""Where a joint calibration starts: a camera good enough for its wanted lens, found without being told
anything.

Two bases. *Pin-hole*: Zhang's closed form on the distorted corners. *Angle*: an equidistant lens, r_d =
theta, at a few focal lengths, keeping the one whose rays fit the target's plane best; this one holds for any
field of view, past 90 degrees too. Whichever base the corners prefer is refined a little where the wanted
lens is of another kind, and then turned into it (lens_fit).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from orthoscope.fitting.lens_fit import FOCAL, converted
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.starts.closed_form import (
    CENTRED_SQUARE,
    GENERAL,
    NO_SKEW,
    intrinsics_of_homographies,
    poses_of_camera,
    poses_of_homographies,
)
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.geometry.projective import homographies_to_pixels
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.charts import GNOMONIC
from orthoscope.models.lenses.lens import Formula
from orthoscope.models.lenses.table import Brown, KannalaBrandt, Rational
from orthoscope.solve.least_squares import Options, solve
from orthoscope.solve.losses import Cauchy

__all__ = ["Assumptions", "StartingCameras", "formula_for", "starts", "starts_elsewhere", "suited_lens"]

# These diagonal fields of view are tried.
FIELDS_OF_VIEW = np.deg2rad([6, 12, 20, 30, 40, 60, 80, 100, 120, 140, 160, 180, 200, 220, 250])
# The scan over fields of view looks at so many views.
SCANNED_VIEWS = 12
# So many views tell whether a base fits, and refine it.
SAMPLE_VIEWS = 48
# A pin-hole start that misses by less than this share of the diagonal is taken without looking further.
GOOD_SHARE = 0.01
# Corners farther from the axis than this, radians, ask for a lens of the angle.
WIDE_ANGLE = np.deg2rad(60.0)
# No lens of the plane is fitted to rays farther out than this, radians.
STEEP_ANGLE = np.deg2rad(88.0)
# A start off the frame is looked for with the principal point at these places, from the frame's middle in its
# sides.
PLACES_AROUND = [(x, y) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) if x or y]
# No principal point is looked for farther off the frame than so many of its sides.
FARTHEST_AWAY = 3.0
# So many starts off the frame are tried.
MOST_STARTS = 3
# These coefficients all mean no distortion, and lie in different valleys of the cost.
NEUTRAL_COEFFICIENTS: dict[type[Formula], tuple[dict[str, float], ...]] = {
    Rational: ({}, {"k1": 1.0, "k4": 1.0}),
}
# One lens of the angle for all, since what a lens finds out about its domain stays with it.
EQUIDISTANT = KannalaBrandt()


@dataclass(frozen=True)
class Assumptions:
    """What so few views cannot tell, and is assumed: which B are allowed, which parameters of K move, and the
    sentences to show.
    """

    basis: ndarray
    free: tuple[str, ...]
    assumptions: tuple[str, ...] = ()

    @classmethod
    def of(cls, views: int, *, skew: bool) -> Assumptions:
        """The paper's section 3.1 (and Zhang's): one view, two views, more."""
        if views == 1:
            told = "one view: the principal point is taken at the image's centre, fx = fy and skew = 0"
            return cls(CENTRED_SQUARE, ("fx=fy",), (told,))
        if views == 2:
            return cls(NO_SKEW, FOCAL, ("two views: skew is taken as 0",))
        return cls(GENERAL, (*FOCAL, "skew")) if skew else cls(NO_SKEW, FOCAL)

    def of_camera(self, K: Intrinsics) -> Intrinsics:
        """K with what is assumed made exactly so."""
        return replace(
            K, fy=K.fx if "fx=fy" in self.free else K.fy, skew=K.skew if "skew" in self.free else 0.0
        )


class StartingCameras:
    """The two base cameras for given corners, each with the poses that go with it; made when asked for, and
    once.
    """

    def __init__(
        self,
        observations: Observations,
        points: Float[ndarray, "p 3"],
        image_size: tuple[int, int],
        narrowing: Assumptions,
    ) -> None:
        self.observations, self.points, self.image_size, self.narrowing = (
            observations,
            points,
            image_size,
            narrowing,
        )
        self._refined: dict[Camera, Camera] = {}

    @cached_property
    def pinhole(self) -> Estimate | None:
        """Zhang's closed form as a camera without distortion; where the full form fails, with the principal
        point at the centre.
        """
        if self._closed_form is not None and _plausible(self._closed_form, self.image_size):
            return self._pinhole_with(self._closed_form)
        for allowed in (NO_SKEW, CENTRED_SQUARE):
            if len(allowed) < len(self.narrowing.basis):
                K = intrinsics_of_homographies(self._homographies, self.image_size, allowed)
                if K is not None and _plausible(K, self.image_size):
                    return self._pinhole_with(K)
        return None

    @cached_property
    def closed_form_is_off_the_frame(self) -> bool:
        """Whether Zhang's closed form puts the principal point beyond the frame, a camera else."""
        K = self._closed_form
        return (
            K is not None
            and _plausible(K, self.image_size, FARTHEST_AWAY)
            and not _plausible(K, self.image_size)
        )

    @cached_property
    def elsewhere(self) -> list[Estimate]:
        """Pin-holes whose principal point is off the frame's middle, likelier first: Zhang's closed form
        wherever it puts the point, and with the point held in places around the frame. Crops, lenses that
        shift and projectors have it there.
        """
        if "cx" not in self.narrowing.free:
            return []
        found = [self._closed_form]
        width, height = self.image_size
        for x, y in PLACES_AROUND:
            away = np.array([[1.0, 0.0, -x * width], [0.0, 1.0, -y * height], [0.0, 0.0, 1.0]])
            K = intrinsics_of_homographies(away @ self._homographies, self.image_size, CENTRED_SQUARE)
            found.append(K and replace(K, cx=K.cx + x * width, cy=K.cy + y * height))
        starts = [
            self._pinhole_with(K)
            for K in found
            if K is not None and _plausible(K, self.image_size, FARTHEST_AWAY)
        ]
        return sorted(starts, key=self.misfit)[:MOST_STARTS]

    @cached_property
    def _closed_form(self) -> Intrinsics | None:
        """Zhang's."""
        return intrinsics_of_homographies(self._homographies, self.image_size, self.narrowing.basis)

    @cached_property
    def _homographies(self) -> Float[ndarray, "m 3 3"]:
        observations = self.observations
        plane = self.points[observations.ids, :2]
        return homographies_to_pixels(plane, observations.pixels(), observations.present)

    def _pinhole_with(self, K: Intrinsics) -> Estimate:
        camera = Camera(self.image_size, self.narrowing.of_camera(K), Brown())
        return Estimate(
            camera, poses_of_homographies(np.linalg.solve(camera.intrinsics.matrix, self._homographies))
        )

    @cached_property
    def pinhole_fits(self) -> bool:
        """Whether the pin-hole misses the corners by so little that its lens will do the rest."""
        return self.pinhole is not None and self.misfit(self.pinhole) < GOOD_SHARE * float(
            np.hypot(*self.image_size)
        )

    @cached_property
    def angle(self) -> Estimate | None:
        """The equidistant camera, principal point at the centre, whose focal length suits the corners
        best.
        """
        some = self.observations.only(self.observations.evenly(SCANNED_VIEWS))
        diagonal = float(np.hypot(*self.image_size))
        tried = [_equidistant(self.image_size, diagonal / field) for field in FIELDS_OF_VIEW]
        misfits = [
            _misfit(Estimate(camera, poses_of_camera(camera, some, self.points)), some, self.points)
            for camera in tried
        ]
        best = int(np.argmin(misfits))
        return self.posed(tried[best]) if np.isfinite(misfits[best]) else None

    def misfit(self, base: Estimate) -> float:
        """rms, pixels, by which a base misses the corners of some of the views; infinite where it sees a
        corner nowhere.
        """
        rows = self.observations.evenly(SAMPLE_VIEWS)
        return _misfit(
            Estimate(base.camera, base.poses.only(rows)), self.observations.only(rows), self.points
        )

    def refined(self, base: Estimate) -> Camera:
        """A base camera with its own lens's first coefficients fitted, robustly, in a few steps, to some of
        the views.
        """
        if base.camera not in self._refined:
            self._refined[base.camera] = self._refine(base)
        return self._refined[base.camera]

    def _refine(self, base: Estimate) -> Camera:
        rows = self.observations.evenly(SAMPLE_VIEWS)
        camera, some = base.camera, self.observations.only(rows)
        problem = Reprojection(some, self.points, camera, (*self.narrowing.free, *camera.lens.free[:2]))
        loss, options = Cauchy(0.002 * max(self.image_size)), Options(max_steps=30, tolerance=1e-6)
        return solve(
            problem, Estimate(camera, base.poses.only(rows)), loss=loss, options=options
        ).unknowns.camera

    def rays(self, camera: Camera) -> Float[ndarray, "n 3"]:
        """Rays of a few thousand of the observed pixels, evenly picked; those that there are."""
        pixels = self.observations.pixels()[self.observations.present > 0]
        rays = camera.unproject(pixels[:: max(1, len(pixels) // 2000)])
        return rays[np.isfinite(rays[:, 0])]

    def posed(self, camera: Camera) -> Estimate:
        """A camera with its closed-form poses."""
        return Estimate(camera, poses_of_camera(camera, self.observations, self.points))


def starts(
    bases: StartingCameras, lens: type[Formula], *, coefficients: Sequence[str] | None = None
) -> Iterator[Estimate]:
    """Where to start from to get a camera with the wanted lens, the likelier first, each made when it is
    asked for.

    Args:
        coefficients: those that will move, by default what the lens frees; the others have their usual
            values.
    Raises:
        CalibrationError: the corners fit no camera, or lie where the wanted lens cannot see.
    """
    coefficients = lens.free if coefficients is None else coefficients
    if bases.pinhole is not None and bases.pinhole_fits:
        yield from _with_lens(bases, bases.pinhole, lens, coefficients)
        return
    found = False
    for base in sorted((base for base in (bases.angle, bases.pinhole) if base is not None), key=bases.misfit):
        try:
            with_lens = _with_lens(bases, base, lens, coefficients)
        except CalibrationError:
            if not found:  # the likeliest base says that the lens cannot see these corners
                raise
            continue
        yield from with_lens
        found = True
    if not found:
        raise CalibrationError(
            "the corners fit no camera at all: neither a pin-hole nor a fisheye sees them as images of a flat"
            " target. Check that the target's columns and rows are right and that the corners are listed in"
            " order."
        )


def starts_elsewhere(
    bases: StartingCameras, lens: type[Formula], coefficients: Sequence[str]
) -> list[Estimate]:
    """More starts, the principal point off the frame's middle, for when those of `starts` led nowhere
    good.
    """
    found: list[Estimate] = []
    for base in bases.elsewhere:
        try:
            found += _with_lens(bases, base, lens, coefficients)[:1]
        except CalibrationError:
            continue
    return found


def suited_lens(bases: StartingCameras) -> str:
    """The lens for someone who named none: `brown`, or `kannala_brandt` where corners lie more than
    WIDE_ANGLE from the axis.
    """
    if bases.pinhole_fits or bases.angle is None:
        return "brown"
    return formula_for(bases.rays(bases.refined(bases.angle)))


def formula_for(rays: Float[ndarray, "n 3"]) -> str:
    """`brown`, or `kannala_brandt` where unit rays lie more than WIDE_ANGLE from the axis."""
    return "kannala_brandt" if np.nanmin(rays[:, 2], initial=1.0) < np.cos(WIDE_ANGLE) else "brown"


def _plausible(K: Intrinsics, image_size: tuple[int, int], away: float = 0.0) -> bool:
    """Whether K could belong to a camera that takes such images: its shape within 2, its principal point
    within the frame, or so many times the frame's sides away from it.
    """
    longer = max(image_size)
    return (
        0.1 * longer < K.fx < 100 * longer
        and 0.5 < K.fx / K.fy < 2.0
        and -away * image_size[0] < K.cx < (1.0 + away) * image_size[0]
        and -away * image_size[1] < K.cy < (1.0 + away) * image_size[1]
    )


def _equidistant(image_size: tuple[int, int], focal: float) -> Camera:
    width, height = image_size
    return Camera(image_size, Intrinsics(focal, focal, 0.5 * (width - 1), 0.5 * (height - 1)), EQUIDISTANT)


def _misfit(estimate: Estimate, observations: Observations, points: Float[ndarray, "p 3"]) -> float:
    """rms, pixels, of the corners about where the camera sees the target; infinite where it sees some corner
    nowhere.
    """
    camera, (rotation, translation) = estimate
    seen = points[observations.ids] @ rotation.transpose(0, 2, 1) + translation[:, None]
    e = camera.project(seen.reshape(-1, 3), beyond=True) - observations.pixels().reshape(-1, 2)
    misfit = float(np.sqrt((e * e).sum(1)[observations.present.ravel() > 0].mean()))
    return misfit if np.isfinite(misfit) else np.inf


def _with_lens(
    bases: StartingCameras, base: Estimate, lens: type[Formula], coefficients: Sequence[str]
) -> list[Estimate]:
    """A base with the wanted lens: as it is where that lens contains the base's own, else refined and
    converted.
    """
    if isinstance(base.camera.lens, lens) or (isinstance(base.camera.lens, Brown) and lens is Rational):
        alike = [same for same in NEUTRAL_COEFFICIENTS.get(lens, ({},)) if set(same) <= set(coefficients)]
        return [Estimate(replace(base.camera, lens=lens(**same)), base.poses) for same in alike]
    refined = bases.refined(base)
    rays = bases.rays(refined)
    if lens.chart is GNOMONIC:
        rays = _before_steep(rays, lens)
    free = (*bases.narrowing.free, *coefficients)
    groups = [[start] for start in lens.starts] if lens.several_minima else [lens.starts]
    return [bases.posed(converted(refined, lens, rays, free=free, starts=group)) for group in groups]


def _before_steep(rays: Float[ndarray, "n 3"], lens: type[Formula]) -> Float[ndarray, "m 3"]:
    """Rays without the few that lie beside or behind the camera; more than a few no lens of the plane can
    see.
    """
    flat = rays[:, 2] > np.cos(STEEP_ANGLE)
    if flat.mean() < 0.99:
        farthest = np.degrees(np.arccos(rays[:, 2].min()))
        raise CalibrationError(
            f"these corners lie up to {farthest:.0f} degrees from the axis, where the lens"
            f" {lens.__name__.lower()!r} cannot see (it ends before 90). Use a lens of the angle: --lens"
            " kannala_brandt."
        )
    return rays[flat]
