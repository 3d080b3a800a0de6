"""The facts about a calibration that its verdict is made from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.coverage import emptiest_place
from orthoscope.evaluation.disagreement import AGREED, Disagreement
from orthoscope.evaluation.groups import Groups
from orthoscope.evaluation.misfit.misfit import Misfit
from orthoscope.evaluation.reference_fit import ReferenceFit
from orthoscope.evaluation.suspects import ViewError, precious_among, suspects_among
from orthoscope.evaluation.verdict.causes import is_misfit
from orthoscope.evaluation.verdict.situation import Situation, coarse_px
from orthoscope.fitting.calibration import Calibration, corners_beyond
from orthoscope.fitting.unseen.near_copies import near_copies
from orthoscope.geometry.arrays import median
from orthoscope.models.lenses.table import lens_name
from orthoscope.solve.least_squares import Status

__all__ = ["Findings", "situation_of"]

# With no more than this share of the views left without copies, that they agree says nothing.
DISTINCT_SHARE = 0.7
# A residual of more than this many times the median is farther off than heavy tails reach.
WILD_FACTOR = 12.0
# No residual below this, pixels, is called wild.
WILD_PX = 0.5


class Findings(NamedTuple):
    """What tests found out about a calibration; None where there was nothing to test by."""

    calibration: Calibration
    views: tuple[ViewError, ...]
    misfit: Misfit
    reference: ReferenceFit | None

    @property
    def disagreement(self) -> Disagreement:
        """Whether the photographs agree on one camera."""
        return self.reference.disagreement if self.reference else AGREED

    @property
    def groups(self) -> Groups | None:
        """Of photographs of two cameras; None where there is one."""
        return self.reference.groups if self.reference else None


def situation_of(found: Findings) -> Situation:
    """The facts."""
    calibration, reference, disagreement = found.calibration, found.reference, found.disagreement
    detections, settings = calibration.detections, calibration.settings
    views, distinct = len(detections.views), int(near_copies(detections).max(initial=-1)) + 1
    error = reference.error if reference else None
    target, lens = found.misfit.target, found.misfit.lens
    images = [view.image for view in detections.views]
    known = reference.known if reference else None
    suspects = suspects_among(found.views, reference.of_all if reference else None, detections.target.points)
    wild = _wild(calibration, {image for image, _ in suspects})
    told = distinct > DISTINCT_SHARE * views  # copies agree with each other whatever is true
    return Situation(
        method=calibration.method,
        lens=_formula_of(calibration),
        shape=calibration.target_shape.kind,
        base=str(settings.get("base", "")),
        first_lens=str(settings.get("first_lens", "")),
        loss=str(settings.get("loss", "")),
        views=views,
        distinct=distinct,
        converged=calibration.status == Status.CONVERGED,
        error_px=error.seen_px if error else float("nan"),
        near_px=error.near_seen_px if error else float("nan"),
        centre_sd=_centre_deviation(calibration),
        coarse_px=coarse_px(detections.image_size),
        share=error.share if error else 0.0,
        covered=error.seen_share if error else 0.0,
        place=emptiest_place(detections),
        noise_px=float(np.sqrt(2.0 * known.noise)) if known else calibration.rms_px,
        tilt=_tilt(calibration),
        corners=detections.corners,
        wild=sum(wild.values()),
        wild_in=tuple(sorted(wild, key=lambda image: -wild[image])),
        beyond=corners_beyond(
            calibration.camera, calibration.camera_from_target, calibration.target_points, detections
        ),
        fold=float(np.degrees(calibration.camera.lens.field_angle)),
        disagree=disagreement.kind,
        differ_px=disagreement.by_px,
        differ_focal=disagreement.focal,
        differ_centre_px=disagreement.centre_px,
        groups=tuple(tuple(images[i] for i in group) for group in found.groups[:2]) if found.groups else (),
        lens_px=lens.test.systematic_px if told and is_misfit(lens.test, views) else 0.0,
        target_px=target.test.systematic_px if told and is_misfit(target.test, views) else 0.0,
        target_mm=1e3 * target.test.systematic_px / target.pixels_per_metre,
        suspects=suspects,
        precious=precious_among(detections, reference.own_squares, reference.own_left_out)
        if reference
        else (),
    )


def _formula_of(calibration: Calibration) -> str:
    """The lens that was asked for, or where none was named the one that it came to."""
    asked = str(calibration.settings.get("lens", ""))
    return lens_name(calibration.camera.lens) if asked in ("", "auto") else asked


def _centre_deviation(calibration: Calibration) -> float:
    """Standard deviation of the principal point along x or y, whichever is larger, over the image's width."""
    deviations = calibration.uncertainty.deviations
    return max(deviations.get("cx", 0.0), deviations.get("cy", 0.0)) / calibration.camera.image_size[0]


def _wild(calibration: Calibration, suspects: set[str]) -> dict[str, int]:
    """How many corners of each image are far from where the others put them, images without any and
    photographs that do not belong left aside.
    """
    sizes = [np.hypot(*e.T) for e in calibration.residuals()]
    limit = max(WILD_FACTOR * median(np.concatenate(sizes)), WILD_PX)
    views = calibration.detections.views
    return {
        view.image: int((size > limit).sum())
        for size, view in zip(sizes, views, strict=True)
        if view.image not in suspects and (size > limit).any()
    }


def _tilt(calibration: Calibration) -> float:
    """The angle between the target's normal and the line of sight, degrees, in the photograph that has most
    but one.
    """
    points = calibration.detections.target.points
    tilts = []
    for pose, view in zip(calibration.camera_from_target, calibration.detections.views, strict=True):
        sight = pose.apply(points[view.ids].mean(0)[None])[0]
        cosine = float(np.abs(pose.rotation[:, 2] @ sight) / np.linalg.norm(sight))
        tilts.append(np.degrees(np.arccos(min(cosine, 1.0))))
    return float(np.sort(tilts)[-2]) if len(tilts) > 1 else tilts[0]
