"""Where a joint calibration starts: a camera good enough for its wanted lens, found without being told anything.

Floor 3.  Two roads.  *Pin-hole*: Zhang's closed form on the distorted corners.  *Angle*: an equidistant lens, r_d = theta, at a few focal
lengths, keeping the one whose rays fit the target's plane best; this one holds for any field of view, past 90 degrees too.  Whichever
base camera the corners prefer is refined a little where the wanted lens is of another kind, and then turned into it (lens_fit).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.geometry.projective import homographies_to_pixels
from orthoscope.methods.closed_form import CENTRED_SQUARE, GENERAL, NO_SKEW, intrinsics_of_homographies, poses_of_camera
from orthoscope.methods.lens_fit import FOCAL, converted
from orthoscope.methods.observations import Observations
from orthoscope.methods.reprojection import Estimate, Reprojection
from orthoscope.models.camera import Camera, Intrinsics
from orthoscope.models.charts import GNOMONIC
from orthoscope.models.lens import Lens
from orthoscope.models.lenses import Brown, KannalaBrandt, Rational
from orthoscope.solve.least_squares import Options, Solution, solve
from orthoscope.solve.losses import Cauchy

__all__ = ["Narrowing", "starting_cameras", "suited_lens"]

FIELDS = np.deg2rad([6, 12, 20, 30, 40, 60, 80, 100, 120, 140, 160, 180, 200, 220, 250])  # diagonal fields of view that are tried
SCANNED = 12  # views that the scan over them looks at
GOOD = 0.01  # a pin-hole start that misses by less than this share of the diagonal is taken without looking further
WIDE = np.deg2rad(60.0)  # corners farther from the axis than this ask for a lens of the angle
STEEP = np.deg2rad(88.0)  # rays farther out than this no lens of the plane is fitted to


@dataclass(frozen=True)
class Narrowing:
    """What so few views cannot tell, and is assumed: which B are allowed, which parameters of K move, and the sentence to show."""

    basis: ndarray
    free: tuple[str, ...]
    assumption: str | None

    @classmethod
    def of(cls, views: int, *, skew: bool) -> Narrowing:
        """The paper's section 3.1 (and Zhang's): one view, two views, more."""
        if views == 1:
            told = "one view: the principal point is taken at the image's centre, fx = fy and skew = 0"
            return cls(CENTRED_SQUARE, ("fx=fy",), told)
        if views == 2:
            return cls(NO_SKEW, FOCAL, "two views: skew is taken as 0")
        return cls(GENERAL if skew else NO_SKEW, (*FOCAL, "skew") if skew else FOCAL, None)


def starting_cameras(
    observations: Observations, points: Float[ndarray, "p 3"], image_size: tuple[int, int], lens: type[Lens], narrowing: Narrowing
) -> list[Camera]:
    """Cameras with the wanted lens to start from, the likelier first.

    Raises CalibrationError where the corners fit no camera, or lie where the wanted lens cannot see.
    """
    pinhole = _pinhole(observations, points, image_size, narrowing)
    of_the_plane = lens.chart is GNOMONIC
    diagonal = float(np.hypot(*image_size))
    if of_the_plane and pinhole is not None and _misfit(pinhole, observations, points) < GOOD * diagonal:
        bases = [pinhole]
    else:
        bases = [camera for camera in (_angle(observations, points, image_size), pinhole) if camera is not None]
    starts, refused = [], None
    for base in bases:
        try:
            starts.append(_with_lens(base, lens, observations, points, narrowing))
        except CalibrationError as error:
            refused = refused or error
    if not starts:
        raise refused or CalibrationError(
            "the corners fit no camera at all: neither a pin-hole nor a fisheye sees them as images of a flat target. "
            "Check that the target's columns and rows are right and that the corners are listed in order."
        )
    return starts


def suited_lens(observations: Observations, points: Float[ndarray, "p 3"], image_size: tuple[int, int], narrowing: Narrowing) -> str:
    """The lens for someone who named none: `brown`, or `kannala_brandt` where corners lie more than WIDE from the axis."""
    pinhole = _pinhole(observations, points, image_size, narrowing)
    if pinhole is not None and _misfit(pinhole, observations, points) < GOOD * float(np.hypot(*image_size)):
        return "brown"
    angle = _angle(observations, points, image_size)
    if angle is None:
        return "brown"
    refined = _refined(angle, observations, points, narrowing)
    rays = refined.unproject(_pixels(observations))
    return "kannala_brandt" if np.nanmin(rays[:, 2]) < np.cos(WIDE) else "brown"


def _pinhole(observations: Observations, points: ndarray, image_size: tuple[int, int], narrowing: Narrowing) -> Camera | None:
    """Zhang's closed form as a camera without distortion; where the full form fails, with the principal point at the centre."""
    plane = points[observations.ids, :2]
    homographies = homographies_to_pixels(plane, observations.pixels(), observations.present)
    for basis in (narrowing.basis, *(narrower for narrower in (NO_SKEW, CENTRED_SQUARE) if len(narrower) < len(narrowing.basis))):
        K = intrinsics_of_homographies(homographies, image_size, basis)
        if K is not None and _plausible(K, image_size):
            return Camera(image_size, K if "skew" in narrowing.free else replace(K, skew=0.0), Brown())
    return None


def _plausible(K: Intrinsics, image_size: tuple[int, int]) -> bool:
    """Whether K could belong to a camera that takes such images: its shape within 2, its principal point within the frame."""
    longer = max(image_size)
    return 0.1 * longer < K.fx < 100 * longer and 0.5 < K.fx / K.fy < 2.0 and 0 < K.cx < image_size[0] and 0 < K.cy < image_size[1]


def _angle(observations: Observations, points: ndarray, image_size: tuple[int, int]) -> Camera | None:
    """The equidistant camera, principal point at the centre, whose focal length suits the corners best."""
    some = observations.some(SCANNED)
    diagonal = float(np.hypot(*image_size))
    tried = [_equidistant(image_size, diagonal / field) for field in FIELDS]
    misfits = [_misfit(camera, some, points) for camera in tried]
    best = int(np.argmin(misfits))
    return tried[best] if np.isfinite(misfits[best]) else None


def _equidistant(image_size: tuple[int, int], focal: float) -> Camera:
    width, height = image_size
    return Camera(image_size, Intrinsics(focal, focal, 0.5 * (width - 1), 0.5 * (height - 1)), KannalaBrandt())


def _misfit(camera: Camera, observations: Observations, points: ndarray) -> float:
    """rms, pixels, of the corners about where the camera sees the target in its closed-form poses; infinite where it sees it nowhere."""
    poses = poses_of_camera(camera, observations, points)
    e = Reprojection(observations, points, camera).residuals(Estimate(camera, poses))
    misfit = float(np.sqrt((e * e).sum() / observations.corners))
    return misfit if np.isfinite(misfit) else np.inf


def _with_lens(base: Camera, lens: type[Lens], observations: Observations, points: ndarray, narrowing: Narrowing) -> Camera:
    """The base camera with the wanted lens: as it is where that lens contains it, else refined and converted."""
    if isinstance(base.lens, lens) or (isinstance(base.lens, Brown) and lens is Rational):
        return replace(base, lens=lens())
    refined = _refined(base, observations, points, narrowing)
    rays = refined.unproject(_pixels(observations))
    seen = rays[np.isfinite(rays[:, 0])]
    if lens.chart is GNOMONIC:
        flat = seen[:, 2] > np.cos(STEEP)
        if flat.mean() < 0.99:
            farthest = np.degrees(np.arccos(seen[:, 2].min()))
            raise CalibrationError(
                f"these corners lie up to {farthest:.0f} degrees from the axis, where the lens {lens.__name__.lower()!r} cannot see (it ends "
                "before 90). Use a lens of the angle: --lens kannala_brandt."
            )
        seen = seen[flat]
    return converted(refined, lens, seen)


def _pixels(observations: Observations) -> Float[ndarray, "n 2"]:
    """At most a few thousand of the observed pixels, evenly picked."""
    pixels = observations.pixels()[observations.present > 0]
    return pixels[:: max(1, len(pixels) // 2000)]


def _refined(base: Camera, observations: Observations, points: ndarray, narrowing: Narrowing) -> Camera:
    """The base camera with its own lens's first coefficients fitted, robustly, in a few steps."""
    some = observations.some(4 * SCANNED)
    problem = Reprojection(some, points, base, (*narrowing.free, *base.lens.free[:2]))
    start = Estimate(base, poses_of_camera(base, some, points))
    solution: Solution[Estimate] = solve(
        problem, start, loss=Cauchy(0.002 * max(base.image_size)), options=Options(max_steps=30, tolerance=1e-6)
    )
    return solution.unknowns.camera
