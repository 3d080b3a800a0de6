"""The page of a comparison: one HTML file that needs no network and draws itself, as the report's.

The same comparison gives the same bytes but for the seconds.
"""

from __future__ import annotations

from math import isfinite
from typing import Any, NamedTuple

from orthoscope.evaluation.comparison.compare import Comparison, Standing
from orthoscope.evaluation.comparison.conclusions import as_good_as_best, conclusions
from orthoscope.geometry.numbers import ABSENT, fixed, pixels, with_error
from orthoscope.report.html import Content, Html, table, tag
from orthoscope.report.page import closed_page
from orthoscope.report.sections import figure
from orthoscope.version import __version__

__all__ = ["Row", "comparison_page", "comparison_svg", "rows"]

HEADINGS = (
    "method and lens",
    "",
    "held out (px)",
    "loses (px)",
    "NCE",
    "used (px)",
    "parameters",
    "time (s)",
    "lens",
    "target",
)
CAPTION = (
    "What counts is the error held out. Far above the error on photographs that were used: those were learnt."
    " Since all meet the same photographs, what one loses is known better than each error."
)
LABEL = "Dot chart of the error of each method and lens, held out and on photographs that were used"
NOTES = (
    (
        "Used: rms on the photographs that the calibration was made from. Held out: each method is run again"
        " without a fold of the photographs; on those its lens and target shape are fixed and only the"
        " board's pose is fitted. What it chooses by itself it chooses again. ± is one standard error,"
        " photographs being independent."
    ),
    (
        "Loses: held-out rms less that of the best, ± its standard error, paired by photograph. As good: less"
        " than two of these."
    ),
    (
        "Rms is per point: the root of the mean of |e|², as OpenCV prints it. NCE, the normalized calibration"
        " error, of held-out photographs: 1 is what rounding to whole pixels alone would give."
    ),
    (
        "A camera's file stays as it is; only the board's poses are fitted. What another program's camera was"
        " made from is not known: made from these very photographs, its error is not that of unseen ones."
    ),
    (
        "Parameters: how many of camera and target shape the data determined; not a whole number where priors"
        " shared in it. Lens, target: what it came to with all photographs; time, of that one calibration."
    ),
    "A dash (–) is a number that does not exist.",
)


class Row(NamedTuple):
    """A row of the table, plain texts; `verdict` is best, as good or empty."""

    name: str
    verdict: str
    held_out: str
    loses: str
    nce: str
    used: str
    parameters: str
    seconds: str
    lens: str
    shape: str
    failure: str


def rows(comparison: Comparison) -> list[Row]:
    """The table, the best first."""
    judged, as_good = comparison.judged, as_good_as_best(comparison)
    best = judged[0] if judged else None
    return [
        _row(each, "best" if each is best else "as good" if each in as_good else "")
        for each in comparison.standings
    ]


def comparison_page(comparison: Comparison) -> str:
    """The page as text."""
    detections, (said, *others) = comparison.detections, conclusions(comparison)
    width, height = detections.image_size
    facts = (
        f"{len(detections.views)} photographs of {detections.target.name} · {detections.corners} corners ·"
        f" {width} × {height} pixels · {comparison.folds} folds of views, the same for all"
    )
    listed = rows(comparison)
    body = [
        tag(
            "header",
            tag("p", "orthoscope · comparison", class_="kicker"),
            tag("h1", said),
            tag("p", facts, class_="facts"),
        ),
        tag(
            "main",
            _said("What follows", others),
            tag(
                "section",
                tag("h2", "Side by side"),
                tag("div", table(HEADINGS, map(_cells, listed), class_="numbers"), class_="scroll"),
                class_="panel",
            ),
            _said("Who could not be judged", [f"{row.name}: {row.failure}" for row in listed if row.failure]),
            figure("comparison", "Errors", CAPTION, LABEL),
        ),
        _closing(comparison),
    ]
    data = {
        "frame": None,
        "units": {},
        "views": [],
        "panels": {"comparison": {"entries": _entries(comparison)}},
    }
    title = f"Comparison: {len(detections.views)} photographs, {detections.target.name}"
    return closed_page(title, body, data=data, version=__version__)


def comparison_svg(comparison: Comparison) -> str:
    """The figure as a file of its own, for print; this loads matplotlib."""
    from orthoscope.report.figures.comparison import comparison_errors
    from orthoscope.report.figures.style import to_svg

    return to_svg(comparison_errors(comparison), "errors").replace("var(--sans)", "sans-serif")


def _said(title: str, sentences: list[str]) -> Html | None:
    if not sentences:
        return None
    listed = tag("ul", [tag("li", sentence) for sentence in sentences], class_="warnings")
    return tag("section", tag("h2", title), listed, class_="panel")


def _cells(row: Row) -> list[Content]:
    """A row of the table; a long name may break at its colons."""
    first, *others = row.name.split(":")
    name = [first, [[tag("wbr"), f":{part}"] for part in others]]
    return [
        name,
        tag("b", row.verdict) if row.verdict else "",
        row.held_out,
        row.loses,
        row.nce,
        row.used,
        row.parameters,
        row.seconds,
        row.lens,
        row.shape,
    ]


def _entries(comparison: Comparison) -> list[dict[str, Any]]:
    """What the script draws of each entry."""
    return [
        {
            "name": each.entry.name,
            "heldOut": _plain(each.held_out_px),
            "error": _plain(each.error_px),
            "told": f"{with_error(each.held_out_px, each.error_px)} px",
            "used": _plain(each.rms_px),
            "loses": _plain(each.loses_px),
            "failure": (
                "" if not each.failure else "no camera" if each.camera is None else "not in every view"
            ),
        }
        for each in comparison.standings
    ]


def _plain(value: float) -> float | None:
    return round(value, 6) if isfinite(value) else None


def _closing(comparison: Comparison) -> Html:
    detections = comparison.detections
    aside = f"{len(detections.set_aside)} photographs, {len(detections.outliers)} corners"
    made = (
        ("orthoscope", __version__),
        ("target", detections.target.name),
        ("folds", comparison.folds),
        ("left out, for all alike", aside),
    )
    return tag(
        "footer",
        tag(
            "div",
            tag("h2", "How it was made"),
            tag("dl", [[tag("dt", name), tag("dd", text)] for name, text in made]),
        ),
        tag("div", tag("h2", "How to read the numbers"), tag("ul", [tag("li", note) for note in NOTES])),
        class_="columns",
    )


def _row(standing: Standing, verdict: str) -> Row:
    judged = standing.held_out_px == standing.held_out_px
    return Row(
        name=standing.entry.name,
        verdict=verdict,
        held_out=with_error(standing.held_out_px, standing.error_px) if judged else ABSENT,
        loses=(
            with_error(standing.loses_px, standing.loses_error_px) if judged and verdict != "best" else ABSENT
        ),
        nce=fixed(standing.nce, 3),
        used=pixels(standing.rms_px),
        parameters=fixed(standing.parameters, 0),
        seconds=fixed(standing.seconds, 2),
        lens=standing.lens or ABSENT,
        shape=standing.shape or ABSENT,
        failure=standing.failure,
    )
