"""Is a camera from elsewhere still this camera?  It is put beside the one that the photographs give.

Residuals with fitted poses are no answer: poses take up much of what is wrong with a camera, all of it where
views are few. So the photographs are calibrated anew, and the two cameras' images are compared over the seen
part, a turn fitted out. What is apart is given to the smallest change of K that explains most of it: a lens
that was turned or a zoom (focal length), a sensor or a crop that was shifted (principal point), both; what is
left is the lens itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan

import numpy as np

from orthoscope.evaluation.camera_error import rms_difference, seen_places
from orthoscope.evaluation.evaluate import examine
from orthoscope.evaluation.verdict.facts import situation_of
from orthoscope.evaluation.verdict.grades import Grade, by_error
from orthoscope.evaluation.verdict.situation import Situation, coarse_px
from orthoscope.evaluation.verdict.verdict import HEADS
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.slopes.image_slopes import difference_of_images, image_slopes, motion_slopes
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.geometry.numbers import rough_pixels
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.models.camera import Camera
from orthoscope.targets.detections import Detections

__all__ = ["CameraCheck", "check_camera"]

# Two cameras are the same to these photographs where they are apart by no more than this many times what the
# photographs know their own to.
SAME_CAMERA_FACTOR = 2.0
# A change of K is the reason where it explains this share of the squared difference.
REASON_SHARE = 0.95
# With fewer photographs, none can be left out to tell how well they know their camera.
FEWEST_VIEWS = 4
# The changes of K that are looked at, the simplest first: their names, and the parameters that move.
CHANGES = {
    "focal length": ("f",),
    "principal point": ("cx", "cy"),
    "focal length and principal point": ("f", "cx", "cy"),
    "focal lengths, unequally": ("fx", "fy"),
}


@dataclass(frozen=True, eq=False)
class CameraCheck:
    """A camera beside the one that other photographs give by themselves.

    Attributes:
        fresh: the calibration of the photographs.
        apart_px: rms difference of the two images over the seen part, a turn fitted out; pixels per point.
        known_px: how far off the fresh camera is itself, as predicted.
        changed: of CHANGES, or "lens" where no change of K explains the difference; empty where the cameras
            are the same to these photographs.
        focal_shares: of fx and fy, how much longer they are now, as shares; 0 where that is not the change.
        centre_px: (2,) by how much the principal point has moved, pixels; 0 where that is not the change.
        unexplained_px: what that change leaves of the difference.
    """

    fresh: Calibration
    apart_px: float
    known_px: float
    changed: str
    focal_shares: tuple[float, float]
    centre_px: tuple[float, float]
    unexplained_px: float

    @property
    def grade(self) -> Grade:
        """How far the camera may be trusted by what is apart."""
        size = self.fresh.camera.image_size
        return by_error(Situation(error_px=self.apart_px, coarse_px=coarse_px(size)))

    def __str__(self) -> str:
        head, apart = HEADS[self.grade], rough_pixels(self.apart_px)
        known = rough_pixels(self.known_px)
        their_own = f"the camera that these photographs give by themselves, which they know to {known} px"
        if not self.changed:
            return f"{head}: {their_own}, is {apart} px away."
        told = f"{head}: {apart} px from {their_own}."
        return " ".join(part for part in (told, self._reason(), self._advice()) if part)

    def _reason(self) -> str:
        changes = []
        fx, fy = (
            f"{100 * abs(share):.2g} % {'longer' if share > 0 else 'shorter'}" for share in self.focal_shares
        )
        if "unequally" in self.changed:
            changes.append(f"fx is {fx} and fy {fy} (pictures resized in one direction)")
        elif any(self.focal_shares):
            changes.append(f"the focal length is {fx} (zoom, focus)")
        if any(self.centre_px):
            x, y = self.centre_px
            changes.append(f"the principal point has moved by {x:+.1f}, {y:+.1f} px (crop, shift, a knock)")
        if not changes:
            return (
                "No change of focal length or principal point explains that: it is the lens, or its formula."
            )
        left = rough_pixels(self.unexplained_px)
        return f"Most of that is one change: {' and '.join(changes)}; {left} px are left."

    def _advice(self) -> str:
        return "" if self.grade == Grade.GOOD else "Calibrate anew, with these photographs or better ones."


@with_one_thread
def check_camera(camera: Camera, detections: Detections) -> CameraCheck | None:
    """Whether a camera is still the one that took these photographs.

    Args:
        camera: of the same image size as the photographs.
        detections: of photographs that it was not made from.
    Returns:
        None where the photographs tell no camera of their own: they are too few, all alike, or do not agree.
    """
    if len(detections.views) < FEWEST_VIEWS:
        return None
    try:
        fresh = decoupled(detections)
        found = examine(fresh)
    except CalibrationError:
        return None
    facts = situation_of(found)
    if isnan(facts.error_px) or facts.disagree or facts.error_px > facts.coarse_px:
        return None
    seen = seen_places(np.concatenate([view.pixels for view in fresh.detections.views]))
    apart = rms_difference(camera, fresh.camera, seen)
    if isnan(apart):
        return None
    if apart <= SAME_CAMERA_FACTOR * facts.error_px:
        return CameraCheck(fresh, apart, facts.error_px, "", (0.0, 0.0), (0.0, 0.0), apart)
    changed, step, left = _change(camera, fresh.camera, seen)
    return CameraCheck(
        fresh,
        apart,
        facts.error_px,
        changed,
        (step.get("f", step.get("fx", 0.0)), step.get("f", step.get("fy", 0.0))),
        (step.get("cx", 0.0), step.get("cy", 0.0)),
        left,
    )


def _change(
    camera: Camera, fresh: Camera, seen: Float[ndarray, "s 2"]
) -> tuple[str, dict[str, float], float]:
    """The simplest change of K that explains most of the difference, by how much, and what it leaves; "lens",
    nothing and all of it where none does.
    """
    rays = camera.unproject(seen)
    rays = rays[np.isfinite(rays[:, 0])]
    apart = difference_of_images(camera, fresh, rays, rays)
    known = np.isfinite(apart).all(1)
    wanted, rays = apart[known].ravel(), rays[known]
    by_k = image_slopes(camera, rays, ("fx", "fy", "cx", "cy"))
    fx, fy = camera.intrinsics.fx, camera.intrinsics.fy
    by_name = {"fx": fx * by_k[:, :, 0], "fy": fy * by_k[:, :, 1], "cx": by_k[:, :, 2], "cy": by_k[:, :, 3]}
    by_name["f"] = by_name["fx"] + by_name["fy"]
    motion = motion_slopes(camera, rays).reshape(len(wanted), -1)
    everything = float(np.sqrt((wanted**2).sum() / len(rays)))
    for name, moved in CHANGES.items():
        columns = np.column_stack([*(by_name[one].ravel() for one in moved), motion])
        step, *_ = np.linalg.lstsq(columns, wanted, rcond=None)
        left = wanted - columns @ step
        if (left**2).sum() <= (1.0 - REASON_SHARE) * (wanted**2).sum():
            values = dict(zip(moved, step.tolist(), strict=False))
            return name, values, float(np.sqrt((left**2).sum() / len(rays)))
    return "lens", {}, everything
