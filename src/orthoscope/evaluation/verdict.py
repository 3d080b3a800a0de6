"""The verdict in plain words: what stands against trusting a calibration, and what to do about it.

Sentences are made of findings, each with its number; the thresholds that turn a number into a sentence stand
here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.coverage import emptiest_place
from orthoscope.evaluation.misfit.f_test import MisfitTest
from orthoscope.evaluation.misfit.misfit import Misfit
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.held_out import FEWEST_VIEWS, HeldOut
from orthoscope.models.free_lens import FreeLens
from orthoscope.models.lenses import lens_name
from orthoscope.solve.least_squares import Status

__all__ = [
    "Findings",
    "ViewError",
    "corners_beyond",
    "is_misfit",
    "suspects_among",
    "verdict_on",
    "warnings_about",
]

SUSPECT = 2.5  # times the typical view's rms: a view with more does not belong
NOTABLE = 0.3  # px: but not where it is small in itself
FEW_VIEWS = 8
SPARSE = 0.6  # of the frame
# held-out error above the training error by this share of it: the photographs were learnt, not the camera
LEARNT = 0.5
SURE = (
    0.01  # p-value of a misfit: one perfect set in a hundred is blamed for its target, and one for its lens
)
SURE_OVER_VIEWS = 0.05  # or, with too few views to get there, the least p-value that they can give
TELLING = 0.25  # of the noise: a misfit that is smaller adds less than a thirtieth to the error
NEGLIGIBLE = 0.01  # px: no misfit that is smaller matters to anyone
CURES = {  # of a target that is not what it is taken to be, by the shape that it was given
    "flat": "Estimate its shape: --method decoupled",
    "smooth": (
        "A smooth shape does not reach it: let every corner have its own place (--shape free), or use a"
        " flatter target"
    ),
    "free": (
        "Its shape was estimated, and this is left: does it bend between photographs? Fix it to something"
        " stiff"
    ),
}
ALTERNATIVES = ("brown", "rational", "kannala_brandt")  # lenses to try where a formula cannot follow


@dataclass(frozen=True, eq=False)
class ViewError:
    """One photograph's share: rms px per point in the calibration, and when it was held out (NaN where that
    was not done).
    """

    image: str
    corners: int
    rms_px: float
    held_out_rms_px: float


class Findings(NamedTuple):
    """What was found out: held-out errors, misfits, share of the frame covered, views that do not belong,
    corners beyond the domain.
    """

    calibration: Calibration
    unseen: HeldOut
    misfit: Misfit
    coverage: float
    suspects: tuple[tuple[str, str], ...]
    beyond: int


def suspects_among(views: tuple[ViewError, ...]) -> tuple[tuple[str, str], ...]:
    """Views whose error, held out where that was done, is far above the typical view's."""
    errors = np.array(
        [view.rms_px if np.isnan(view.held_out_rms_px) else view.held_out_rms_px for view in views]
    )
    typical = float(np.median(errors))
    return tuple(
        (
            view.image,
            (
                f"{error:.2f} px rms where a typical view has {typical:.2f}; look whether it is blurred,"
                " moving or another target"
            ),
        )
        for view, error in zip(views, errors, strict=True)
        if error > max(SUSPECT * typical, NOTABLE)
    )


def corners_beyond(calibration: Calibration) -> int:
    """How many corners lie where the lens formula has ended before them."""
    points = calibration.target_points
    views = zip(calibration.camera_from_target, calibration.detections.views, strict=True)
    seen = np.concatenate([pose.apply(points[view.ids]) for pose, view in views])
    return int(np.isnan(calibration.camera.project(seen)[:, 0]).sum())


def warnings_about(found: Findings) -> tuple[str, ...]:
    """Everything that a user should know before using the camera, a sentence each."""
    calibration, detections = found.calibration, found.calibration.detections
    views = len(detections.views)
    told = list(calibration.assumptions)
    if calibration.status != Status.CONVERGED:
        told.append(f"the solver {calibration.status}")
    if found.beyond:
        told.append(
            f"the lens formula folds over at {np.degrees(calibration.camera.lens.field_angle):.1f} degrees"
            f" from the axis, before {found.beyond} of {detections.corners} corners: it does not suit this"
            " lens there. Try another: --lens brown, rational or kannala_brandt"
        )
    told += _misfits(found)
    if views < FEW_VIEWS:
        told.append(
            f"only {views} view{'s' if views > 1 else ''}; 15 or more, tilted in different directions, make"
            " the camera certain"
        )
    if found.coverage < SPARSE:
        told.append(
            f"corners cover {100 * found.coverage:.0f} % of the frame; the lens is a guess elsewhere. Next,"
            f" photograph the target {emptiest_place(detections)}"
        )
    return (*told, *(f"{image} does not belong: {reason}" for image, reason in found.suspects))


def verdict_on(found: Findings) -> str:
    """One sentence: the error that counts, and whether anything stands against trusting it."""
    error, standard_error, trained = (
        found.unseen.rms_px,
        found.unseen.standard_error_px,
        found.calibration.rms_px,
    )
    if np.isnan(error):
        few = len(found.unseen.residuals) < FEWEST_VIEWS
        why = (
            "too few views to hold any out"
            if few
            else "without some of them, the others cannot tell the camera"
        )
        on_its_own = f"{_px(trained)} px on its own photographs; nothing says how it does on others: {why}."
        return f"{on_its_own} Take more photographs before trusting it."
    places = _places(standard_error)
    size = (
        f"{error:.{places}f} ± {standard_error:.{places}f} px on photographs that were not used "
        f"({trained:.{places}f} px on those that were)"
    )
    if found.beyond:
        return f"Do not trust this lens formula: it folds over inside the data, though it shows {size}."
    if error - trained > max(LEARNT * trained, standard_error):
        return (
            f"Do not trust this camera yet: {size}: it has learnt these photographs, not the camera. "
            "Take more, or use a lens with fewer coefficients."
        )
    if (
        is_misfit(found.misfit.target.test, len(found.unseen.residuals))
        and found.misfit.target.moves_camera_px > error
    ):
        return (
            f"Do not trust this camera yet, though it shows {size}: {_fault(found)}, which hides an error of "
            f"{found.misfit.target.moves_camera_px:.2g} px or more. {_cure(found)}."
        )
    if found.suspects:
        return f"Look at {_listed([image for image, _ in found.suspects])} first; as it is, {size}."
    if limit := _limit(found):
        return f"{size}; {limit}."
    if found.coverage < SPARSE:
        return f"{size}, where corners were seen: {100 * found.coverage:.0f} % of the frame."
    return f"{size}; it holds over {100 * found.coverage:.0f} % of the frame."


def is_misfit(test: MisfitTest, views: int) -> bool:
    """Whether a misfit is certain, by the F test and by the vote of the views, and large enough to matter."""
    certain = test.p_value < SURE and test.p_over_views <= max(SURE_OVER_VIEWS, 2.0 ** (1 - views))
    return certain and test.systematic_px > max(TELLING * test.noise_px, NEGLIGIBLE)


def _misfits(found: Findings) -> list[str]:
    """What the target and the lens formula are blamed for, with the figures."""
    target, lens, views = found.misfit.target, found.misfit.lens, len(found.calibration.detections.views)
    told = []
    if is_misfit(target.test, views):
        off = target.test.systematic_px
        told.append(
            f"{_fault(found)}: in view after view its corners are off their places by the same {off:.2g} px,"
            f" {1e3 * off / target.pixels_per_metre:.2g} mm on the target ({_against_chance(target.test)})."
            " Held-out photographs show the same target, so their error does not tell: the camera's image is"
            f" off by {target.moves_camera_px:.2g} px or more. {_cure(found)}"
        )
    if is_misfit(lens.test, views):
        told.append(
            f"{_lens(found)} cannot follow this lens: at the same places of the image corners are off by the"
            f" same {lens.test.systematic_px:.2g} px, whichever they are ({_against_chance(lens.test)})."
            f" {_other_lenses(found)}"
        )
    return told


def _against_chance(test: MisfitTest) -> str:
    return (
        f"{test.noise_px:.2g} px differ from view to view; F = {test.f:.3g} where chance gives"
        f" {max(test.chance, 1.0):.2g}"
    )


def _limit(found: Findings) -> str:
    """What limits the camera where that is not noise; empty where it is."""
    target, lens, views = found.misfit.target, found.misfit.lens, len(found.calibration.detections.views)
    if is_misfit(target.test, views):
        return (
            f"the target limits it: {target.test.systematic_px:.2g} px are corners that are not where they"
            f" should be. {_cure(found)}"
        )
    if is_misfit(lens.test, views):
        return (
            f"{_lens(found)} limits it: {lens.test.systematic_px:.2g} px are what it cannot follow."
            f" {_other_lenses(found)}"
        )
    return ""


def _fault(found: Findings) -> str:
    """What is wrong with the target."""
    flat = found.calibration.target_shape.kind == "flat"
    return (
        "the target is not flat, or not as it is described"
        if flat
        else "the target is not of the shape that was estimated"
    )


def _cure(found: Findings) -> str:
    return CURES[found.calibration.target_shape.kind]


def _lens(found: Findings) -> str:
    lens = found.calibration.camera.lens
    return (
        "the free lens, as stiff as its data made it,"
        if isinstance(lens, FreeLens)
        else f"the formula {lens_name(lens)}"
    )


def _other_lenses(found: Findings) -> str:
    """What to try instead: other lenses, the same too with all its coefficients where only some were free;
    corners for a free lens.
    """
    lens = found.calibration.camera.lens
    if isinstance(lens, FreeLens):
        return "Take more photographs that fill the frame"
    some = ":" in str(found.calibration.settings.get("lens", ""))
    names = [name for name in ALTERNATIVES if some or name != lens_name(lens)]
    return f"Try another: --lens {', '.join(names[:-1])} or {names[-1]}"


def _places(deviation: float) -> int:
    """Decimals that show a standard error of less than 0.005 px too; never fewer than two, never more than
    four.
    """
    return int(np.clip(np.ceil(-np.log10(max(2.0 * deviation, 1e-9))), 2, 4))


def _px(value: float) -> str:
    return f"{value:.{_places(value)}f}"


def _listed(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
