"""Non-metric lens calibration, then the pin-hole (NMLDC), the paper's second peer.

The lens comes from straight lines alone, after the idea of Basu and Licardie; sizes on the target play no
part in it:
1. the lens about a centre of its own, so that the rows and columns of the target are images of straight lines
   (line_residuals.py);
2. the corners as a camera without that lens would see them;
3. the pin-hole by Zhang on these (pinhole.py): FCCM without a lens.

What straightness cannot tell is how large the straight image is (lens_about_centre.py: which coefficient
stands for it); K takes it up in step 3, so the camera's images lose nothing. It tells the centre only as far
as there is distortion: a lens without any has no centre. A. Basu and S. Licardie, Alternative models for
fish-eye lenses, PRL 16(4), 1995.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from orthoscope.fitting.calibration import Calibration, Uncertainty, residuals_of
from orthoscope.fitting.identifiability import check_known, told
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.starts.initial_camera import Assumptions, StartingCameras
from orthoscope.fitting.starts.pinhole import fit_pinhole
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import CalibrationError, Float, InputError, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.mldc.lens_about_centre import parse_centred_lens
from orthoscope.methods.mldc.lens_from_lines import MEASURES, StraightLens, fit_straight_lens
from orthoscope.models.camera import WIDEST_ANGLE, Camera
from orthoscope.models.lenses.table import lens_name
from orthoscope.solve.block_system import NormalEquations, shared_covariance
from orthoscope.solve.least_squares import Options, Solution, Status
from orthoscope.solve.losses import LOSSES, USUAL_SCALE, Linear
from orthoscope.targets.detections import Detections, View
from orthoscope.version import __version__

__all__ = ["nmldc"]

# Of ten thousand residuals' cost this share is a hundredth of their variance, and no step is worth while for
# less.
COST_TOLERANCE = 1e-6
# No step is worth while for less than this, px^2 (noise-free corners).
COST_FLOOR = 1e-14


@with_one_thread
def nmldc(
    detections: Detections,
    *,
    lens: str = "pfet",
    measure: str = "photograph",
    skew: bool = False,
    loss: str = "linear",
    loss_scale: float = USUAL_SCALE,
    max_steps: int = 200,
    progress: Callable[[int, float], None] | None = None,
) -> Calibration:
    """Calibrate the lens by straight lines alone, then the pin-hole on the straightened corners (the paper's
    NMLDC).

    One photograph is enough, with the pin-hole's assumptions of few views. The uncertainty of K has that of
    the lens in it.

    Args:
        detections: of a target with rows and columns.
        lens: a name of LENSES, or with the coefficients to free, `pfet:a3,a5`; `auto` is pfet. Radial
            coefficients are free, since the lens has a centre of its own.
        measure: `photograph`, the distance of a corner from the image of its line; or `straight-image`, its
            distance there from the line through its row, as the idea is commonly read
            (straightened_lines.py), far more sensitive to noise.
        skew: whether K has one.
        loss: how large errors count, a name of LOSSES.
        loss_scale: where the loss starts to matter, pixels.
        max_steps: of each search.
        progress: called after each step with (step, cost), the lens's first.
    Raises:
        CalibrationError: the lines or the views cannot tell the camera.
        InputError: a setting is none.
    """
    if measure not in MEASURES:
        raise InputError(f"measure is {measure!r}; expected one of {', '.join(MEASURES)}.")
    if loss not in LOSSES:
        raise InputError(f"loss {loss!r} is not known; expected one of {', '.join(LOSSES)}.")
    used = with_usable_views(detections)
    kind, coefficients = parse_centred_lens(lens)
    weighing, options = LOSSES[loss](loss_scale), Options(max_steps=max_steps, progress=progress)
    roughly = replace(options, tolerance=COST_TOLERANCE, floor=COST_FLOOR)
    bent = fit_straight_lens(
        Observations.of(used),
        used.target,
        used.image_size,
        kind,
        coefficients,
        measure=measure,
        loss=weighing,
        options=roughly,
    )  # 1
    own = bent.camera
    within = _within_reach(used, own)
    narrowing = Assumptions.of(len(within.views), skew=skew)
    bases = _bases(within, own, narrowing)  # 2
    pinhole = fit_pinhole(bases, loss=weighing, options=options)  # 3
    check_known(pinhole, narrowing.free, shared_covariance(pinhole.sums, 2 * within.corners), within)
    camera = Camera(used.image_size, pinhole.unknowns.camera.intrinsics, own.lens, lens_frame=own.intrinsics)
    poses, seen = bases.observations.poses_in_order(pinhole.unknowns.poses), _of_same_images(used, within)
    _check_sees(camera, poses, seen)
    uncertainty, said = _uncertainty(bent, within.corners, bases, pinhole)
    return Calibration(
        camera=camera,
        camera_from_target=poses,
        detections=seen,
        method="nmldc",
        settings={
            "lens": lens,
            "measure": measure,
            "skew": skew,
            "loss": loss,
            "loss_scale": loss_scale,
            "max_steps": max_steps,
        },
        uncertainty=uncertainty,
        status=next(
            (s.status for s in (bent.solution, pinhole) if s.status is not Status.CONVERGED), Status.CONVERGED
        ).value,
        steps=bent.solution.steps + pinhole.steps,
        version=__version__,
        assumptions=(*bent.assumptions, *narrowing.assumptions, *said),
    )


def _check_sees(camera: Camera, camera_from_target: Sequence[Pose], detections: Detections) -> None:
    """Check that the lens has an image of all corners that it was to be fitted to.

    Raises:
        CalibrationError: it has none of some.
    """
    residuals = np.concatenate(residuals_of(camera, camera_from_target, detections))
    if lost := int(np.isnan(residuals[:, 0]).sum()):
        raise CalibrationError(
            f"the lens {lens_name(camera.lens)!r} that keeps the lines straightest has no image of {lost} of"
            f" {len(residuals)} corners: they lie too far from its axis. Use a lens of the angle: --lens"
            " kannala_brandt."
        )


def _within_reach(detections: Detections, own: Camera) -> Detections:
    """The corners that a straight image can hold: within WIDEST_ANGLE of the lens's axis. Views that have too
    few of them are set aside.

    Raises:
        CalibrationError: no view is left.
    """

    def kept(view: View) -> View:
        seen = own.unproject(view.pixels)[:, 2] > np.cos(WIDEST_ANGLE)
        return View(view.image, view.ids[seen], view.pixels[seen])

    return with_usable_views(replace(detections, views=tuple(kept(view) for view in detections.views)))


def _of_same_images(detections: Detections, others: Detections) -> Detections:
    """The detections in those photographs that the others have too, with what the others set aside."""
    images = {view.image for view in others.views}
    return replace(
        detections,
        views=tuple(view for view in detections.views if view.image in images),
        set_aside=others.set_aside,
    )


def _bases(detections: Detections, own: Camera, narrowing: Assumptions) -> StartingCameras:
    """The corners as the lens's own camera would see them without its lens, ready for the pin-hole."""

    def straight(view: View) -> View:
        return View(view.image, view.ids, own.undistort_pixels(view.pixels))

    corrected = replace(detections, views=tuple(straight(view) for view in detections.views))
    return StartingCameras(
        Observations.of(corrected), detections.target.points, detections.image_size, narrowing
    )


def _uncertainty(
    bent: StraightLens, corners: int, bases: StartingCameras, pinhole: Solution[Estimate]
) -> tuple[Uncertainty, tuple[str, ...]]:
    """Covariance of K and lens together, and what to say of parameters that are open.

    Straightness and the pin-hole take different parts of the corners' errors, since a pin-hole moves by what
    keeps lines straight. So the covariance of K is the one that it has for a known lens, and that of the lens
    carried over.
    """
    lens, said = told(bent.free, bent.covariance)
    slopes = _pinhole_by_lens(bent, lens.names, bases, pinhole)
    carried = slopes @ lens.covariance
    of_pinhole = shared_covariance(pinhole.sums, 2 * corners) + carried @ slopes.T
    joint = np.block([[of_pinhole, carried], [carried.T, lens.covariance]])
    return Uncertainty((*bases.narrowing.free, *lens.names), joint), said


def _pinhole_by_lens(
    bent: StraightLens, names: tuple[str, ...], bases: StartingCameras, pinhole: Solution[Estimate]
) -> Float[ndarray, "k p"]:
    """How the parameters of K move with these of the lens: by a Gauss-Newton step after the straight corners.

    The residuals' derivatives by K and poses, times how the corners move, are what a problem with moved
    corners has on its right.
    """
    seen, free = bases.observations, bases.narrowing.free

    def sums_of(observations: Observations) -> NormalEquations:
        problem = Reprojection(observations, bases.points, pinhole.unknowns.camera, free)
        return problem.linearise(pinhole.unknowns, Linear())

    here = sums_of(seen)
    of_poses = here.B @ np.linalg.inv(here.C)
    slopes = bent.straight_slopes(names, np.stack([seen.u, seen.v])) * seen.present
    moved = [sums_of(replace(seen, u=seen.u + by_u, v=seen.v + by_v)) for by_u, by_v in slopes]
    right = [(of_poses @ (here.c - there.c)[:, :, None]).sum(0)[:, 0] - (here.a - there.a) for there in moved]
    eliminated = here.A - (of_poses @ here.B.transpose(0, 2, 1)).sum(0)
    return np.linalg.solve(eliminated, np.array(right).reshape(len(names), len(free)).T)
