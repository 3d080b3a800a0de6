"""What an evaluation says in numbers: the cards at the top of the page and its tables, ready to be printed.

Every text here is plain; the page escapes it.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.numbers import (
    ABSENT,
    degrees,
    percent,
    pixels,
    probability,
    setting,
    six_digits,
    value_with_deviation,
    with_error,
)
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.table import lens_name
from orthoscope.report.field_of_view import field_of_view

__all__ = [
    "CandidateRow",
    "Card",
    "MisfitRow",
    "Parameter",
    "ViewRow",
    "camera_line",
    "candidate_rows",
    "cards",
    "lens_in_words",
    "lens_rows",
    "misfit_rows",
    "parameters",
    "settings_rows",
    "view_rows",
    "warnings",
]

# These coefficients are in radians; all others have no unit.
ANGLE_NAMES = ("tau_x", "tau_y", "w")


@dataclass(frozen=True)
class Card:
    """A key figure: what it is, its value and unit, and a line that says how to take it."""

    label: str
    value: str
    unit: str
    note: str


@dataclass(frozen=True)
class Parameter:
    """A row of the camera's table; `exact` is the value to the last digit."""

    name: str
    value: str
    deviation: str
    unit: str
    exact: str


@dataclass(frozen=True)
class ViewRow:
    """A row of the table of photographs, errors in pixels; `suspicion` is why it does not belong, else
    empty.
    """

    number: int
    image: str
    corners: int
    rms: str
    held_out_rms: str
    largest: str
    suspicion: str


@dataclass(frozen=True)
class MisfitRow:
    """A row of the table of misfits: of what, the part that views agree on and the part that they do not
    (px), F, F by chance, p-values.

    Attributes:
        moves: by how much the image of the camera is off for it, pixels, where that is known.
    """

    what: str
    systematic: str
    noise: str
    f: str
    chance: str
    p_value: str
    p_over_views: str
    moves: str


@dataclass(frozen=True)
class CandidateRow:
    """A row of what was tried: target shape, lens and how it was fitted, held-out error, its standard error
    and what it loses against the one taken, px; how many views could judge it.
    """

    target: str
    lens: str
    fit: str
    views: str
    held_out: str
    standard_error: str
    loses: str


def cards(evaluation: Evaluation) -> list[Card]:
    """The key figures in the order of their weight."""
    detections = evaluation.calibration.detections
    each = [len(view.ids) for view in detections.views]
    return [
        _held_out(evaluation),
        Card(
            "Error in the calibration",
            pixels(evaluation.rms_px),
            "px",
            f"rms per point; median {pixels(evaluation.median_px)}, largest {pixels(evaluation.largest_px)}",
        ),
        Card(
            "NCE",
            pixels(evaluation.nce),
            "",
            "normalised calibration error; 1 is what rounding to whole pixels alone would give",
        ),
        Card("Coverage", percent(evaluation.coverage), "", "of the frame's cells have corners in them"),
        Card(
            "Photographs",
            str(len(each)),
            "used",
            f"{len(detections.set_aside)} set aside, {len(evaluation.suspects)} suspect",
        ),
        Card("Corners", str(detections.corners), "", f"{_range(each)} in a photograph"),
    ]


def parameters(calibration: Calibration) -> list[Parameter]:
    """Intrinsics, the lens's own frame where it has one, the lens's coefficients, with standard deviations
    where they were estimated.

    Coefficients that were not estimated and are zero are left to `lens_rows`.
    """
    camera = calibration.camera
    rows = [(name, getattr(camera.intrinsics, name), "px") for name in ("fx", "fy", "cx", "cy", "skew")]
    if camera.lens_frame is not None:
        rows += [
            (f"lens_{name}", getattr(camera.lens_frame, name), "px")
            for name in ("fx", "fy", "cx", "cy", "skew")
        ]
    unused = _unused(calibration)
    coefficients = zip(camera.lens.names(), camera.lens.coefficients.tolist(), strict=True)
    rows += [
        (name, value, "rad" if name in ANGLE_NAMES else "")
        for name, value in coefficients
        if name not in unused
    ]
    deviations = calibration.uncertainty.deviations
    return [
        Parameter(name, *_value(value, deviations.get(name), bool(deviations)), unit, repr(float(value)))
        for name, value, unit in rows
    ]


def camera_line(calibration: Calibration) -> str:
    """Focal lengths and principal point with their standard deviations, one line."""
    K, deviations = calibration.camera.intrinsics, calibration.uncertainty.deviations
    return " · ".join(
        f"{name} {with_error(getattr(K, name), deviations.get(name, np.nan), alone=six_digits)}"
        for name in ("fx", "fy", "cx", "cy")
    )


def lens_rows(calibration: Calibration) -> list[tuple[str, str]]:
    """What the lens is and how much it sees, as name and text."""
    camera = calibration.camera
    angles = field_of_view(camera)
    rows = [
        ("formula", " ".join((inspect.getdoc(type(camera.lens)) or "").partition("\n\n")[0].split())),
        ("field of view, horizontal", degrees(angles.horizontal)),
        ("field of view, vertical", degrees(angles.vertical)),
        ("field of view, diagonal", degrees(angles.diagonal)),
        ("domain ends, from the axis", degrees(camera.lens.field_angle)),
        ("coefficients that stay zero", ", ".join(_unused(calibration))),
    ]
    return [(name, text) for name, text in rows if text]


def warnings(evaluation: Evaluation) -> list[str]:
    """The warnings that neither the assumptions nor the suspects say already."""
    said = [*evaluation.calibration.assumptions, *(reason for _, reason in evaluation.suspects)]
    return [
        sentence for sentence in evaluation.warnings if not any(words and words in sentence for words in said)
    ]


def misfit_rows(evaluation: Evaluation) -> list[MisfitRow]:
    """The target against its description, and the lens against its formula."""
    target, lens = evaluation.misfit.target, evaluation.misfit.lens
    both = (("target", target.test, target.moves_camera_px), ("lens formula", lens.test, float("nan")))
    return [
        MisfitRow(
            what,
            pixels(test.systematic_px),
            pixels(test.noise_px),
            pixels(test.f),
            pixels(test.chance),
            probability(test.p_value),
            probability(test.p_over_views),
            pixels(moves),
        )
        for what, test, moves in both
    ]


def candidate_rows(calibration: Calibration) -> list[CandidateRow]:
    """What the method tried, simplest first; nothing where it had no choice."""
    rows = []
    for one in calibration.candidates:
        value, error = value_with_deviation(one.held_out_px, one.standard_error_px)
        loses = "taken" if one.loses_px == 0.0 else pixels(one.loses_px)
        over = f" on {one.base}" if one.base and one.base != one.lens and one.fit == "joint" else ""
        how = {"joint": "with the poses", "pairs": "from pairs"}[one.fit]
        rows.append(
            CandidateRow(one.target, one.lens + over, how, str(one.views or ABSENT), value, error, loses)
        )
    return rows


def view_rows(evaluation: Evaluation) -> list[ViewRow]:
    """One row for each photograph that was used, in order."""
    calibration = evaluation.calibration
    suspects = dict(evaluation.suspects)
    errors = {view.image: view for view in evaluation.views}
    rows = []
    for i, (view, residuals) in enumerate(
        zip(calibration.detections.views, calibration.residuals(), strict=True)
    ):
        size = np.hypot(*residuals.T)
        size = size[np.isfinite(size)]
        error = errors.get(view.image)
        rows.append(
            ViewRow(
                number=i + 1,
                image=view.image,
                corners=len(view.ids),
                rms=pixels(error.rms_px) if error else ABSENT,
                held_out_rms=pixels(error.held_out_rms_px) if error else ABSENT,
                largest=pixels(float(size.max())) if len(size) else ABSENT,
                suspicion=suspects.get(view.image, ""),
            )
        )
    return rows


def settings_rows(calibration: Calibration) -> list[tuple[str, str]]:
    """The method's settings as name and text, in their order."""
    return [(str(name), setting(value)) for name, value in calibration.settings.items()]


def lens_in_words(camera: Camera) -> str:
    """The lens's name in the table of lenses, or what a free lens stands on."""
    lens = camera.lens
    return f"free, on {lens_name(lens.base)}" if isinstance(lens, FreeLens) else lens_name(lens)


def _held_out(evaluation: Evaluation) -> Card:
    if not np.isfinite(evaluation.held_out_rms_px):
        return Card("Error held out", ABSENT, "", "not done: no photograph could be kept back")
    how = f"in {evaluation.folds} folds" if evaluation.folds else "each photograph left out in its turn"
    value, error = value_with_deviation(evaluation.held_out_rms_px, evaluation.held_out_error_px)
    if error == ABSENT:
        return Card("Error held out", pixels(evaluation.held_out_rms_px), "px", f"rms per point, {how}")
    return Card("Error held out", value, f"± {error} px", f"rms per point, {how}; ± one standard error")


def _range(counts: list[int]) -> str:
    low, high = min(counts, default=0), max(counts, default=0)
    return str(low) if low == high else f"{low} to {high}"


def _value(value: float, deviation: float | None, some_estimated: bool) -> tuple[str, str]:
    """Value and standard deviation as text; a parameter that was not estimated while others were is fixed."""
    if deviation is None:
        return f"{value:.6g}", "fixed" if some_estimated else ABSENT
    return value_with_deviation(value, deviation)


def _unused(calibration: Calibration) -> list[str]:
    """Coefficients that the lens could have and does not: zero, and not estimated."""
    lens, estimated = calibration.camera.lens, calibration.uncertainty.deviations
    coefficients = zip(lens.names(), lens.coefficients.tolist(), strict=True)
    return [name for name, value in coefficients if name not in estimated and value == 0.0]
