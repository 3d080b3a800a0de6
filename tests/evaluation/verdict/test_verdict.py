"""What a verdict says is true of the figures, and no two things that it can say contradict each other."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations, product

import click
import pytest

from orthoscope.cli.calibrate import calibrate
from orthoscope.evaluation.verdict.advice import ADVICE, advice_on
from orthoscope.evaluation.verdict.causes import CAUSES, listed
from orthoscope.evaluation.verdict.grades import (
    AWAY_PX,
    GRADES,
    NEAR_FINE_PX,
    WIDE_SHARE,
    Grade,
    by_error,
    lower,
)
from orthoscope.evaluation.verdict.situation import (
    FINE_PX,
    NEAR_PX,
    NOTHING_KNOWN,
    Situation,
    coarse_px,
)
from orthoscope.evaluation.verdict.verdict import verdict_on

NAN = float("nan")
ORDER = list(Grade)

FAULTS = {  # what can be wrong, each as the facts that say so
    "one photograph": {"views": 1, "distinct": 1, "error_px": NAN, "share": 0.0},
    "three photographs": {"views": 3, "distinct": 3, "error_px": 0.8, "share": 0.1},
    "nothing known": {"error_px": NAN, "share": 0.0},
    "copies": {"views": 30, "distinct": 5, "error_px": 0.9, "share": 0.1},
    "far off": {"error_px": 7.0, "share": 0.0},
    "far off, but not where the target was": {"error_px": 7.0, "near_px": 0.3, "share": 0.0},
    "axis adrift": {"error_px": 2.0, "near_px": 0.3, "share": 0.1, "centre_sd": 0.4},
    "off": {"error_px": 1.0, "share": 0.1},
    "noisy": {"error_px": 0.9, "noise_px": 0.8, "share": 0.2},
    "good where the target was": {"error_px": 0.58, "near_px": 0.1, "share": 0.2},
    "frontal": {"error_px": 0.9, "tilt": 3.0, "share": 0.2},
    "half the frame": {"share": 0.4, "covered": 0.4, "place": "at the top left"},
    "known nowhere well": {"error_px": 0.45, "share": 0.3},
    "folded": {"beyond": 12, "fold": 51.0, "error_px": 4.0, "share": 0.1},
    "not converged": {"converged": False},
    "lens": {"lens_px": 0.2, "error_px": 0.7, "share": 0.2},
    "lens, little": {"lens_px": 0.05},
    "target": {"target_px": 0.2, "target_mm": 0.3, "error_px": 2.5, "share": 0.0},
    "wild corners": {"wild": 40, "wild_in": ("a.jpg", "b.jpg")},
    "zoom": {"disagree": "zoom", "differ_px": 1.5, "differ_focal": 0.01, "error_px": 1.6, "share": 0.1},
    "centre": {"disagree": "centre", "differ_px": 0.4, "differ_centre_px": 6.0, "error_px": 0.45},
    "shutter": {"disagree": "shutter", "error_px": 0.9, "share": 0.2},
    "shutter that matters little": {"disagree": "shutter"},
    "another lens": {"disagree": "lens", "differ_px": 2.0, "error_px": 2.2, "share": 0.0},
    "differing in no way that has a name": {"disagree": "mixed", "differ_px": 0.6, "error_px": 0.9},
    "hardly differing": {"disagree": "mixed", "differ_px": 0.2, "error_px": 0.25},
    "two cameras": {
        "disagree": "zoom",
        "differ_px": 9.0,
        "error_px": 9.0,
        "share": 0.0,
        "groups": (("a.jpg", "b.jpg", "c.jpg", "d.jpg"), ("e.jpg", "f.jpg", "g.jpg", "h.jpg")),
    },
    "cameras that hardly differ": {"disagree": "zoom", "differ_px": 0.01},
    "suspect": {"suspects": (("a.jpg", "corners are off by 2 px"),)},
    "precious": {"precious": (("a.jpg", "at the top left"),)},
}

MADE_BY = {
    "default": {"method": "decoupled", "lens": "free", "shape": "free", "first_lens": "free"},
    "default, flat": {"method": "decoupled", "lens": "brown", "shape": "flat", "first_lens": "formula"},
    "default, smooth, for a tool": {
        "method": "decoupled",
        "lens": "rational",
        "shape": "smooth",
        "first_lens": "free",
    },
    "fccm": {"method": "fccm", "lens": "brown:k1,k2", "shape": "flat", "loss": "linear"},
    "mldc": {"method": "mldc", "lens": "pfet", "shape": "flat"},
}


def situations() -> list[Situation]:
    """Every fault alone and every two together, by every way to calibrate."""
    alone = [(), *((name,) for name in FAULTS)]
    found = []
    for names, made in product([*alone, *combinations(FAULTS, 2)], MADE_BY.values()):
        facts = {key: value for name in names for key, value in FAULTS[name].items()}
        found.append(Situation(**{**made, **facts}))
    return found


ALL = situations()
VERDICTS = [(s, verdict_on(s)) for s in ALL]


def in_use(s: Situation) -> dict[str, str]:
    """The options that a calibration was made with."""
    return {"--method": s.method, "--lens": s.lens, "--shape": s.shape}


def test_every_option_that_is_advised_exists():
    known = {
        option
        for parameter in calibrate.params
        if isinstance(parameter, click.Option)
        for option in parameter.opts
    }
    advised = {option for advice in ADVICE for option, _ in advice.options}
    assert advised
    assert advised <= known


def test_an_advice_names_its_options_in_words_and_no_others():
    for advice in ADVICE:
        told = advice.says(Situation(suspects=(("a", "b"),), precious=(("a", "b"),)))
        assert re.findall(r"--\w+", told) == [option for option, _ in advice.options]
        assert all(f"{option} {value}" in told for option, value in advice.options)


def test_no_advice_is_what_was_done():
    for s, verdict in VERDICTS:
        advice = advice_on(verdict.cause, s)
        if advice:
            assert not [option for option, value in advice.options if in_use(s)[option] == value]


def test_no_advice_leads_in_a_circle():
    """Whoever follows an option's advice is not sent back: with it in use, the same cause asks for something
    else.
    """
    keys = {"--method": "method", "--lens": "lens", "--shape": "shape"}
    for s in ALL:
        seen = set()
        while (advice := advice_on(verdict_on(s).cause, s)) and advice.options:
            assert advice.options not in seen
            seen.add(advice.options)
            s = replace(s, **{keys[option]: value for option, value in advice.options})


def test_whatever_is_wrong_there_is_something_to_do():
    assert {cause.name for cause in CAUSES} <= {advice.cause for advice in ADVICE}
    for _, verdict in VERDICTS:
        assert bool(verdict.advice) or not verdict.cause


def test_a_verdict_names_one_limit_at_most():
    for _, verdict in VERDICTS:
        assert bool(verdict.limit) == bool(verdict.cause)
        assert str(verdict).count(". ") <= 2


def test_the_grade_is_no_better_than_figures_and_faults_allow():
    for s, verdict in VERDICTS:
        grade = verdict.grade
        assert ORDER.index(grade) >= ORDER.index(by_error(s))
        for cause in CAUSES:
            if cause.holds(s):
                assert ORDER.index(grade) >= ORDER.index(cause.allows(s))


@pytest.mark.parametrize("fault", FAULTS)
def test_a_camera_that_is_farther_off_never_gets_a_better_grade(fault):
    errors = (0.01, 0.3, FINE_PX, 0.8, 1.5, 2.5, 6.0, NAN)
    for share in (1.0, 0.5, 0.0):
        facts = {**FAULTS[fault], "share": share}
        grades = [
            ORDER.index(verdict_on(Situation(**{**facts, "error_px": error})).grade) for error in errors
        ]
        assert grades == sorted(grades)


def test_words_are_those_of_an_ordinary_user():
    for _, verdict in VERDICTS:
        told = str(verdict)
        assert not re.search(
            r"\bF\b|\bp\b|NCE|foresee|held out|jackknife|max_steps|nan\b|\binf\b|  ", told
        ), told


def test_a_camera_that_is_said_to_hold_is_off_by_little():
    for s, verdict in VERDICTS:
        if verdict.grade in (Grade.GOOD, Grade.REGION):
            assert s.error_px <= FINE_PX or s.near_px <= NEAR_FINE_PX
            near = "at the distances where the target was"
            assert (f"less than {FINE_PX:g} px over" if s.error_px <= FINE_PX else near) in verdict.far
        if verdict.grade == Grade.GOOD:
            assert s.share >= WIDE_SHARE


def test_a_camera_that_is_open_far_away_still_serves_where_the_target_was():
    far = Situation(error_px=7.0, share=0.0)
    assert verdict_on(far).grade == Grade.NO
    near = verdict_on(replace(far, near_px=0.3))
    assert near.grade == Grade.USABLE
    assert "off by about 0.3 px at the distances where the target was, by 7 px far away" in near.far
    assert verdict_on(replace(far, near_px=NEAR_PX + 0.1)).grade == Grade.NO


def test_a_camera_that_is_right_where_the_target_was_and_hardly_off_far_away_is_good_in_that_region():
    s = Situation(error_px=0.58, near_px=0.1, share=0.2)
    verdict = verdict_on(s)
    assert (verdict.grade, verdict.cause) == (Grade.REGION, "open")
    assert "off by about 0.1 px at the distances where the target was, by 0.58 px far away" in verdict.far
    assert verdict_on(replace(s, near_px=1.1 * NEAR_FINE_PX)).grade == Grade.USABLE
    assert verdict_on(replace(s, error_px=1.1 * AWAY_PX)).grade == Grade.USABLE


def test_what_a_shutter_did_is_in_the_error_and_the_camera_is_one():
    verdict = verdict_on(Situation(**FAULTS["shutter"]))
    assert (verdict.grade, verdict.cause) == (Grade.USABLE, "photographs")
    assert "one camera" not in verdict.limit


@pytest.mark.parametrize(
    ("share", "covered", "cause"),
    [(0.4, 0.4, "region"), (0.2, 0.6, "open"), (0.5, 0.9, "open"), (0.8, 0.9, "")],
)
def test_corners_are_missing_where_the_camera_holds_over_what_lies_between_them(share, covered, cause):
    assert verdict_on(Situation(share=share, covered=covered, error_px=0.4)).cause == cause


@pytest.mark.parametrize("fault", ["shutter that matters little", "hardly differing"])
def test_photographs_that_differ_by_what_does_not_matter_are_not_blamed(fault):
    verdict = verdict_on(Situation(**FAULTS[fault]))
    assert (verdict.grade, verdict.cause) == (Grade.GOOD, "")


def test_what_differs_in_no_way_that_has_a_name_is_given_none():
    told = verdict_on(Situation(**FAULTS["differing in no way that has a name"])).limit
    assert told == "The photographs do not quite agree on one camera."


def test_a_method_that_forgives_wild_corners_is_judged_by_its_error_and_names_where_they_are():
    wild = Situation(**FAULTS["wild corners"])
    assert verdict_on(wild).grade == Grade.GOOD
    assert "in a.jpg and b.jpg" in verdict_on(wild).limit
    assert verdict_on(replace(wild, method="fccm")).grade == Grade.USABLE


def test_nothing_known_is_not_to_be_used():
    assert verdict_on(NOTHING_KNOWN).grade == Grade.NO
    assert "nothing says how far off it is" in str(verdict_on(NOTHING_KNOWN))


def test_two_cameras_are_told_by_name():
    told = str(verdict_on(Situation(**FAULTS["two cameras"])))
    assert "the photographs do not agree on one camera" in told.lower()
    assert "e.jpg, f.jpg, g.jpg and 1 more are of another than a.jpg, b.jpg, c.jpg and 1 more" in told
    assert "folder of its own" in told


def test_a_formula_is_named_before_photographs_that_are_merely_few():
    assert verdict_on(Situation(**{**FAULTS["lens"], "views": 6, "distinct": 6})).cause == "lens"


def test_a_photograph_that_alone_shows_a_place_is_no_fault_but_worth_another():
    verdict = verdict_on(Situation(**FAULTS["precious"]))
    assert (verdict.grade, verdict.cause, verdict.limit) == (Grade.GOOD, "", "")
    assert verdict.advice == "Nothing shows the frame at the top left as a.jpg does: take another like it."


@pytest.mark.parametrize(
    ("images", "told"),
    [("a", "a"), ("ab", "a and b"), ("abc", "a, b and c"), ("abcde", "a, b, c and 2 more")],
)
def test_images_are_listed(images, told):
    assert listed(list(images)) == told


def test_the_worst_grade_is_the_last():
    assert lower(Grade.NO, Grade.GOOD) == lower(Grade.GOOD, Grade.NO) == Grade.NO
    assert [row.grade for row in GRADES] == ORDER


def test_what_is_too_much_grows_with_the_image():
    assert coarse_px((640, 480)) < coarse_px((4000, 3000))
