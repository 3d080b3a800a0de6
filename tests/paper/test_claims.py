"""Verdicts and findings follow the numbers, whichever way these go."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.made_up import IMAGES, NOISE, POINTS, curve, curves, ended, outcome
from orthoscope.paper.claims import about_curves, about_eq7, about_steps, sentences
from orthoscope.paper.claims.claim import Claim, ClaimVerdict, main_headline, of_sentence
from orthoscope.paper.entries import FCCM5, MLDC, NMLDC, REPEATED
from orthoscope.paper.step_two import DEGREES, name_of_degree, name_of_images
from orthoscope.paper.times import Timing
from orthoscope.paper.trials import Outcome


@pytest.mark.parametrize(
    ("mldc", "verdict", "words"),
    [
        (
            [1.0, 1.0],
            ClaimVerdict.HOLDS,
            "at 2 of 2 noise levels; on average it is 1.00 against 2.00, 2.0 times less",
        ),
        (
            [1.0, 5.0],
            ClaimVerdict.PARTLY,
            "at 1 of 2 noise levels; on average it is 3.00 against 2.00, 1.5 times as much",
        ),
        (
            [4.0, 4.0],
            ClaimVerdict.FAILS,
            "at 0 of 2 noise levels; on average it is 4.00 against 2.00, 2.0 times as much",
        ),
    ],
)
def test_mldc_is_better_on_test_data_only_where_its_error_is_lower(mldc, verdict, words):
    claim = about_curves.better_on_test("Fig. 2", curves(FCCM=[2.0, 2.0], MLDC=mldc), NOISE)
    assert (claim.where, claim.verdict) == ("Fig. 2", verdict)
    assert words in claim.finding


def test_a_lead_within_the_standard_errors_is_none():
    claim = about_curves.better_on_test(
        "Fig. 6", curves(FCCM=[1.0, 1.0], MLDC=[0.99, 0.98]), NOISE
    )  # of 0.01 each: 0.014 together
    assert "at 1 of 2" in claim.finding
    assert (
        about_curves.greatest_error("x", curves(FCCM=[1.0], NMLDC=[1.01], MLDC=[0.5]), POINTS).verdict
        is ClaimVerdict.FAILS
    )


def test_levels_at_which_a_method_failed_are_not_compared_and_failures_are_named():
    of = {"FCCM": curve("FCCM", [2.0, 2.0]), MLDC: curve(MLDC, [np.nan, 1.0], failures=4)}
    claim = about_curves.better_on_test("Fig. 2", of, NOISE)
    assert claim.verdict is ClaimVerdict.HOLDS
    assert "1 of 1 noise levels" in claim.finding
    assert "MLDC, eq. (7) in 4 of 8" in claim.finding


def test_nothing_is_concluded_where_no_method_gave_a_camera():
    none = curves(FCCM=[np.nan, np.nan], NMLDC=[np.nan, np.nan], MLDC=[np.nan, np.nan])
    judges = (
        about_curves.better_on_test,
        about_curves.compensated,
        about_curves.same_on_test,
        about_curves.most_sensitive,
        about_curves.greatest_error,
        about_curves.better_trained,
        about_curves.exact_without_noise,
        about_curves.accurate_from_three,
        about_curves.fewer_than_three,
    )
    assert {judge("x", none, NOISE).verdict for judge in judges} == {ClaimVerdict.OPEN}


@pytest.mark.parametrize(
    ("training", "verdict"),
    [([1.0, 1.0], "holds"), ([1.0, 1.9], "holds in part"), ([1.9, 3.0], "does not hold")],
)
def test_fccm_is_compensated_where_its_error_on_test_views_as_noisy_is_above_its_training_error(
    training, verdict
):
    claim = about_curves.compensated("Fig. 2", {"FCCM": curve("FCCM", [2.0, 2.0], training)}, NOISE)
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("training", "verdict"),
    [([1.9, 2.2], "holds"), ([1.9, 3.0], "holds in part"), ([1.0, 4.0], "does not hold")],
)
def test_similar_is_within_a_quarter(training, verdict):
    claim = about_curves.same_on_test("Fig. 2", {MLDC: curve(MLDC, [2.0, 2.0], training)}, NOISE)
    assert claim.verdict == verdict


def test_the_most_sensitive_is_who_rises_most_not_who_is_highest():
    claim = about_curves.most_sensitive(
        "Fig. 2", curves(FCCM=[0.0, 0.1], NMLDC=[0.0, 0.4], MLDC=[2.0, 2.0]), NOISE
    )
    assert claim.verdict is ClaimVerdict.HOLDS
    assert "most for NMLDC, plain" in claim.finding
    assert "With 1 px of noise" in claim.finding
    assert "greatest for MLDC, eq. (7)" in claim.finding
    assert (
        about_curves.most_sensitive("x", curves(FCCM=[0, 1], NMLDC=[0, 0.4], MLDC=[0, 0]), NOISE).verdict
        is ClaimVerdict.FAILS
    )


def test_nmldc_gives_greater_errors_where_it_gives_the_greatest():
    assert (
        about_curves.greatest_error("x", curves(FCCM=[1, 1], NMLDC=[2, 2], MLDC=[1, 1]), POINTS).verdict
        is ClaimVerdict.HOLDS
    )
    assert (
        about_curves.greatest_error("x", curves(FCCM=[1, 1], NMLDC=[2, 0], MLDC=[1, 1]), POINTS).verdict
        is ClaimVerdict.PARTLY
    )
    assert (
        about_curves.greatest_error("x", curves(FCCM=[1, 1], NMLDC=[0, 0], MLDC=[1, 1]), POINTS).verdict
        is ClaimVerdict.FAILS
    )


def test_fccm_is_better_trained_where_its_training_error_is_least():
    assert (
        about_curves.better_trained("x", curves(FCCM=[1.0], NMLDC=[2.0], MLDC=[3.0]), POINTS).verdict
        is ClaimVerdict.HOLDS
    )
    assert (
        about_curves.better_trained("x", curves(FCCM=[2.5], NMLDC=[2.0], MLDC=[3.0]), POINTS).verdict
        is ClaimVerdict.FAILS
    )


def test_full_accuracy_without_noise_needs_all_three_methods():
    claim = about_curves.exact_without_noise("x", curves(FCCM=[0.1], NMLDC=[0.0], MLDC=[1.0]), POINTS)
    assert claim.verdict is ClaimVerdict.PARTLY
    assert "below 0.01 for NMLDC, plain" in claim.finding
    assert (
        about_curves.exact_without_noise("x", curves(FCCM=[0.0], NMLDC=[0.0], MLDC=[0.0]), POINTS).verdict
        is ClaimVerdict.HOLDS
    )


def test_few_images_are_compared_with_three_or_more():
    of = {MLDC: curve(MLDC, [9.0, 0.5, 0.6, 1.2], levels=[1, 2, 3, 15])}
    assert about_curves.fewer_than_three("x", of, IMAGES).verdict is ClaimVerdict.PARTLY
    assert (
        "9.00 with 1 image and 0.50 with 2 images; with three or more it is 1.20"
        in about_curves.fewer_than_three("x", of, IMAGES).finding
    )
    assert about_curves.accurate_from_three("x", of, IMAGES).verdict is ClaimVerdict.PARTLY
    assert "With 3 to 15 images" in about_curves.accurate_from_three("x", of, IMAGES).finding


def test_eq_7_is_perfect_where_every_search_ends_at_nothing():
    assert about_eq7.perfect("x", [ended(750.0), ended(760.0)]).verdict is ClaimVerdict.HOLDS
    assert about_eq7.perfect("x", [ended(750.0), ended(760.0, J=1.0)]).verdict is ClaimVerdict.PARTLY
    assert about_eq7.perfect("x", []).verdict is ClaimVerdict.OPEN


def test_eq_7_determines_the_camera_only_if_all_searches_end_at_one():
    claim = about_eq7.determined("x", [ended(750.0), ended(760.0)])
    assert claim.verdict is ClaimVerdict.FAILS
    assert "different cameras: fx 750.0 to 760.0, fy 750.0" in claim.finding
    assert "up to 10 px apart" in claim.finding
    assert (
        about_eq7.determined("x", [ended(750.0), ended(750.0)]).verdict is ClaimVerdict.PARTLY
    )  # one camera, but its NCE is 1.5
    assert about_eq7.determined("x", [ended(750.0, test_nce=0.1)] * 2).verdict is ClaimVerdict.HOLDS


def test_the_fair_chance_names_whoever_is_least():
    of = {"low": curves(FCCM=[0.1], NMLDC=[0.02], MLDC=[1.4]) | {FCCM5: curve(FCCM5, [0.03])}}
    assert "least for NMLDC, plain" in about_curves.fair_chance(of, level=0.0, noise_px=0.1)


def test_the_headline_counts_only_the_main_claim():
    fails, holds, partly = (
        Claim("x", sentences.BETTER, verdict, "")
        for verdict in (ClaimVerdict.FAILS, ClaimVerdict.HOLDS, ClaimVerdict.PARTLY)
    )
    other = Claim("x", sentences.WEIGHTS, ClaimVerdict.HOLDS, "")
    repeated = [
        Claim("x", sentences.BETTER, verdict, "", ours=True)
        for verdict in (ClaimVerdict.HOLDS, ClaimVerdict.HOLDS)
    ]
    assert "does not hold (in 0 of 2 figures)." in main_headline([fails, fails, other])
    assert "holds in part (in 1 of 2 figures)" in main_headline([fails, holds, other])
    assert "holds (in 2 of 2 figures)" in main_headline([holds, holds])
    assert "holds in part (in 0 of 2 figures, in part in 1)" in main_headline([fails, partly])
    said = main_headline([fails, *repeated])
    assert (
        "does not hold (in 0 of 1 figures); with its two steps repeated it holds (in 2 of 2 figures)" in said
    )
    assert "cannot be told" in main_headline([other])


def test_a_sentence_counts_once_and_only_as_the_paper_prints_it():
    fails, holds, opened, ours = (
        Claim("x", sentences.BETTER, verdict, "", ours)
        for verdict, ours in (
            (ClaimVerdict.FAILS, False),
            (ClaimVerdict.HOLDS, False),
            (ClaimVerdict.OPEN, False),
            (ClaimVerdict.HOLDS, True),
        )
    )
    assert of_sentence([fails, fails, opened, ours]) is ClaimVerdict.FAILS
    assert of_sentence([fails, holds]) is ClaimVerdict.PARTLY
    assert of_sentence([opened, ours]) is ClaimVerdict.OPEN


def test_the_repeated_reading_is_judged_beside_the_printed_one_and_is_ours():
    of = curves(FCCM=[2.0], MLDC=[3.0]) | {REPEATED: curve(REPEATED, [0.1])}
    printed = about_curves.better_on_test("Fig. 2", of, NOISE)
    repeated = about_curves.better_repeated("Fig. 2", of, NOISE)
    assert (printed.verdict, printed.ours) == (ClaimVerdict.FAILS, False)
    assert (repeated.verdict, repeated.ours) == (ClaimVerdict.HOLDS, True)


def test_weights_matter_where_they_move_the_camera():
    plain, moved = ended(750.0), ended(763.0)._replace(name="identity 1, weights 1 1 10000")
    claim = about_eq7.weights_do_not_matter("x", [plain, moved])
    assert claim.verdict is ClaimVerdict.FAILS
    assert "1 1 10000: 13 px" in claim.finding
    still = moved._replace(judgement=plain.judgement)
    assert about_eq7.weights_do_not_matter("x", [plain, still]).verdict is ClaimVerdict.HOLDS
    assert about_eq7.weights_do_not_matter("x", [plain]).verdict is ClaimVerdict.OPEN


def steps(entry: str, test_nce: float, rounds: float, bent_px: float = 0.1) -> Outcome:
    judgement = outcome(entry, 0.1, 0, test_nce).judgement._replace(steps=rounds, bent_px=bent_px)
    return outcome(entry, 0.1, 0, test_nce)._replace(judgement=judgement)


def test_the_degree_does_not_matter_where_rounds_and_errors_are_those_of_the_fifth():
    alike = [steps(name_of_degree(degree), 0.02, 5) for degree in DEGREES]
    assert about_steps.degree_does_not_matter("x", alike).verdict is ClaimVerdict.HOLDS
    slow = [steps(name_of_degree(2), 0.02, 9), *alike[1:]]
    claim = about_steps.degree_does_not_matter("x", slow)
    assert claim.verdict is ClaimVerdict.PARTLY
    assert "for 2 of 3 others" in claim.finding
    assert about_steps.degree_does_not_matter("x", []).verdict is ClaimVerdict.OPEN


def test_one_image_is_enough_where_its_lens_is_better_than_rounding():
    all_images = steps(name_of_degree(5), 0.02, 5)
    for nce, verdict in ((0.3, ClaimVerdict.HOLDS), (3.0, ClaimVerdict.FAILS)):
        of = [all_images, steps(name_of_images(1), nce, 5)]
        assert about_steps.one_image_is_enough("x", of).verdict is verdict


def test_time_grows_where_each_number_of_images_takes_longer_than_the_last():
    told = [Timing(count, MLDC, 10 * count, seconds, 9) for count, seconds in ((3, 0.2), (15, 2.5))]
    claim = about_steps.time_grows("x", told)
    assert claim.verdict is ClaimVerdict.HOLDS
    assert "0.2 s with 3 images (30 unknowns) and 2.5 s with 15" in claim.finding
    assert about_steps.time_grows("x", told[::-1]).verdict is ClaimVerdict.HOLDS  # in any order
    assert about_steps.time_grows("x", told[:1]).verdict is ClaimVerdict.OPEN


def test_fig_7_is_judged_by_how_far_rows_and_columns_are_off_straight():
    of = [
        steps(MLDC, 1.0, 5, 0.3),
        steps(NMLDC, 1.0, 5, 0.2),
        steps("FCCM", 1.0, 5, 0.4),
        steps(REPEATED, 1.0, 5),
    ]
    claim = about_steps.better_straightened("Fig. 7", of)
    assert claim.verdict is ClaimVerdict.PARTLY
    assert "0.300 for MLDC, eq. (7), 0.200 for NMLDC, plain" in claim.finding
    ours = about_steps.better_straightened("Fig. 7", of, mldc=REPEATED)
    assert (ours.verdict, ours.ours) == (ClaimVerdict.HOLDS, True)
