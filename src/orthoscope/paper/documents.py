"""What a run leaves behind: the page and the CSV files, as texts by name.

Nothing is written here, so that all of it is there before the first file is replaced.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orthoscope.paper.claims.claim import main_headline
from orthoscope.paper.claims.in_figures import (
    figures_with_claims,
    on_photographs,
)
from orthoscope.paper.claims.in_tables import parameter_columns
from orthoscope.paper.curves import curves_of
from orthoscope.paper.entries import every_lens, with_skew
from orthoscope.paper.files import curves_csv, entries_csv, members_csv, table_csv, trials_csv
from orthoscope.paper.first_figure import first_figure
from orthoscope.paper.page import every_claim, paper_page
from orthoscope.paper.photographs import straightened
from orthoscope.paper.section4 import PARTS, SCENES, Results
from orthoscope.paper.step_two import of_step_two
from orthoscope.paper.times import Timing

__all__ = ["Documents", "documents"]

PAGE = "paper.html"


class Documents(NamedTuple):
    """The name of the page, its headline, and every text by its file's name."""

    page: str
    headline: str
    texts: dict[str, str]


def documents(results: Results, files: Mapping[str, Path] | None = None) -> Documents:
    """The page and CSV files of a run; files: where the photographs are, for Fig. 7."""
    plan, shown = results.plan, figures_with_claims(results)
    real = on_photographs(results)
    wanted = plan.only or PARTS
    fig7 = straightened(results.detections, files or {}) if results.detections and "fig7" in wanted else None
    fig1 = first_figure(results, files or {}) if "fig1" in wanted else None
    texts = {PAGE: paper_page(results, straightened=fig7, first=fig1)}
    texts |= {
        f"{exhibit.kind.name}.csv": curves_csv(exhibit.curves, exhibit.kind.axis.column)
        for exhibit in (*shown, *([real] if real else []))
    }
    texts |= {
        f"lenses_{scene}.csv": curves_csv(
            curves_of(results.outcomes, study="lenses", scene=scene), "noise_px"
        )
        for scene in SCENES
        if plan.wants("lenses")
    }
    texts["methods.csv"] = entries_csv(plan.everyone(), seed=plan.seed)
    if results.timings:
        texts["times.csv"] = table_csv(Timing._fields, results.timings)
    if fig1:
        pairs = np.concatenate([fig1.detected, fig1.corrected], axis=1).tolist()
        texts["fig1.csv"] = table_csv(("detected_x", "detected_y", "corrected_x", "corrected_y"), pairs)
    if results.members:
        texts["eq7.csv"] = members_csv(results.members)
    if real and "table1" in wanted:
        texts["table1.csv"] = _table1(results)
    texts["trials.csv"] = trials_csv(
        results.outcomes, (*plan.everyone(), *every_lens(plan.lenses), *of_step_two()), seed=plan.seed
    )
    if results.on_photographs:
        texts["trials_photographs.csv"] = trials_csv(
            results.on_photographs, with_skew(plan.everyone()), seed=plan.seed
        )
    return Documents(PAGE, main_headline(every_claim(results)), texts)


def _table1(results: Results) -> str:
    """The paper's Table 1, a row for each method."""
    parameters = ("fx", "fy", "cu", "cv", "gamma")
    spread = [name for parameter in parameters for name in (parameter, f"{parameter}_std")]
    rows = [
        (
            column.name,
            *(value for parameter in parameters for value in column.values[parameter]),
            column.training_nce,
            column.test_nce,
            column.failures,
        )
        for column in parameter_columns(results)
    ]
    return table_csv(("method", *spread, "training_nce", "test_nce", "failures"), rows)
