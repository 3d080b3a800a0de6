"""The figure shows what the curves say, whatever they say."""

from __future__ import annotations

import numpy as np

from helpers.made_up import curve, curves
from orthoscope.paper.entries import MLDC, NMLDC
from orthoscope.paper.figures import looks, nce_figure
from orthoscope.report.figures import to_svg

TEST = {"of": "test_nce", "title": "test data", "level": "x"}


def test_both_panels_show_every_contender_and_the_paper_s_three_are_thick():
    of = curves(FCCM=[1.0, 2.0], NMLDC=[0.0, 0.02], MLDC=[3.0, 3.0], other=[0.5, 0.5])
    for kind in ("training_nce", "test_nce"):
        (axes,) = nce_figure(of, of=kind, title=kind, level="sigma (px)").axes
        width = {
            line.get_label(): line.get_linewidth()
            for line in axes.lines
            if not str(line.get_label()).startswith("_")
        }
        assert set(width) == {"FCCM", NMLDC, MLDC, "other"}
        assert width["other"] < min(width[name] for name in ("FCCM", NMLDC, MLDC))
        assert axes.get_xlabel() == "sigma (px)"


def test_errors_of_nothing_have_a_place_on_the_axis():
    below = nce_figure(curves(FCCM=[0.0, 2.0]), **TEST).axes[0].get_ylim()[0]
    assert below == 0.0
    low, high = nce_figure(curves(FCCM=[0.8, 2.0]), **TEST).axes[0].get_ylim()
    assert 0.1 < low < 0.8
    assert high > 2.0


def test_where_no_method_gave_a_camera_the_figure_says_so():
    figure = nce_figure({MLDC: curve(MLDC, [np.nan, np.nan])}, **TEST, even=True)
    assert "no method gave a camera" in to_svg(figure, "none")


def test_the_same_curves_give_the_same_bytes():
    first, again = (to_svg(nce_figure(curves(FCCM=[1.0, 2.0]), **TEST), "fig") for _ in range(2))
    assert first == again


def test_ten_curves_beside_the_papers_have_looks_of_their_own():
    names = ("FCCM", NMLDC, MLDC, *map(str, range(10)))
    drawn = looks(names)
    assert [look.name for look in drawn if look.thick] == ["FCCM", NMLDC, MLDC]
    assert len({look.marker for look in drawn}) == len(names)
    assert len({(look.colour, look.dashes) for look in drawn}) == len(names)
