"""Methods side by side: the same views for all, differences with their own error, and words that follow from
the numbers.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.boards import BOARD, NARROW, bent, perfect, photographs_of
from helpers.real_sets import classic
from orthoscope.evaluation.comparison.compare import Comparison, Standing, compare, paired_difference
from orthoscope.evaluation.comparison.conclusions import as_good_as_best, conclusions
from orthoscope.evaluation.comparison.entry import USUAL, Entry, camera_entry, parse_entry
from orthoscope.evaluation.evaluate import evaluate
from orthoscope.fitting.unseen.held_out import held_out, rms_and_error
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.geometry.pose import Pose
from orthoscope.methods import METHODS
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.methods.fccm import fccm
from orthoscope.simulation.scene import Scene, simulate_detections
from orthoscope.targets.detections import Detections

TEN = perfect(NARROW, 10, seed=1)[1]
ENTRIES = ("fccm:brown:k1", "fccm:brown", "fccm:division")


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare(TEN, ENTRIES, clock=count(step=0.5).__next__)


@pytest.mark.parametrize(
    ("text", "method", "settings"),
    [
        ("decoupled", "decoupled", {}),
        ("fccm:brown", "fccm", {"lens": "brown"}),
        (" fccm:brown:k1,k2 ", "fccm", {"lens": "brown:k1,k2"}),
        ("decoupled:shape=flat", "decoupled", {"shape": "flat"}),
        (
            "decoupled:brown:k1:shape=free:base=brown:skew=true",
            "decoupled",
            {"lens": "brown:k1", "shape": "free", "base": "brown", "skew": True},
        ),
        ("decoupled:formulas=brown,rational", "decoupled", {"formulas": ("brown", "rational")}),
        ("fccm:loss=huber:loss_scale=2", "fccm", {"loss": "huber", "loss_scale": 2.0}),
        ("mldc:weights=1,0.5,2", "mldc", {"weights": (1.0, 0.5, 2.0)}),
    ],
)
def test_an_entry_is_a_method_its_lens_and_its_settings(text, method, settings):
    entry = parse_entry(text)
    assert entry == Entry(text.strip(), method, settings)
    assert [type(value) for value in entry.settings.values()] == [type(value) for value in settings.values()]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("magic", ("'magic'", "decoupled, fccm")),
        ("", ("''", "fccm:brown")),
        ("fccm:fisheye", ("'fisheye'", "kannala_brandt")),
        ("fccm:brown:k9", ("'k9'", "k1, k2")),
        ("fccm:shape=flat", ("'shape'", "loss_scale")),
        ("fccm:skew=perhaps", ("'perhaps'", "skew=false")),
        ("fccm:max_steps=many", ("'many'", "a whole number", "max_steps=200")),
        ("fccm:loss_scale=wide", ("'wide'", "a number")),
        ("fccm:progress=print", ("'progress'",)),
    ],
)
def test_an_entry_that_is_none_says_what_was_expected(text, words):
    with pytest.raises(InputError) as told:
        parse_entry(text)
    assert all(word in str(told.value) for word in words), told.value


def test_the_usual_entries_have_every_method_as_it_comes():
    assert set(METHODS) <= set(USUAL)
    assert [parse_entry(name).name for name in USUAL] == list(USUAL)


@pytest.mark.slow
def test_the_best_is_first_and_loses_nothing(comparison):
    errors = [standing.held_out_px for standing in comparison.standings]
    assert errors == sorted(errors)
    best = comparison.standings[0]
    assert best.entry.name == "fccm:brown"  # the lens that made these views
    assert (best.loses_px, best.loses_error_px) == (0.0, 0.0)
    assert all(standing.loses_px > 0 for standing in comparison.standings[1:])


@pytest.mark.slow
def test_each_error_is_that_of_the_judge_for_the_same_folds(comparison):
    best = comparison.standings[0]
    unseen = held_out(TEN, partial(fccm, lens="brown"))
    assert (best.held_out_px, best.error_px) == (unseen.rms_px, unseen.standard_error_px)
    assert best.rms_px == fccm(TEN, lens="brown").rms_px
    assert best.rms_px < best.held_out_px
    assert (best.parameters, best.lens, best.shape) == (9.0, "brown", "flat")
    assert_allclose(best.nce, evaluate(fccm(TEN, lens="brown"), folds=5).nce)


def test_seconds_are_those_of_one_calibration(comparison):
    assert [standing.seconds for standing in comparison.standings] == [0.5] * 3


def test_a_difference_is_known_better_than_each_error(comparison):
    for standing in comparison.standings[1:]:
        assert_allclose(standing.loses_px, standing.held_out_px - comparison.standings[0].held_out_px)
        assert 0 < standing.loses_error_px < standing.error_px + comparison.standings[0].error_px


def test_threads_give_the_same_comparison(comparison):
    with ThreadPoolExecutor(2) as executor:
        shared = compare(TEN, ENTRIES, executor=executor)
    assert [numbers_of(one) for one in shared.standings] == [numbers_of(one) for one in comparison.standings]


def numbers_of(standing: Standing) -> tuple[object, ...]:
    """All that has to be the same whenever it is computed: not the seconds."""
    return (
        standing.entry,
        *standing.squares,
        standing.held_out_px,
        standing.loses_px,
        standing.loses_error_px,
        standing.nce,
        standing.rms_px,
    )


def test_progress_counts_every_calibration_and_names_its_entry():
    told = []
    compare(
        TEN,
        ["fccm:brown:k1", "fccm:brown:k1", "fccm:division"],
        folds=3,
        progress=lambda *said: told.append(said),
    )
    assert told[0] == (1, 8, "fccm:brown:k1")  # the repeated one counts once
    assert told[-1] == (8, 8, "fccm:division")
    assert [done for done, *_ in told] == sorted(done for done, *_ in told)


def test_each_fold_is_calibrated_with_the_settings_of_the_user_so_that_a_choice_is_judged_too(monkeypatch):
    asked = []

    def chooser(detections, *, lens="auto"):
        asked.append((len(detections.views), lens))
        return fccm(detections, lens="brown:k1")

    monkeypatch.setitem(METHODS, "chooser", chooser)
    (standing,) = compare(TEN, ["chooser"]).standings
    assert asked == [(10, "auto")] + 5 * [(8, "auto")]
    assert standing.lens == "brown:k1"


def test_one_that_cannot_has_a_place_at_the_end_and_a_reason():
    pathless = replace(TEN, target=replace(TEN.target, lines=()))  # nothing for nmldc to straighten
    found = compare(pathless, ["nmldc", "fccm:brown:k1"])
    assert [standing.entry.name for standing in found.standings] == ["fccm:brown:k1", "nmldc"]
    unable = found.standings[1]
    assert "straightness cannot be judged" in unable.failure
    assert unable.camera is None
    assert np.isnan(
        [
            unable.held_out_px,
            unable.loses_px,
            unable.loses_error_px,
            unable.nce,
            unable.rms_px,
            unable.seconds,
        ]
    ).all()
    assert [standing.entry.name for standing in found.judged] == ["fccm:brown:k1"]


def test_one_that_cannot_without_some_views_is_not_compared_with_those_that_can():
    tilted = perfect(NARROW, 1, seed=0, tilt=(0.5, 0.7), fill=(0.6, 0.9))[1].views[0]
    facing = tuple(
        Pose(np.eye(3), np.array([0.02 * i - 0.16, 0.02 * i - 0.1, 0.4 + 0.02 * i])) for i in range(7)
    )
    flat = simulate_detections(Scene(NARROW, BOARD, facing), noise_px=0.1, rng=np.random.default_rng(0)).views
    detections = Detections(BOARD, NARROW.image_size, (replace(tilted, image="tilted"), *flat))
    found = compare(detections, ["fccm:brown:k1"], folds=8)  # without the tilted view the others are parallel
    assert found.judged == ()
    assert found.standings[0].camera is not None
    assert found.standings[0].failure.startswith("1 of 8 photographs")
    assert conclusions(found) == ("None of them could be judged on these photographs.",)


def test_a_misread_corner_is_left_out_for_all():
    view = TEN.views[2]
    misread = replace(view, pixels=view.pixels + np.where(np.arange(len(view.ids)) == 7, 30.0, 0.0)[:, None])
    spoilt = replace(TEN, views=(*TEN.views[:2], misread, *TEN.views[3:]))
    found = compare(spoilt, ["fccm:brown:k1", "fccm:brown"])
    assert [(outlier.image, outlier.id) for outlier in found.detections.outliers] == [
        (view.image, view.ids[7])
    ]
    assert found.detections.corners == TEN.corners - 1
    assert all(standing.held_out_px < 1.0 for standing in found.standings)


def test_a_wrong_lens_for_a_method_is_no_standing_but_an_error():
    with pytest.raises(InputError, match="'free'"):
        compare(TEN, ["fccm:free"])


@pytest.mark.parametrize("views", [1, 3])
def test_too_few_views_to_hold_any_out_are_an_error(views):
    with pytest.raises(CalibrationError, match="expected 4"):
        compare(TEN.only(range(views)), ["fccm:brown:k1"])


def test_nobody_to_compare_is_an_error():
    with pytest.raises(InputError, match="one at least"):
        compare(TEN, [])


def drawn(views: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums of squares of two that err alike from view to view, and the corners of each view."""
    rng = np.random.default_rng(seed)
    corners = rng.integers(20, 60, views).astype(float)
    common = rng.gamma(8.0, 0.05, views)
    return corners * (common + rng.gamma(4.0, 0.02, views)), corners * common, corners


@pytest.mark.parametrize("seed", range(3))
def test_the_error_of_a_difference_is_that_of_a_bootstrap_over_views(seed):
    one, other, corners = drawn(40, seed)
    picks = np.random.default_rng(seed).integers(0, 40, (4000, 40))
    told = [np.sqrt(sums[picks].sum(1) / corners[picks].sum(1)) for sums in (one, other)]
    # a formula of first order: roots of 40 skewed draws bend by a few percent; 4000 draws tell a deviation to
    # 1 %
    assert_allclose(paired_difference(one, other, corners)[1], (told[0] - told[1]).std(), rtol=0.1)


def test_a_difference_is_that_of_the_errors_and_turns_its_sign():
    one, other, corners = drawn(12, 0)
    loss, error = paired_difference(one, other, corners)
    assert_allclose(loss, rms_and_error(one, corners)[0] - rms_and_error(other, corners)[0])
    assert_allclose(paired_difference(other, one, corners), (-loss, error))
    assert paired_difference(one, one, corners) == (0.0, 0.0)


def test_against_one_without_error_a_difference_is_the_error_itself():
    one, _, corners = drawn(12, 1)
    assert_allclose(paired_difference(one, np.zeros(12), corners), rms_and_error(one, corners))


def standing(
    name: str, held_out_px: float, *, loses: tuple[float, float] = (0.0, 0.0), rms_px: float = 0.1
) -> Standing:
    """A standing made by hand."""
    numbers: dict[str, Any] = {
        "held_out_px": held_out_px,
        "error_px": 0.01,
        "loses_px": loses[0],
        "loses_error_px": loses[1],
        "rms_px": rms_px,
    }
    return Standing(Entry(name, "fccm", {}), np.ones(10), **numbers)


def told_of(*standings: Standing) -> tuple[str, ...]:
    return conclusions(Comparison(TEN, 5, standings))


def test_the_next_one_is_told_with_what_it_loses():
    assert told_of(standing("decoupled", 0.1234), standing("fccm:brown", 0.19, loses=(0.067, 0.006))) == (
        "decoupled predicts these photographs best: 0.123 ± 0.010 px on those that were not used.",
        "The next, fccm:brown, loses 0.0670 ± 0.0060 px.",
    )


def test_what_chance_may_account_for_is_as_good():
    standings = (
        standing("a", 0.12),
        standing("b", 0.12),
        standing("c", 0.123, loses=(0.003, 0.002)),
        standing("d", 0.2, loses=(0.08, 0.01)),
    )
    assert [each.entry.name for each in as_good_as_best(Comparison(TEN, 5, standings))] == ["b", "c"]
    assert told_of(*standings)[1:] == (
        "As good, for all that chance allows to say: b (comes to the same), c (loses 0.0030 ± 0.0020 px).",
        "The next, d, loses 0.080 ± 0.010 px.",
    )


def test_one_that_fits_best_what_was_used_and_loses_elsewhere_has_learnt_it():
    told = told_of(standing("a", 0.12), standing("b", 0.15, loses=(0.03, 0.01), rms_px=0.08))
    assert (
        told[-1]
        == "b has the least error on photographs that were used, 0.080 px, and on others 0.150 px: it learns"
        " photographs, not the camera."
    )


def test_one_alone_is_not_called_the_best():
    assert told_of(standing("a", 0.12)) == (
        "a predicts these photographs with 0.120 ± 0.010 px on those that were not used.",
    )


@pytest.mark.slow
def test_a_bent_board_is_foreseen_best_by_the_method_that_finds_its_shape():
    found = compare(photographs_of(bent(3.0), 12, seed=0), ["fccm:brown", "decoupled:first_lens=formula"])
    assert [standing.entry.name for standing in found.standings] == [
        "decoupled:first_lens=formula",
        "fccm:brown",
    ]
    assert found.standings[1].loses_px > 2.0 * found.standings[1].loses_error_px
    assert found.standings[0].shape != "flat"


@pytest.mark.slow
@pytest.mark.datasets
def test_on_real_photographs_the_shape_of_the_board_is_worth_more_than_any_formula(datasets: Path):
    found = compare(
        classic(datasets, "opencv-left"),
        ["decoupled:first_lens=formula:shape=free", "fccm:brown", "fccm:rational"],
    )
    best, *others = found.standings
    assert best.entry.method == "decoupled"
    assert all(standing.loses_px > 5.0 * standing.loses_error_px for standing in others)


def test_printed_it_is_a_line_for_each_entry(comparison):
    lines = repr(comparison).splitlines()
    assert len(lines) == 1 + len(comparison.standings)
    for line, standing in zip(lines[1:], comparison.standings, strict=True):
        assert standing.entry.name in line
        assert len(line) < 200


def test_a_calibration_is_judged_by_others_photographs_with_the_shape_that_it_learnt():
    bowed, others = photographs_of(bent(2.0), 8, 1), photographs_of(bent(2.0), 6, 2)
    made = decoupled(bowed, shape="free", first_lens="formula", base="brown")
    own, alone = (camera_entry("made", made.camera, calibration=given) for given in (made, None))
    assert (
        "made from 8 of these 8 photographs" in compare(bowed, [own, "fccm"], folds=3).standings[-1].failure
    )
    with_shape, without = (compare(others, [entry, "fccm"], folds=3) for entry in (own, alone))
    found = [next(s for s in each.standings if s.entry.name == "made") for each in (with_shape, without)]
    assert found[0].target_shape == made.target_shape
    assert found[0].held_out_px < 0.7 * found[1].held_out_px
