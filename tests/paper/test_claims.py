"""Verdicts and findings follow the numbers, whichever way these go."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.made_up import IMAGES, NOISE, POINTS, curve, curves, ended
from orthoscope.paper import claims_about_curves, claims_about_eq7
from orthoscope.paper.claims import MAIN, Claim, Verdict, headline, of_sentence
from orthoscope.paper.entries import FCCM5, MLDC, REPEATED


@pytest.mark.parametrize(
    ("mldc", "verdict", "words"),
    [
        (
            [1.0, 1.0],
            Verdict.HOLDS,
            "at 2 of 2 noise levels; on average it is 1.00 against 2.00, 2.0 times less",
        ),
        (
            [1.0, 5.0],
            Verdict.PARTLY,
            "at 1 of 2 noise levels; on average it is 3.00 against 2.00, 1.5 times as much",
        ),
        (
            [4.0, 4.0],
            Verdict.FAILS,
            "at 0 of 2 noise levels; on average it is 4.00 against 2.00, 2.0 times as much",
        ),
    ],
)
def test_mldc_is_better_on_test_data_only_where_its_error_is_lower(mldc, verdict, words):
    claim = claims_about_curves.better_on_test("Fig. 2", curves(FCCM=[2.0, 2.0], MLDC=mldc), NOISE)
    assert (claim.where, claim.verdict) == ("Fig. 2", verdict)
    assert words in claim.finding


def test_a_lead_within_the_standard_errors_is_none():
    claim = claims_about_curves.better_on_test(
        "Fig. 6", curves(FCCM=[1.0, 1.0], MLDC=[0.99, 0.98]), NOISE
    )  # of 0.01 each: 0.014 together
    assert "at 1 of 2" in claim.finding
    assert (
        claims_about_curves.greatest_error("x", curves(FCCM=[1.0], NMLDC=[1.01], MLDC=[0.5]), POINTS).verdict
        is Verdict.FAILS
    )


def test_levels_at_which_a_method_failed_are_not_compared_and_failures_are_named():
    of = {"FCCM": curve("FCCM", [2.0, 2.0]), MLDC: curve(MLDC, [np.nan, 1.0], failures=4)}
    claim = claims_about_curves.better_on_test("Fig. 2", of, NOISE)
    assert claim.verdict is Verdict.HOLDS
    assert "1 of 1 noise levels" in claim.finding
    assert "MLDC, eq. (7) in 4 of 8" in claim.finding


def test_nothing_is_concluded_where_no_method_gave_a_camera():
    none = curves(FCCM=[np.nan, np.nan], NMLDC=[np.nan, np.nan], MLDC=[np.nan, np.nan])
    judges = (
        claims_about_curves.better_on_test,
        claims_about_curves.compensated,
        claims_about_curves.same_on_test,
        claims_about_curves.most_sensitive,
        claims_about_curves.greatest_error,
        claims_about_curves.better_trained,
        claims_about_curves.exact_without_noise,
        claims_about_curves.accurate_from_three,
        claims_about_curves.fewer_than_three,
    )
    assert {judge("x", none, NOISE).verdict for judge in judges} == {Verdict.OPEN}


@pytest.mark.parametrize(
    ("training", "verdict"),
    [([1.0, 1.0], "holds"), ([1.0, 1.9], "holds in part"), ([1.9, 3.0], "does not hold")],
)
def test_fccm_is_compensated_where_its_error_on_test_views_as_noisy_is_above_its_training_error(
    training, verdict
):
    claim = claims_about_curves.compensated("Fig. 2", {"FCCM": curve("FCCM", [2.0, 2.0], training)}, NOISE)
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("training", "verdict"),
    [([1.9, 2.2], "holds"), ([1.9, 3.0], "holds in part"), ([1.0, 4.0], "does not hold")],
)
def test_similar_is_within_a_quarter(training, verdict):
    claim = claims_about_curves.same_on_test("Fig. 2", {MLDC: curve(MLDC, [2.0, 2.0], training)}, NOISE)
    assert claim.verdict == verdict


def test_the_most_sensitive_is_who_rises_most_not_who_is_highest():
    claim = claims_about_curves.most_sensitive(
        "Fig. 2", curves(FCCM=[0.0, 0.1], NMLDC=[0.0, 0.4], MLDC=[2.0, 2.0]), NOISE
    )
    assert claim.verdict is Verdict.HOLDS
    assert "most for NMLDC, plain" in claim.finding
    assert "With 1 px of noise" in claim.finding
    assert "greatest for MLDC, eq. (7)" in claim.finding
    assert (
        claims_about_curves.most_sensitive(
            "x", curves(FCCM=[0, 1], NMLDC=[0, 0.4], MLDC=[0, 0]), NOISE
        ).verdict
        is Verdict.FAILS
    )


def test_nmldc_gives_greater_errors_where_it_gives_the_greatest():
    assert (
        claims_about_curves.greatest_error(
            "x", curves(FCCM=[1, 1], NMLDC=[2, 2], MLDC=[1, 1]), POINTS
        ).verdict
        is Verdict.HOLDS
    )
    assert (
        claims_about_curves.greatest_error(
            "x", curves(FCCM=[1, 1], NMLDC=[2, 0], MLDC=[1, 1]), POINTS
        ).verdict
        is Verdict.PARTLY
    )
    assert (
        claims_about_curves.greatest_error(
            "x", curves(FCCM=[1, 1], NMLDC=[0, 0], MLDC=[1, 1]), POINTS
        ).verdict
        is Verdict.FAILS
    )


def test_fccm_is_better_trained_where_its_training_error_is_least():
    assert (
        claims_about_curves.better_trained("x", curves(FCCM=[1.0], NMLDC=[2.0], MLDC=[3.0]), POINTS).verdict
        is Verdict.HOLDS
    )
    assert (
        claims_about_curves.better_trained("x", curves(FCCM=[2.5], NMLDC=[2.0], MLDC=[3.0]), POINTS).verdict
        is Verdict.FAILS
    )


def test_full_accuracy_without_noise_needs_all_three_methods():
    claim = claims_about_curves.exact_without_noise("x", curves(FCCM=[0.1], NMLDC=[0.0], MLDC=[1.0]), POINTS)
    assert claim.verdict is Verdict.PARTLY
    assert "below 0.01 for NMLDC, plain" in claim.finding
    assert (
        claims_about_curves.exact_without_noise(
            "x", curves(FCCM=[0.0], NMLDC=[0.0], MLDC=[0.0]), POINTS
        ).verdict
        is Verdict.HOLDS
    )


def test_few_images_are_compared_with_three_or_more():
    of = {MLDC: curve(MLDC, [9.0, 0.5, 0.6, 1.2], levels=[1, 2, 3, 15])}
    assert claims_about_curves.fewer_than_three("x", of, IMAGES).verdict is Verdict.PARTLY
    assert (
        "9.00 with 1 image and 0.50 with 2 images; with three or more it is 1.20"
        in claims_about_curves.fewer_than_three("x", of, IMAGES).finding
    )
    assert claims_about_curves.accurate_from_three("x", of, IMAGES).verdict is Verdict.PARTLY
    assert "With 3 to 15 images" in claims_about_curves.accurate_from_three("x", of, IMAGES).finding


def test_eq_7_is_perfect_where_every_search_ends_at_nothing():
    assert claims_about_eq7.perfect("x", [ended(750.0), ended(760.0)]).verdict is Verdict.HOLDS
    assert claims_about_eq7.perfect("x", [ended(750.0), ended(760.0, J=1.0)]).verdict is Verdict.PARTLY
    assert claims_about_eq7.perfect("x", []).verdict is Verdict.OPEN


def test_eq_7_determines_the_camera_only_if_all_searches_end_at_one():
    claim = claims_about_eq7.determined("x", [ended(750.0), ended(760.0)])
    assert claim.verdict is Verdict.FAILS
    assert "different cameras: fx 750.0 to 760.0, fy 750.0" in claim.finding
    assert "up to 10 px apart" in claim.finding
    assert (
        claims_about_eq7.determined("x", [ended(750.0), ended(750.0)]).verdict is Verdict.PARTLY
    )  # one camera, but its NCE is 1.5
    assert claims_about_eq7.determined("x", [ended(750.0, test_nce=0.1)] * 2).verdict is Verdict.HOLDS


def test_the_fair_chance_names_whoever_is_least():
    of = {"low": curves(FCCM=[0.1], NMLDC=[0.02], MLDC=[1.4]) | {FCCM5: curve(FCCM5, [0.03])}}
    assert "least for NMLDC, plain" in claims_about_curves.fair_chance(of, level=0.0, noise_px=0.1)


def test_the_headline_counts_only_the_main_claim():
    fails, holds, partly = (
        Claim("x", MAIN, verdict, "") for verdict in (Verdict.FAILS, Verdict.HOLDS, Verdict.PARTLY)
    )
    other = Claim("x", "something else", Verdict.HOLDS, "")
    repeated = [Claim("x", MAIN, verdict, "", ours=True) for verdict in (Verdict.HOLDS, Verdict.HOLDS)]
    assert "does not hold (in 0 of 2 figures)." in headline([fails, fails, other])
    assert "holds in part (in 1 of 2 figures)" in headline([fails, holds, other])
    assert "holds (in 2 of 2 figures)" in headline([holds, holds])
    assert "holds in part (in 0 of 2 figures, in part in 1)" in headline([fails, partly])
    said = headline([fails, *repeated])
    assert (
        "does not hold (in 0 of 1 figures); with its two steps repeated it holds (in 2 of 2 figures)" in said
    )
    assert "cannot be told" in headline([other])


def test_a_sentence_counts_once_and_only_as_the_paper_prints_it():
    fails, holds, opened, ours = (
        Claim("x", MAIN, verdict, "", ours)
        for verdict, ours in (
            (Verdict.FAILS, False),
            (Verdict.HOLDS, False),
            (Verdict.OPEN, False),
            (Verdict.HOLDS, True),
        )
    )
    assert of_sentence([fails, fails, opened, ours]) is Verdict.FAILS
    assert of_sentence([fails, holds]) is Verdict.PARTLY
    assert of_sentence([opened, ours]) is Verdict.OPEN


def test_the_repeated_reading_is_judged_beside_the_printed_one_and_is_ours():
    of = curves(FCCM=[2.0], MLDC=[3.0]) | {REPEATED: curve(REPEATED, [0.1])}
    printed = claims_about_curves.better_on_test("Fig. 2", of, NOISE)
    repeated = claims_about_curves.better_repeated("Fig. 2", of, NOISE)
    assert (printed.verdict, printed.ours) == (Verdict.FAILS, False)
    assert (repeated.verdict, repeated.ours) == (Verdict.HOLDS, True)


def test_weights_matter_where_they_move_the_camera():
    plain, moved = ended(750.0), ended(763.0)._replace(name="identity 1, weights 1 1 10000")
    claim = claims_about_eq7.weights_do_not_matter("x", [plain, moved])
    assert claim.verdict is Verdict.FAILS
    assert "1 1 10000: 13 px" in claim.finding
    still = moved._replace(judgement=plain.judgement)
    assert claims_about_eq7.weights_do_not_matter("x", [plain, still]).verdict is Verdict.HOLDS
    assert claims_about_eq7.weights_do_not_matter("x", [plain]).verdict is Verdict.OPEN
