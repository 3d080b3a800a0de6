"""Many trials to one curve for each entry: means over the trials at each level.

The paper averages trials; so does this. Failed trials have no errors: they are left out of the means and
counted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.paper.trials import Outcome

__all__ = ["Curve", "Curves", "curves_of"]


@dataclass(frozen=True, eq=False)
class Curve:
    """A entry's mean errors at each level, ascending: NCE on training and on test data, and what they rest
    on.

    Attributes:
        test_error: standard error of test_nce, NaN with fewer than two trials.
        noisy_test_nce: on test views as noisy as the training views.
        true_pose_nce: with the true poses of the test views; NaN where no one knows them.
        trials, failures: how many were made, and how many of them gave no camera.
    """

    name: str
    levels: Float[ndarray, " n"]
    training_nce: Float[ndarray, " n"]
    test_nce: Float[ndarray, " n"]
    test_error: Float[ndarray, " n"]
    trials: Int[ndarray, " n"]
    failures: Int[ndarray, " n"]
    noisy_test_nce: Float[ndarray, " n"]
    true_pose_nce: Float[ndarray, " n"]


Curves = Mapping[str, Curve]


def curves_of(outcomes: Sequence[Outcome], *, study: str, scene: str) -> dict[str, Curve]:
    """The curves of a study in one scene, by entry, in the order in which they were tried."""
    chosen = [outcome for outcome in outcomes if (outcome.study, outcome.scene) == (study, scene)]
    names = list(dict.fromkeys(outcome.entry for outcome in chosen))
    return {name: _curve(name, [outcome for outcome in chosen if outcome.entry == name]) for name in names}


def _curve(name: str, outcomes: Sequence[Outcome]) -> Curve:
    levels = sorted({outcome.level for outcome in outcomes})
    errors = [
        [(o.judgement.training_nce, o.judgement.test_nce) for o in outcomes if o.level == level]
        for level in levels
    ]
    given = [np.array(pairs)[np.isfinite(pairs).all(1)] for pairs in errors]
    means = np.array([pairs.mean(0) if len(pairs) else (np.nan, np.nan) for pairs in given])
    spread = [pairs[:, 1].std(ddof=1) / np.sqrt(len(pairs)) if len(pairs) > 1 else np.nan for pairs in given]
    trials = np.array([len(pairs) for pairs in errors])
    return Curve(
        name,
        np.array(levels),
        means[:, 0],
        means[:, 1],
        np.array(spread),
        trials,
        trials - [len(pairs) for pairs in given],
        *(_means(outcomes, levels, of) for of in ("noisy_test_nce", "true_pose_nce")),
    )


def _means(outcomes: Sequence[Outcome], levels: Sequence[float], of: str) -> Float[ndarray, " n"]:
    """Of one of a judgement's numbers at each level, over the trials that have it."""
    values = [np.array([getattr(o.judgement, of) for o in outcomes if o.level == level]) for level in levels]
    return np.array([x[np.isfinite(x)].mean() if np.isfinite(x).any() else np.nan for x in values])
