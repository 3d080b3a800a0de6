"""The page: whole, closed, honest about names, the same every time."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import matplotlib as mpl
import numpy as np
import pytest

from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.numbers import ABSENT
from orthoscope.models.free_lens import FreeLens
from orthoscope.models.spline import Displacement, Lattice
from orthoscope.models.target_shape import TargetShape
from orthoscope.report import page as page_module
from orthoscope.report.page import report_page, write_report
from orthoscope.report.shape import shape_rows
from orthoscope.report.tables import (
    candidate_rows,
    cards,
    lens_name,
    misfit_rows,
    parameters,
    view_rows,
    warnings,
)

KINDS = ("ordinary", "suspicious", "fisheye", "single", "unheld", "misshapen", "shaped")
LOADS = {"src", "href", "xlink:href", "srcset", "data", "poster", "action"}


class Page(HTMLParser):
    """What a browser would be asked to fetch, all ids, and the visible text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.ids: list[str] = []
        self.tags: list[str] = []
        self.words: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name in LOADS:
                self.fetched.append(value or "")
            if name == "id":
                self.ids.append(value or "")

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def pages(every_evaluation) -> dict[str, str]:
    return {name: report_page(evaluation) for name, evaluation in every_evaluation.items()}


@pytest.fixture(scope="module")
def photographs() -> tuple[np.ndarray, np.ndarray]:
    ramp = np.add.outer(np.arange(90), np.arange(160)).astype(np.uint8)
    return np.stack([ramp, ramp[::-1], ramp], axis=-1), ramp


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_loads_nothing_but_itself(pages, kind):
    page = Page(pages[kind])
    assert all(place.startswith(("#", "data:image/")) for place in page.fetched)
    assert not {"script", "link", "iframe", "object", "base"} & set(page.tags)
    assert not re.search(r"url\((?!#)|@import", pages[kind])


def test_the_search_for_loads_finds_a_planted_one():
    assert Page('<p><img src="https://example.org/a.png"></p>').fetched == ["https://example.org/a.png"]


def test_a_page_with_photographs_loads_nothing_but_itself(ordinary, photographs):
    page = Page(report_page(ordinary, photograph=("left <1>.jpg", *photographs)))
    assert sum(place.startswith("data:image/jpeg") for place in page.fetched) == 2
    assert all(place.startswith(("#", "data:image/")) for place in page.fetched)
    assert "Before and after: left <1>.jpg" in "".join(page.words)


@pytest.mark.parametrize("kind", KINDS)
def test_no_two_things_on_a_page_share_an_id(pages, kind):
    ids = Page(pages[kind]).ids
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("kind", KINDS)
def test_every_number_that_does_not_exist_is_a_dash(pages, kind):
    words = " ".join(Page(pages[kind]).words)
    assert not re.search(r"\b(nan|inf|None)\b", words)


def test_the_same_evaluation_gives_the_same_bytes_in_another_process_too(pages):
    program = (
        "import sys; sys.path.insert(0, sys.argv[1]); import conftest as c\nfrom"
        " orthoscope.targets.detections import chessboard; from orthoscope.report.page import"
        " report_page\nmade = c.evaluated(c.photographed(c.narrow_camera(), chessboard(9, 6, 0.025), 14,"
        " tilt=0.6, distance=0.45))\nsys.stdout.buffer.write(report_page(made).encode())"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    other = subprocess.run(
        [sys.executable, "-c", program, os.path.dirname(__file__)],
        capture_output=True,
        check=True,
        env=environment,
    )
    assert other.stdout.decode() == pages["ordinary"]


def test_figures_neither_use_nor_change_matplotlibs_settings(ordinary, pages):
    with mpl.rc_context(
        {
            "font.size": 30.0,
            "axes.grid": True,
            "image.cmap": "jet",
            "svg.fonttype": "path",
            "lines.linewidth": 9.0,
        }
    ):
        before = dict(mpl.rcParams)
        assert report_page(ordinary) == pages["ordinary"]
        assert dict(mpl.rcParams) == before


def test_names_and_reasons_of_photographs_set_aside_are_there_and_escaped(pages):
    assert "<blurred>" not in pages["ordinary"]
    assert "&lt;blurred&gt; &amp; dark.jpg" in pages["ordinary"]
    assert "no chessboard of 9x6 found" in pages["ordinary"]


def test_hostile_words_do_not_become_markup(ordinary, monkeypatch):
    monkeypatch.setattr(page_module, "_plates", lambda _: [])  # the words are not in the figures
    words = "<script>alert(1)</script>"
    calibration = replace(
        ordinary.calibration, method=words, status=words, assumptions=(words,), settings={words: words}
    )
    page = report_page(
        replace(
            ordinary,
            calibration=calibration,
            verdict=ordinary.verdict._replace(far=words),
            warnings=(words,),
            suspects=((words, words),),
        )
    )
    assert "<script>" not in page


def test_the_page_says_the_verdict_the_suspects_the_assumptions_and_how_it_was_made(pages, every_evaluation):
    words = {kind: " ".join(" ".join(Page(page).words).split()) for kind, page in pages.items()}
    assert str(every_evaluation["ordinary"].verdict) in words["ordinary"]
    assert "its error is 7 times that of the others" in words["suspicious"]
    assert every_evaluation["single"].calibration.assumptions[0] in words["single"]
    for said in (
        "fccm",
        "converged: the step no longer changes the parameters",
        "k1, k2, p1, p2, k3",
        "0.1.0",
        "per point",
    ):
        assert said in words["ordinary"]


def test_a_warning_that_repeats_an_assumption_or_a_suspect_is_said_once(suspicious):
    image, reason = suspicious.suspects[0]
    calibration = replace(suspicious.calibration, assumptions=("square pixels",))
    evaluation = replace(
        suspicious,
        calibration=calibration,
        warnings=("square pixels", f"{image} is odd: {reason}", "few views"),
    )
    assert warnings(evaluation) == ["few views"]


def test_every_view_has_its_row_with_the_errors_of_its_own_name(suspicious):
    shuffled = replace(suspicious, views=suspicious.views[::-1])
    rows = view_rows(shuffled)
    assert [row.image for row in rows] == [view.image for view in suspicious.calibration.detections.views]
    assert [row.rms for row in rows] == [
        f"{view.rms_px:.3f}" if view.rms_px < 1 else f"{view.rms_px:.3g}" for view in suspicious.views
    ]
    assert [row.number for row in rows if row.suspicion] == [4]


def test_a_parameter_is_shown_to_the_second_digit_of_its_deviation_or_as_fixed(ordinary, single, unheld):
    shown = {row.name: (row.value, row.deviation, row.unit) for row in parameters(ordinary.calibration)}
    assert shown["fx"] == ("536.10", "0.31", "px")
    assert shown["skew"] == ("0", "fixed", "px")
    assert "tau_x" not in shown  # zero and not estimated: named below the table instead
    assert {row.name: row.deviation for row in parameters(single.calibration)}[
        "fy"
    ] == "2.0"  # tied to fx, 4 is its variance
    assert {row.deviation for row in parameters(unheld.calibration)} == {ABSENT}


def test_the_table_of_misfits_has_what_agrees_what_does_not_and_how_sure_that_is(misshapen, single):
    target, lens = misfit_rows(misshapen)
    test = misshapen.misfit.target.test
    assert (target.what, lens.what) == ("target", "lens formula")
    assert (target.systematic, target.noise) == (f"{test.systematic_px:.3f}", f"{test.noise_px:.3f}")
    assert (target.p_value, target.p_over_views, lens.moves) == ("< 0.001", "< 0.001", ABSENT)
    assert {row.f for row in misfit_rows(single)} == {ABSENT}


def test_a_target_whose_shape_was_estimated_has_its_table_and_its_figure_and_a_flat_one_has_not(
    pages, shaped
):
    assert "Shape of the target" in pages["shaped"]
    assert "Shape of the target" not in pages["misshapen"]
    rows = dict(shape_rows(shaped.calibration))
    assert rows["shape"] == "every corner its own place"
    assert rows["out of the plane, lowest to highest"] == "3.98 mm"  # 2 (1 - cos 3)
    assert shape_rows(replace(shaped.calibration, target_shape=TargetShape.flat(54))) == []


def test_what_was_tried_is_told_with_what_it_loses(pages, shaped):
    flat, free = candidate_rows(shaped.calibration)
    assert (flat.target, flat.held_out, flat.standard_error, flat.loses) == (
        "flat",
        "0.310",
        "0.020",
        "0.090",
    )
    assert free.loses == "taken"
    assert "What was tried" in pages["shaped"]
    assert "Formula against free lens" in pages["shaped"]
    assert "What was tried" not in pages["misshapen"]


def test_a_free_lens_is_named_with_what_it_stands_on(ordinary):
    camera = ordinary.calibration.camera
    lattice = Lattice.over(np.array([-1.0, -1.0]), np.array([1.0, 1.0]), (4, 4))
    free = FreeLens(camera.lens, Displacement(lattice, np.zeros((lattice.splines, 2))))
    assert lens_name(replace(camera, lens=free)) == "free, on brown"


def test_stretch_and_shear_are_what_the_print_was_made_with(shaped):
    x, y, _ = shaped.calibration.detections.target.points.T
    made = np.stack([0.001 * x + 0.002 * y, 0.004 * y, 0.0 * x], axis=-1)
    rows = dict(shape_rows(replace(shaped.calibration, target_shape=TargetShape("smooth", made))))
    assert rows["stretch of y against x"] == "+0.3 %"
    assert rows["shear"] == f"+{np.degrees(0.002):.2g}°"


def test_cards_say_that_nothing_was_held_out_instead_of_a_number(single):
    held_out = cards(single)[0]
    assert (held_out.value, held_out.unit) == (ABSENT, "")
    assert "not done" in held_out.note


def test_fifty_photographs_of_280_corners_make_a_page_below_three_megabytes_that_keeps_its_keys(dense):
    page = report_page(dense)
    assert len(page.encode()) < 3_000_000
    assert "data:image/png" in page  # dense marks are an image
    assert "each residual, magnified" in page


@pytest.fixture
def short(monkeypatch) -> str:
    """A page that takes no time, for what is about the file alone."""
    monkeypatch.setattr(page_module, "report_page", lambda *_, **__: "<p>± short</p>")
    return "<p>± short</p>"


def test_a_report_is_written_as_a_whole_and_leaves_nothing_beside_it(ordinary, short, tmp_path):
    (tmp_path / "report.html").write_text("old")
    write_report(ordinary, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_bytes() == short.encode()
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.usefixtures("short")
def test_an_interrupted_report_leaves_the_old_one(ordinary, tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    path.write_text("old")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_report(ordinary, path)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.usefixtures("short")
def test_a_place_that_cannot_be_written_is_an_input_error(ordinary, tmp_path):
    (tmp_path / "file").write_text("old")
    with pytest.raises(InputError, match="cannot be written"):
        write_report(ordinary, tmp_path / "file" / "report.html")


def test_a_photograph_of_another_kind_is_an_input_error(ordinary, photographs):
    with pytest.raises(InputError, match=r"float64 .*expected uint8"):
        report_page(ordinary, photograph=("a", photographs[0].astype(float), photographs[1]))


def test_the_page_module_alone_loads_neither_matplotlib_nor_jinja():
    program = (
        "import sys, orthoscope.report.page; sys.exit(bool({'matplotlib', 'jinja2'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
