"""Claims about curves: who has which error, and how it changes with a level.

Where the paper's word is a matter of degree the finding carries the measure: *similar* is within 25 %,
*accurate* an NCE below 1 (less than rounding to whole pixels), *100 % accuracy* one below 0.01 (0.004 px).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Bool, ndarray
from orthoscope.paper.claims import sentences
from orthoscope.paper.claims.claim import Claim, ClaimVerdict, share
from orthoscope.paper.claims.wording import each_of, joined_words, short_number, span, times
from orthoscope.paper.curves import Curve, Curves
from orthoscope.paper.entries import FCCM, FCCM5, MLDC, NMLDC, REPEATED

__all__ = [
    "Axis",
    "Judge",
    "accurate_from_three",
    "better_on_test",
    "better_repeated",
    "better_trained",
    "compensated",
    "exact_without_noise",
    "fair_chance",
    "fewer_than_three",
    "greatest_error",
    "most_sensitive",
    "same_on_test",
]

# A test error is similar that differs from the training error by no more than this share of it.
SIMILAR_SHARE = 0.25
# Rounding to whole pixels has this NCE.
ACCURATE_NCE = 1.0
# A calibration is as good as exact below this NCE.
EXACT_NCE = 0.01


class Axis(NamedTuple):
    """What the levels of curves are: their plural, one of them in words (`{:g} px of noise`), as a column of
    a file, under a figure.
    """

    levels: str
    one: str
    column: str
    label: str

    def at(self, level: float) -> str:
        """A level in words; of one thing, the singular."""
        words = self.one.format(level)
        return words.removesuffix("s") if level == 1 else words


Judge = Callable[[str, Curves, Axis], Claim]


def better_on_test(where: str, curves: Curves, axis: Axis, *, mldc: str = MLDC) -> Claim:
    """MLDC is more accurate than FCCM on data that was not used; mldc: which reading of it."""
    ours = mldc != MLDC
    if mldc not in curves or FCCM not in curves:
        return Claim(where, sentences.BETTER, ClaimVerdict.OPEN, f"{mldc} was not tried beside FCCM.", ours)
    both, (one, fccm) = _both(curves, mldc, FCCM)
    wins, of = int(_clearly_above(fccm, one)[both].sum()), int(both.sum())
    if not of:
        return Claim(
            where,
            sentences.BETTER,
            ClaimVerdict.OPEN,
            f"At none of the {axis.levels} did both methods give a camera.",
            ours,
        )
    mine, theirs = one.test_nce[both].mean(), fccm.test_nce[both].mean()
    finding = (
        f"{mldc}: test NCE below FCCM's, by more than their standard errors, at {wins} of {of}"
        f" {axis.levels}; on average it is {short_number(mine)} against"
        f" {short_number(theirs)}{times(mine, theirs)}."
    )
    return Claim(
        where, sentences.BETTER, share(wins, of), finding + _true_poses(one, fccm) + _failed(one, fccm), ours
    )


def better_repeated(where: str, curves: Curves, axis: Axis) -> Claim:
    """The same of MLDC's two steps repeated."""
    return better_on_test(where, curves, axis, mldc=REPEATED)


def compensated(where: str, curves: Curves, axis: Axis) -> Claim:
    """FCCM's errors are compensated on training data only; training and test views are both noisy."""
    paper = sentences.NO_LONGER_SATISFIED
    told, (fccm,) = _both(curves, FCCM)
    ratio = fccm.noisy_test_nce / np.where(fccm.training_nce > 0, fccm.training_nce, np.nan)
    told = told & np.isfinite(ratio)
    above, of = int((ratio > 1.0 + SIMILAR_SHARE)[told].sum()), int(told.sum())
    if not of:
        return Claim(where, paper, ClaimVerdict.OPEN, "FCCM gave no camera.")
    worst = int(np.nanargmax(np.where(told, ratio, np.nan)))
    finding = (
        "On test views as noisy as the training views FCCM's NCE is more than"
        f" {100 * SIMILAR_SHARE:.0f} % above its training NCE at {above} of {of}"
        f" {axis.levels}; where it compares worst, with {axis.at(fccm.levels[worst])}, it is"
        f" {short_number(fccm.noisy_test_nce[worst])} against {short_number(fccm.training_nce[worst])}."
    )
    return Claim(where, paper, share(above, of), finding + _true_poses(fccm) + _failed(fccm))


def same_on_test(where: str, curves: Curves, axis: Axis) -> Claim:
    """MLDC's error does not change with the data; training and test views are both noisy."""
    paper = sentences.ALIKE_ON_TEST
    told, (mldc,) = _both(curves, MLDC)
    told = told & np.isfinite(mldc.noisy_test_nce)
    if not told.any():
        return Claim(where, paper, ClaimVerdict.OPEN, "MLDC gave no camera.")
    ratio = mldc.noisy_test_nce[told] / mldc.training_nce[told]
    similar, of = int((np.abs(ratio - 1.0) <= SIMILAR_SHARE).sum()), len(ratio)
    finding = (
        "On test views as noisy as the training views MLDC's NCE is within"
        f" {100 * SIMILAR_SHARE:.0f} % of its training NCE at {similar} of {of} {axis.levels}"
        f" ({span(ratio)} times it); it is {span(mldc.noisy_test_nce[told])}."
    )
    return Claim(where, paper, share(similar, of), finding + _true_poses(mldc) + _failed(mldc))


def most_sensitive(where: str, curves: Curves, axis: Axis) -> Claim:
    """NMLDC suffers most from noise; levels are sigma, pixels."""
    paper = sentences.MORE_SENSITIVE
    told, three = _both(curves, NMLDC, FCCM, MLDC)
    if told.sum() < 2:
        return Claim(
            where,
            paper,
            ClaimVerdict.OPEN,
            "Fewer than two noise levels at which all three methods gave a camera.",
        )
    levels = three[0].levels[told]
    rises = {curve.name: float(np.polyfit(levels, curve.test_nce[told], 1)[0]) for curve in three}
    last = {curve.name: float(curve.test_nce[told][-1]) for curve in three}
    most = max(rises, key=rises.__getitem__)
    worst = max(last, key=last.__getitem__)
    finding = (
        f"For each pixel of noise the test NCE changes by {each_of(rises)}: most for {most}. "
        f"With {axis.at(levels[-1])} it is {each_of(last)}: greatest for {worst}."
    )
    return Claim(
        where, paper, ClaimVerdict.HOLDS if most == NMLDC else ClaimVerdict.FAILS, finding + _failed(*three)
    )


def greatest_error(where: str, curves: Curves, axis: Axis) -> Claim:
    """NMLDC is the worst of the three."""
    paper = sentences.GREATER_ERRORS
    told, three = _both(curves, NMLDC, FCCM, MLDC)
    if not told.any():
        return Claim(
            where,
            paper,
            ClaimVerdict.OPEN,
            f"At none of the {axis.levels} did all three methods give a camera.",
        )
    nmldc, *others = three
    worst, of = (
        int(np.all([_clearly_above(nmldc, other) for other in others], axis=0)[told].sum()),
        int(told.sum()),
    )
    finding = (
        f"NMLDC's test NCE is the greatest of the three, by more than standard errors, at {worst} of {of}"
        f" {axis.levels}; on average it is"
        f" {each_of({curve.name: float(curve.test_nce[told].mean()) for curve in three})}."
    )
    return Claim(where, paper, share(worst, of), finding + _failed(*three))


def better_trained(where: str, curves: Curves, axis: Axis) -> Claim:
    """FCCM has the lowest training error (Table 1); judged with all points."""
    paper = sentences.BETTER_TRAINED
    told, three = _both(curves, FCCM, NMLDC, MLDC)
    if not told.any():
        return Claim(where, paper, ClaimVerdict.OPEN, "Not all three methods gave a camera.")
    last = int(np.flatnonzero(told)[-1])
    errors = {curve.name: float(curve.training_nce[last]) for curve in three}
    best = min(errors, key=errors.__getitem__)
    finding = (
        f"With {axis.at(three[0].levels[last])} the training NCE is {each_of(errors)}, lowest for {best}."
    )
    return Claim(
        where, paper, ClaimVerdict.HOLDS if best == FCCM else ClaimVerdict.FAILS, finding + _failed(*three)
    )


def exact_without_noise(where: str, curves: Curves, axis: Axis) -> Claim:
    """Few points are enough where there is no noise; one level, the number of points."""
    paper = sentences.EXACT_WITHOUT_NOISE
    three = [curves[name] for name in (FCCM, NMLDC, MLDC)]
    told = {curve.name: float(curve.test_nce[0]) for curve in three if np.isfinite(curve.test_nce[0])}
    if not told:
        return Claim(where, paper, ClaimVerdict.OPEN, "No method gave a camera.")
    exact = [name for name, nce in told.items() if nce < EXACT_NCE]
    finding = (
        f"With {axis.at(three[0].levels[0])} a view and no noise the test NCE is {each_of(told)}: "
        f"below {EXACT_NCE:g} for {joined_words(exact) if exact else 'none of them'}."
    )
    return Claim(where, paper, share(len(exact), len(three)), finding + _failed(*three))


def accurate_from_three(where: str, curves: Curves, axis: Axis) -> Claim:
    """From three views on MLDC's camera is accurate; levels are numbers of views."""
    paper = sentences.ACCURATE_FROM_THREE
    told, (mldc,) = _both(curves, MLDC)
    enough = told & (mldc.levels >= 3)
    if not enough.any():
        return Claim(where, paper, ClaimVerdict.OPEN, "MLDC gave no camera from three images or more.")
    nce, views = mldc.test_nce[enough], mldc.levels[enough]
    accurate = int((nce < ACCURATE_NCE).sum())
    between = axis.at(views[0]) if len(views) == 1 else f"{views[0]:g} to {axis.at(views[-1])}"
    finding = (
        f"With {between} MLDC's test NCE is {span(nce)}; it is below {ACCURATE_NCE:g}, what rounding to whole"
        f" pixels gives, at {accurate} of {len(nce)} {axis.levels}."
    )
    return Claim(where, paper, share(accurate, len(nce)), finding + _failed(mldc))


def fewer_than_three(where: str, curves: Curves, axis: Axis) -> Claim:
    """From one or two views the assumptions may lead far off; levels are numbers of views."""
    paper = sentences.FAR_FROM_FEW
    told, (mldc,) = _both(curves, MLDC)
    few, enough = told & (mldc.levels < 3), told & (mldc.levels >= 3)
    if not few.any() or not enough.any():
        return Claim(
            where,
            paper,
            ClaimVerdict.OPEN,
            "MLDC gave no camera from fewer than three images, or none from more." + _failed(mldc),
        )
    reference = float(mldc.test_nce[enough].max())
    far = mldc.test_nce[few] > reference
    said = joined_words(
        [
            f"{short_number(nce)} with {axis.at(views)}"
            for nce, views in zip(mldc.test_nce[few], mldc.levels[few], strict=True)
        ]
    )
    finding = f"MLDC's test NCE is {said}; with three or more it is {short_number(reference)} at most."
    return Claim(where, paper, share(int(far.sum()), len(far)), finding + _failed(mldc))


def fair_chance(curves: Mapping[str, Curves], *, level: float, noise_px: float) -> str:
    """What FCCM's other lens does to the comparison, a sentence for each scene; level: where on the
    curves.
    """
    said = []
    for scene, of_scene in curves.items():
        nce = {
            name: _at(of_scene[name], level)
            for name in (FCCM5, REPEATED, FCCM, NMLDC, MLDC)
            if name in of_scene
        }
        if nce and np.isfinite(list(nce.values())).all():
            least = min(nce, key=nce.__getitem__)
            said.append(
                f"In the {scene} distortion with {noise_px:g} px of noise the test NCE is {each_of(nce)}:"
                f" least for {least}."
            )
    return " ".join(said)


def _both(curves: Curves, *names: str) -> tuple[Bool[ndarray, " n"], list[Curve]]:
    """At which levels all of these gave a camera, and their curves."""
    chosen = [curves[name] for name in names]
    return (
        np.all([np.isfinite(curve.test_nce) & np.isfinite(curve.training_nce) for curve in chosen], axis=0),
        chosen,
    )


def _clearly_above(curve: Curve, other: Curve) -> Bool[ndarray, " n"]:
    """Where one's test error is above the other's by more than the standard error of their difference, as far
    as trials tell it.
    """
    return curve.test_nce - other.test_nce > np.hypot(
        np.nan_to_num(curve.test_error), np.nan_to_num(other.test_error)
    )


def _true_poses(*curves: Curve) -> str:
    """The other reading of test NCE, where the true poses are known."""
    known = {curve.name: curve.true_pose_nce[np.isfinite(curve.true_pose_nce)] for curve in curves}
    if not all(len(values) for values in known.values()):
        return ""
    means = {name: float(values.mean()) for name, values in known.items()}
    return f" With the true poses of the test views: {each_of(means)}."


def _at(curve: Curve, level: float) -> float:
    return float(curve.test_nce[np.argmin(np.abs(curve.levels - level))])


def _failed(*curves: Curve) -> str:
    """How many trials the finding does not rest on."""
    failed = [
        f"{curve.name} in {int(curve.failures.sum())} of {int(curve.trials.sum())}"
        for curve in curves
        if curve.failures.any()
    ]
    return f" Trials without a camera: {joined_words(failed)}." if failed else ""
