"""The page: whole, closed, honest about names, the same every time."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest

from orthoscope.files.images import write_image
from orthoscope.formats.own.json import load_evaluation, save
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.numbers import ABSENT
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.spline import Displacement, Lattice
from orthoscope.models.target_shape import TargetShape
from orthoscope.report import page as page_module
from orthoscope.report.page import report_page, write_report
from orthoscope.report.panels import PANELS
from orthoscope.report.pictures import picture_uri, pictures_of
from orthoscope.report.shape import shape_rows
from orthoscope.report.snippets import snippets
from orthoscope.report.tables import (
    candidate_rows,
    cards,
    lens_in_words,
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
        if self.tags and self.tags[-1] not in ("script", "style"):
            self.words.append(data)


@pytest.fixture(scope="module")
def pages(every_evaluation) -> dict[str, str]:
    return {name: report_page(evaluation) for name, evaluation in every_evaluation.items()}


@pytest.fixture(scope="module")
def photograph() -> np.ndarray:
    ramp = np.add.outer(np.arange(480) // 4, np.arange(640) // 4).astype(np.uint8)
    return np.stack([ramp, ramp[::-1], ramp], axis=-1)


def data_of(page: str) -> dict:
    """The numbers that the page's script draws."""
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert text
    return json.loads(text[1])


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_loads_nothing_but_itself(pages, kind):
    page = Page(pages[kind])
    assert all(place.startswith(("#", "data:image/")) for place in page.fetched)
    assert not {"link", "iframe", "object", "base"} & set(page.tags)
    assert not re.search(r"url\((?!#)|@import|fetch\(|XMLHttpRequest|importScripts", pages[kind])


def test_the_search_for_loads_finds_a_planted_one():
    assert Page('<p><img src="https://example.org/a.png"></p>').fetched == ["https://example.org/a.png"]


def test_only_our_own_script_and_style_may_run(pages):
    page = pages["ordinary"]
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy
    allowed = policy[1]
    for element in ("style", "script"):
        text = re.search(rf"<{element}>(.*?)</{element}>", page, re.DOTALL)
        assert text
        told = base64.b64encode(hashlib.sha256(text[1].encode()).digest()).decode()
        assert f"{element}-src 'sha256-{told}'" in allowed
    assert "default-src 'none'" in allowed
    assert not re.search(
        r'<[a-z]+ [^>]*\s(style|on[a-z]+)="', page.partition("<body>")[2].partition("<script")[0]
    )


def test_a_page_with_photographs_shows_each_small_and_one_before_and_after(ordinary, photograph, tmp_path):
    views = ordinary.calibration.detections.views
    files = {view.image: tmp_path / view.image for view in views}
    for path in files.values():
        write_image(path, photograph)
    pictures = pictures_of(ordinary.calibration, files)
    page = Page(report_page(ordinary, pictures=pictures))
    assert sum(place.startswith("data:image/jpeg") for place in page.fetched) == len(views) + 2
    assert f"Before and after: {pictures.large[0]}" in "".join(page.words)
    assert "svg" not in page.tags
    assert "--photos" not in "".join(page.words)


def test_a_photograph_that_is_not_at_hand_has_its_corners_drawn_and_the_page_says_how_it_is_shown(ordinary):
    text = report_page(ordinary)
    page, first = Page(text), ordinary.calibration.detections.views[0].pixels[0]
    assert page.tags.count("svg") == len(ordinary.calibration.detections.views)
    assert f"M{round(first[0])} {round(first[1])}h0" in text
    assert "orthoscope report calibration.json --photos PHOTOS" in "".join(page.words)


def test_photographs_that_cannot_be_read_or_have_another_size_are_not_shown(ordinary, photograph, tmp_path):
    files = {name: tmp_path / name for name in ("left01.jpg", "left02.jpg", "left03.jpg")}
    files["left01.jpg"].write_bytes(b"no picture")
    write_image(files["left02.jpg"], photograph[:100])
    write_image(files["left03.jpg"], photograph)
    assert set(pictures_of(ordinary.calibration, files).small) == {"left03.jpg"}


@pytest.mark.parametrize("most", [4_000, 20_000])
def test_a_picture_is_as_small_as_it_is_asked_to_be(most):
    noise = np.random.default_rng(0).integers(0, 256, (480, 640, 3)).astype(np.uint8)
    uri = picture_uri(noise, 640, most)
    assert len(uri) < 1.4 * most + 40
    shown = cv2.imdecode(np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape[1] / shown.shape[0] == pytest.approx(4 / 3, rel=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_the_numbers_of_a_page_are_those_of_the_evaluation(pages, every_evaluation, kind):
    data, evaluation = data_of(pages[kind]), every_evaluation[kind]
    views = evaluation.calibration.detections.views
    assert [view["name"] for view in data["views"]] == [view.image for view in views]
    for told, view, residuals in zip(data["views"], views, evaluation.calibration.residuals(), strict=True):
        finite = np.isfinite(residuals).all(1)
        assert [x is not None for x in told["ex"]] == finite.tolist()
        np.testing.assert_allclose(np.array(told["x"]) / 10, view.pixels[:, 0], atol=0.0501)  # tenths
        np.testing.assert_allclose(
            np.array(told["ey"], dtype=float)[finite] / 1000, residuals[finite, 1], atol=0.000501
        )  # thousandths
        assert told.get("ids", list(range(54))) == view.ids.tolist() or len(view.ids) != 54


@pytest.mark.parametrize("kind", KINDS)
def test_a_panel_is_drawn_or_says_why_it_is_empty(pages, every_evaluation, kind):
    data, page = data_of(pages[kind]), pages[kind]
    for panel in PANELS:
        told = panel.data(every_evaluation[kind])
        assert (panel.name in data["panels"]) == (not isinstance(told, str))
        if isinstance(told, str):
            assert f'id="{panel.name}" class="panel empty"' in page
            assert told in html.unescape(page)
        else:
            assert f'data-panel="{panel.name}"' in page


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
        " orthoscope.targets.target import chessboard; from orthoscope.report.page import"
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


def test_names_and_reasons_of_photographs_set_aside_are_there_and_escaped(pages):
    assert "<blurred>" not in pages["ordinary"]
    assert "&lt;blurred&gt; &amp; dark.jpg" in pages["ordinary"]
    assert "no chessboard of 9x6 found" in pages["ordinary"]


def test_hostile_words_do_not_become_markup(ordinary):
    words = "</script><script>alert(1)</script>"
    calibration = replace(
        ordinary.calibration, method=words, status=words, assumptions=(words,), settings={words: words}
    )
    page = report_page(
        replace(
            ordinary,
            calibration=calibration,
            verdict=ordinary.verdict._replace(far=words, limit=words, advice=words),
            warnings=(words,),
            suspects=((words, words),),
        )
    )
    assert page.count("<script") == 2  # the data and our own
    assert page.count("alert(1)") > 5


def test_the_page_says_the_verdict_the_suspects_the_assumptions_and_how_it_was_made(pages, every_evaluation):
    words = {kind: " ".join(" ".join(Page(page).words).split()) for kind, page in pages.items()}
    verdict = every_evaluation["ordinary"].verdict
    assert f"{verdict.grade} Off by about 0.12 px where corners were seen" in words["ordinary"]
    assert verdict.advice in words["ordinary"]
    assert "its error is 7 times that of the others" in words["suspicious"]
    assert every_evaluation["single"].calibration.assumptions[0] in words["single"]
    for said in (
        "fccm",
        "converged: the step no longer changes the parameters",
        "brown",
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
    assert "target-shape" in data_of(pages["shaped"])["panels"]
    assert "target-shape" not in data_of(pages["misshapen"])["panels"]
    rows = dict(shape_rows(shaped.calibration))
    assert rows["shape"] == "every corner its own place"
    assert rows["out of the plane, lowest to highest"] == "3.98 mm"  # 2 (1 - cos 3)
    assert shape_rows(replace(shaped.calibration, target_shape=TargetShape.flat(54))) == []


def test_the_line_on_the_map_is_said_to_hold_what_the_region_holds(pages, ordinary):
    assert f"Within the line, {100 * ordinary.error.share:.0f} % of the frame" in " ".join(
        Page(pages["ordinary"]).words
    )


def test_what_was_tried_is_told_with_what_it_loses(pages, shaped):
    flat, free = candidate_rows(shaped.calibration)
    assert (flat.target, flat.held_out, flat.standard_error, flat.loses) == (
        "flat",
        "0.310",
        "0.020",
        "0.090",
    )
    assert free.loses == "taken"
    assert [one["name"] for one in data_of(pages["shaped"])["panels"]["choice"]["candidates"]] == [
        "flat target, brown",
        "free target, brown",
    ]
    assert "difference" in data_of(pages["shaped"])["panels"]
    assert not {"choice", "difference"} & set(data_of(pages["misshapen"])["panels"])


def test_a_free_lens_is_named_with_what_it_stands_on(ordinary):
    camera = ordinary.calibration.camera
    lattice = Lattice.over(np.array([-1.0, -1.0]), np.array([1.0, 1.0]), (4, 4))
    free = FreeLens(camera.lens, Displacement(lattice, np.zeros((lattice.splines, 2))))
    assert lens_in_words(replace(camera, lens=free)) == "free, on brown"


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


def test_fifty_photographs_of_280_corners_make_a_page_below_a_megabyte(dense):
    assert len(report_page(dense).encode()) < 1_000_000


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


def test_a_photograph_of_another_kind_is_an_input_error(photograph):
    with pytest.raises(InputError, match=r"float64 .*expected uint8"):
        picture_uri(photograph.astype(float), 640, 10_000)


def test_what_is_copied_for_python_is_the_camera(ordinary):
    told = snippets(ordinary.calibration)
    assert [one.tool for one in told] == ["OpenCV", "ROS", "Python"]
    names: dict = {}
    exec(told[2].text, names)
    K, dist = ordinary.calibration.camera.opencv()
    np.testing.assert_array_equal(names["K"], K)
    np.testing.assert_array_equal(names["dist"], dist)
    assert names["size"] == (640, 480)


def test_a_page_is_made_without_matplotlib_and_without_a_template_language(ordinary, tmp_path):
    save(ordinary.calibration, tmp_path / "calibration.json")
    save(ordinary, tmp_path / "evaluation.json")
    program = (
        "import sys; from orthoscope import load_evaluation, write_report;"
        " write_report(load_evaluation(sys.argv[1] + '/evaluation.json'), sys.argv[1] + '/report.html');"
        " sys.exit(', '.join({'matplotlib', 'jinja2', 'tqdm'} & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "report.html").read_text() == report_page(
        load_evaluation(tmp_path / "evaluation.json")
    )
