"""The report: one HTML file that needs no network, from an evaluation.

The text is page.html.jinja with page.css; figures go in as SVG, photographs as data URIs; a policy in the
page itself forbids the browser to load anything else. The same evaluation gives the same bytes: nothing of
the day or the machine goes in.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.files.whole_files import write_text
from orthoscope.geometry.arrays import ndarray
from orthoscope.report import tables
from orthoscope.report.shape import shape_rows

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = ["Photograph", "report_page", "write_report"]

Photograph = tuple[str, ndarray, ndarray]  # name, before, after: uint8, grey (h,w) or BGR (h,w,3)


def report_page(evaluation: Evaluation, *, photograph: Photograph | None = None) -> str:
    """The page as text.

    photograph: name, the photograph and the same without distortion (uint8, grey or BGR).
    Raises InputError where the photograph is no such array.
    """
    calibration = evaluation.calibration
    shown = _shown(photograph)  # first, since it can be wrong
    return _template().render(
        evaluation=evaluation,
        calibration=calibration,
        detections=calibration.detections,
        cards=tables.cards(evaluation),
        parameters=tables.parameters(calibration),
        lens=tables.lens_rows(calibration),
        misfits=tables.misfit_rows(evaluation),
        shape=shape_rows(calibration),
        candidates=tables.candidate_rows(calibration),
        warnings=tables.warnings(evaluation),
        views=tables.view_rows(evaluation),
        settings=tables.settings_rows(calibration),
        lens_name=tables.lens_name(calibration.camera),
        plates=_plates(evaluation),
        photograph=shown,
    )


def write_report(evaluation: Evaluation, path: str | Path, *, photograph: Photograph | None = None) -> None:
    """Write the page to a file, as a whole or not at all: an interrupted run leaves what was there before.

    Raises InputError where the file cannot be written or the photograph is none.
    """
    write_text(path, report_page(evaluation, photograph=photograph))


@cache
def _template() -> Template:
    """The page's template, everything escaped that is put into it; imported late, since most verbs make no
    page.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("orthoscope", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html.jinja")


def _plates(evaluation: Evaluation) -> list[dict[str, object]]:
    """Title, caption and SVG of each figure; imported late, since matplotlib takes its time."""
    from markupsafe import Markup

    from orthoscope.report.figures import to_svg
    from orthoscope.report.plates import PLATES

    return [
        {
            "title": p.title,
            "caption": p.caption,
            "wide": p.wide,
            "svg": Markup(to_svg(p.draw(evaluation), p.name)),
        }
        for p in PLATES
        if p.suits(evaluation)
    ]


def _shown(photograph: Photograph | None) -> dict[str, str] | None:
    if photograph is None:
        return None
    from orthoscope.report.figures import photograph_uri

    name, before, after = photograph
    return {"name": name, "before": photograph_uri(before), "after": photograph_uri(after)}
