"""The figure and the page of a comparison: all entries in order, also those that could not; closed, escaped,
the same every time.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from orthoscope.evaluation.comparison.compare import Comparison, Standing
from orthoscope.evaluation.comparison.entry import Entry
from orthoscope.geometry.numbers import ABSENT
from orthoscope.report.comparison import comparison_page, comparison_svg, rows
from orthoscope.report.figures.comparison import comparison_errors

ERRORS = {
    "near": ((0.12, 0.0), (0.19, 0.07)),
    "far": ((0.12, 0.0), (0.19, 0.07), (7.0, 6.88)),
    "exact": ((0.0, 0.0), (0.0, 0.0)),
}
REASON = "no photograph shows <3> corners of a row & column"


def unable(calibration, failure: str = REASON) -> Standing:
    return Standing(
        Entry("nmldc:<pfet>", "nmldc", {}),
        np.full(14, np.nan),
        calibration and calibration.camera,
        failure=failure,
    )


def standing(calibration, name: str, held_out_px: float, loses_px: float) -> Standing:
    numbers: dict[str, Any] = {
        "rms_px": 0.9 * held_out_px,
        "nce": 0.3,
        "parameters": 9.0,
        "seconds": 0.0123,
        "loses_error_px": 0.1 * loses_px,
    }
    return Standing(
        Entry(name, "fccm", {}),
        np.ones(14),
        calibration.camera,
        calibration.target_shape,
        "brown",
        held_out_px,
        0.05 * held_out_px,
        loses_px,
        **numbers,
    )


@pytest.fixture(params=[*ERRORS, "nobody"])
def comparison(request, ordinary) -> Comparison:
    judged = [
        standing(ordinary.calibration, f"fccm:lens{i}", *pair)
        for i, pair in enumerate(ERRORS.get(request.param, ()))
    ]
    return Comparison(
        ordinary.calibration.detections, 5, (*judged, unable(None), unable(ordinary.calibration))
    )


@pytest.fixture
def far(ordinary) -> Comparison:
    judged = [standing(ordinary.calibration, f"fccm:lens{i}", *pair) for i, pair in enumerate(ERRORS["far"])]
    return Comparison(ordinary.calibration.detections, 5, (*judged, unable(None)))


def test_the_figure_has_a_named_row_for_each_and_axes_with_units(comparison):
    figure = comparison_errors(comparison)
    assert isinstance(figure, Figure)
    left, right = figure.axes
    assert [label.get_text() for label in left.get_yticklabels()] == [
        each.entry.name for each in comparison.standings
    ]
    assert (left.get_xlabel(), right.get_xlabel()) == ("error (px per point)", "loses against the best (px)")
    top, bottom = left.transData.transform([(1.0, 0.0), (1.0, 1.0)])[:, 1]
    assert top > bottom  # the best on top
    assert {"no camera", "not in every view"} <= {text.get_text() for text in left.texts}


def test_errors_that_differ_much_are_drawn_on_a_logarithmic_axis_and_others_from_zero(far):
    left, right = comparison_errors(far).axes
    assert (left.get_xscale(), right.get_xscale()) == ("log", "symlog")
    left, right = comparison_errors(replace(far, standings=far.standings[:2])).axes
    assert (left.get_xscale(), right.get_xscale()) == ("linear", "linear")
    assert left.get_xlim()[0] == 0.0


def test_its_dots_are_the_errors(far):
    left, right = comparison_errors(far).axes
    dots = [
        np.array(line.get_xydata())
        for axes in (left, right)
        for line in axes.lines
        if line.get_marker() == "o"
    ]
    np.testing.assert_allclose(dots[0], [(0.12, 0), (0.19, 1), (7.0, 2)])
    np.testing.assert_allclose(dots[1], [(0.0, 0), (0.07, 1), (6.88, 2)])


def test_the_page_is_whole_closed_and_the_same_twice(comparison):
    page = comparison_page(comparison)
    assert page == comparison_page(comparison)
    assert page.endswith("</html>\n")
    assert "default-src 'none'" in page
    assert "http-equiv" in page
    assert all(f" {loads}=" not in page for loads in ("src", "srcset", "action"))
    assert "<pfet>" not in page
    assert "<3>" not in page
    assert "&lt;3&gt; corners of a row &amp; column" in page


def test_the_figures_file_stands_alone(far):
    svg = comparison_svg(far)
    assert svg.startswith("<svg")
    assert 'xmlns="http://www.w3.org/2000/svg"' in svg
    assert "var(" not in svg


def test_a_row_says_who_is_best_who_is_as_good_and_what_is_not_known(far):
    first, second, third = far.standings[:3]
    close = replace(second, loses_error_px=0.05)
    table = rows(replace(far, standings=(first, close, third, *far.standings[3:])))
    assert [row.verdict for row in table] == ["best", "as good", "", ""]
    assert table[0][:8] == ("fccm:lens0", "best", "0.1200 ± 0.0060", ABSENT, "0.300", "0.108", "9", "0.01")
    assert table[1].loses == "0.070 ± 0.050"
    assert (table[0].lens, table[0].shape) == ("brown", "flat")
    assert set(table[3][2:10]) == {ABSENT}
    assert table[3].failure == REASON
