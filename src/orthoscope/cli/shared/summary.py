"""What the verbs print: an evaluation as a few lines, or as one JSON object."""

from __future__ import annotations

import json
import math
from collections import Counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from orthoscope.evaluation.evaluate import Evaluation
    from orthoscope.evaluation.misfit.f_test import MisfitTest
    from orthoscope.fitting.calibration import Calibration
    from orthoscope.models.camera import Camera
    from orthoscope.targets.detections import Outlier

__all__ = ["camera_numbers", "evaluation_lines", "to_json"]

# So many photographs that were set aside are listed one by one.
LISTED_PHOTOGRAPHS = 6
# One photograph makes the held-out error where without it no more than this share is left.
ONE_MAKES_SHARE = 0.7


def evaluation_lines(evaluation: Evaluation, *, verbose: bool = False) -> list[str]:
    """The summary: the verdict, the camera, the photographs.

    Args:
        verbose: all that was found out as well.
    """
    calibration = evaluation.calibration
    lines = [
        f"verdict    {evaluation.verdict}",
        f"camera     {_camera_line(calibration)}",
        f"photos     {_photographs_line(evaluation)}",
    ]
    return [*lines, *_details(evaluation)] if verbose else lines


def _camera_line(calibration: Calibration) -> str:
    """K with standard deviations, and the lens's name."""
    from orthoscope.models.lenses.free import FreeLens
    from orthoscope.models.lenses.table import lens_name

    camera, deviations = calibration.camera, calibration.uncertainty.deviations
    values = dict(zip(("fx", "fy", "cx", "cy", "skew"), camera.intrinsics.as_tuple(), strict=True))
    told = [_number(name, value, deviations) for name, value in values.items() if value or name in deviations]
    lens = lens_name(camera.lens)
    if isinstance(camera.lens, FreeLens):
        lens += f" on {lens_name(camera.lens.base)}"
    unsure = "" if deviations else f"  (how sure they are, {calibration.method} does not tell)"
    return "  ".join([*told, f"lens {lens}"]) + unsure


def _photographs_line(evaluation: Evaluation) -> str:
    """How many there are, what was left out, and what the camera misses on those that it was not made from."""
    detections = evaluation.calibration.detections
    aside, outliers = len(detections.set_aside), len(detections.outliers)
    parts = [f"{len(detections.views)} used, {detections.corners} corners"]
    parts += [f"{aside} set aside"] if aside else []
    parts += [f"{outliers} corner{'s' if outliers > 1 else ''} left out"] if outliers else []
    if not math.isnan(evaluation.held_out_rms_px):
        parts.append(
            f"corners missed by {evaluation.held_out_rms_px:.2g} px where a photograph was not used"
            + _but_for_one(evaluation)
        )
    return "; ".join(parts) + (" (--verbose says which)" if aside or outliers else "")


def _but_for_one(evaluation: Evaluation) -> str:
    """Which photograph alone makes the held-out error what it is, if one does."""
    views = [view for view in evaluation.views if not math.isnan(view.held_out_rms_px)]
    squares = [view.corners * view.held_out_rms_px**2 for view in views]
    corners = sum(view.corners for view in views)
    if len(views) < 2:
        return ""
    worst = max(range(len(views)), key=lambda i: squares[i])
    rest = math.sqrt((sum(squares) - squares[worst]) / (corners - views[worst].corners))
    if rest > ONE_MAKES_SHARE * evaluation.held_out_rms_px:
        return ""
    return f" ({rest:.2g} px but for {views[worst].image}, which the others do not foretell)"


def _details(evaluation: Evaluation) -> list[str]:
    """Figures for experts, and everything one by one."""
    from orthoscope.geometry.numbers import pixels, with_error

    calibration = evaluation.calibration
    detections, camera, aside = calibration.detections, calibration.camera, calibration.detections.set_aside
    deviations = calibration.uncertainty.deviations
    lines = [f"set aside  {entry.image}: {entry.reason}" for entry in aside[:LISTED_PHOTOGRAPHS]]
    lines += (
        [f"           and {len(aside) - LISTED_PHOTOGRAPHS} more, all in detections.json"]
        if len(aside) > LISTED_PHOTOGRAPHS
        else []
    )
    lines += _outlier_lines(detections.outliers)
    lines += [f"suspect    {image}: {reason}" for image, reason in evaluation.suspects]
    lines += _error_lines(evaluation)
    lines.append(
        f"rms        {pixels(evaluation.rms_px)} px per point (median {pixels(evaluation.median_px)}, largest"
        f" {pixels(evaluation.largest_px)})"
    )
    if not math.isnan(evaluation.held_out_rms_px):
        lines.append(
            f"held out   {with_error(evaluation.held_out_rms_px, evaluation.held_out_error_px)} px per point, "
            + (
                "each photograph left out in its turn"
                if not evaluation.folds
                else f"in {evaluation.folds} folds"
            )
        )
    lines.append(f"NCE        {evaluation.nce:.3f} (1 is what rounding to whole pixels would give)")
    lines.append(f"misfit     {_misfit_line(evaluation.misfit.target.test, evaluation.misfit.lens.test)}")
    found = evaluation.disagreement
    if not math.isnan(found.f2):
        lines.append(f"agreement  of the views on one camera: F {found.f2:.1f}, p {found.p_value:.1g}")
    coefficients = dict(zip(camera.lens.names(), camera.lens.coefficients, strict=True))
    told = "  ".join(
        _number(name, value, deviations)
        for name, value in coefficients.items()
        if value or name in deviations
    )
    lines.append(f"lens       {told}")
    if camera.lens_frame:
        centre = {"centre_x": camera.lens_frame.cx, "centre_y": camera.lens_frame.cy}
        lines.append(
            "           about its own centre  "
            + "  ".join(_number(name, value, deviations) for name, value in centre.items())
        )
    lines += _choice_lines(calibration)
    return lines + [f"assumed    {sentence}" for sentence in evaluation.warnings]


def _error_lines(evaluation: Evaluation) -> list[str]:
    """How far off the camera is, and what makes it up."""
    from orthoscope.geometry.numbers import pixels

    error = evaluation.error
    if error is None:
        return []
    return [
        f"off by     {pixels(error.seen_px)} px where corners were seen, {pixels(error.frame_px)} over the"
        f" frame; at the target's distances {pixels(error.near_seen_px)}, {pixels(error.near_frame_px)}",
        f"           of it {pixels(error.model_px)} by independent errors of corners,"
        f" {pixels(error.alike_px)} with errors alike in a view, {pixels(error.views_px)} by leaving views"
        f" out, {pixels(error.bias_px)} against the richest model,"
        f" {pixels(evaluation.disagreement.by_px)} since photographs differ",
    ]


def _choice_lines(calibration: Calibration) -> list[str]:
    """The target's shape, and what the next best of the candidates would lose."""
    from orthoscope.geometry.numbers import pixels

    shape, lines = calibration.target_shape, []
    if shape.kind != "flat":
        lines.append(
            f"target     {shape.kind}: corners {1e3 * shape.rms:.2g} mm rms from where they are said to be, "
            f"{1e3 * shape.height:.2g} mm from the lowest to the highest"
        )
    settings = calibration.settings
    others = [one for one in calibration.candidates if one.loses_px != 0.0]
    if others:
        other = min(others, key=lambda one: math.inf if math.isnan(one.held_out_px) else one.held_out_px)
        gains = other.loses_px < 0
        lines.append(
            f"choice     target {settings['shape']}, lens {settings['lens']}, base {settings['base']}; next target"
            f" {other.target}, lens {other.lens}, base {other.base} {'would gain' if gains else 'loses'}"
            f" {pixels(abs(other.loses_px))} px held out{', which may be chance' if gains else ''}"
        )
    return lines


def camera_numbers(camera: Camera) -> dict[str, Any]:
    """A camera as plain numbers."""
    from orthoscope.models.lenses.table import lens_name

    values = dict(zip(("fx", "fy", "cx", "cy", "skew"), camera.intrinsics.as_tuple(), strict=True))
    coefficients = dict(zip(camera.lens.names(), map(float, camera.lens.coefficients), strict=True))
    return {
        "width": camera.image_size[0],
        "height": camera.image_size[1],
        **values,
        "lens": {"name": lens_name(camera.lens), "coefficients": coefficients},
        "lens_frame": (
            camera.lens_frame
            and dict(zip(("fx", "fy", "cx", "cy", "skew"), camera.lens_frame.as_tuple(), strict=True))
        ),
    }


def _outlier_lines(outliers: tuple[Outlier, ...]) -> list[str]:
    """How many corners take no part, and in which photographs; nothing where there are none."""
    if not outliers:
        return []
    counts = Counter(outlier.image for outlier in outliers)
    shown = ", ".join(f"{image} ({count})" for image, count in list(counts.items())[:LISTED_PHOTOGRAPHS])
    more = f" and {len(counts) - LISTED_PHOTOGRAPHS} more" if len(counts) > LISTED_PHOTOGRAPHS else ""
    return [f"outliers   {len(outliers)} corner{'s' if len(outliers) > 1 else ''} left out: {shown}{more}"]


def to_json(numbers: Any) -> str:
    """One JSON text; NaN and infinity, which JSON has no word for, become null."""
    return json.dumps(_plain(numbers), indent=2, allow_nan=False, ensure_ascii=False)


def _misfit_line(target: MisfitTest, lens: MisfitTest) -> str:
    """What agrees from view to view: of the target's corners, and of the image's places."""
    if math.isnan(target.f) and math.isnan(lens.f):
        return "not tested: too few views"
    parts = (f"{what} {_systematic(test)}" for what, test in (("target", target), ("lens formula", lens)))
    return f"{', '.join(parts)} (the same in every view; F = 1 is noise)"


def _systematic(test: MisfitTest) -> str:
    from orthoscope.geometry.numbers import pixels

    return "not tested" if math.isnan(test.f) else f"{pixels(test.systematic_px)} px (F {test.f:.1f})"


def _plain(thing: Any) -> Any:
    if isinstance(thing, dict):
        return {key: _plain(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [_plain(value) for value in thing]
    return None if isinstance(thing, float) and not math.isfinite(thing) else thing


def _number(name: str, value: float, deviations: dict[str, float]) -> str:
    """`fx 533.04 ± 0.61`."""
    from orthoscope.geometry.numbers import six_digits, with_error

    return f"{name} {with_error(value, deviations.get(name, math.nan), alone=six_digits)}"
