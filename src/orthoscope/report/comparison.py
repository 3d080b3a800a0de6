"""The page of a comparison: one HTML file that needs no network.

The text is comparison.html.jinja, in the report's style (page.css); the figure goes in as SVG. The same
comparison gives the same bytes but for the seconds.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from orthoscope.evaluation.comparison.compare import Comparison, Standing
from orthoscope.evaluation.comparison.conclusions import as_good_as_best, conclusions
from orthoscope.geometry.numbers import ABSENT, pixels, with_error
from orthoscope.version import __version__

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = ["Row", "comparison_page", "comparison_svg", "rows"]

FIGURE = "errors"


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
    from markupsafe import Markup

    headline, *others = conclusions(comparison)
    return _template().render(
        version=__version__,
        detections=comparison.detections,
        folds=comparison.folds,
        headline=headline,
        conclusions=others,
        rows=rows(comparison),
        svg=Markup(_svg(comparison)),
    )


def comparison_svg(comparison: Comparison) -> str:
    """The figure as a file of its own."""
    return _svg(comparison).replace("var(--sans)", "sans-serif")


@cache
def _template() -> Template:
    """The page's template, everything escaped that is put into it; imported late, as in page.py."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("orthoscope", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("comparison.html.jinja")


def _svg(comparison: Comparison) -> str:
    """The figure; imported late, since matplotlib takes its time."""
    from orthoscope.report.figures.comparison import comparison_errors
    from orthoscope.report.figures.style import to_svg

    return to_svg(comparison_errors(comparison), FIGURE)


def _row(standing: Standing, verdict: str) -> Row:
    judged = standing.held_out_px == standing.held_out_px
    return Row(
        name=standing.entry.name,
        verdict=verdict,
        held_out=with_error(standing.held_out_px, standing.error_px) if judged else ABSENT,
        loses=(
            with_error(standing.loses_px, standing.loses_error_px) if judged and verdict != "best" else ABSENT
        ),
        nce=_number(standing.nce, ".3f"),
        used=pixels(standing.rms_px),
        parameters=_number(standing.parameters, ".0f"),
        seconds=_number(standing.seconds, ".2f"),
        lens=standing.lens or ABSENT,
        shape=standing.shape or ABSENT,
        failure=standing.failure,
    )


def _number(value: float, form: str) -> str:
    return format(value, form) if value == value else ABSENT
