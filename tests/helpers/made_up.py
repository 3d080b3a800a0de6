"""Numbers that no experiment gave: curves, trials and cameras to feed to claims, figures and pages."""

from __future__ import annotations

import numpy as np

from orthoscope.paper.claims.about_curves import Axis
from orthoscope.paper.curves import Curve
from orthoscope.paper.entries import MLDC, NMLDC
from orthoscope.paper.eq7_searches import Eq7Search
from orthoscope.paper.trials import Judgement, Outcome

NOISE = Axis("noise levels", "{:g} px of noise", "noise_px", "sigma (px)")
POINTS = Axis("numbers of points", "{:g} points", "points", "points a view")
IMAGES = Axis("numbers of images", "{:g} images", "images", "images")


def curve(name: str, test, training=None, *, levels=None, failures: int = 0) -> Curve:
    """A curve of four trials a level; training errors are the test errors unless told."""
    test = np.array(test, dtype=float)
    count = np.full(len(test), 4)
    return Curve(
        name,
        np.arange(float(len(test))) if levels is None else np.array(levels, dtype=float),
        test if training is None else np.array(training, dtype=float),
        test,
        np.full(len(test), 0.01),
        count,
        np.array([failures] + [0] * (len(test) - 1)),
        test,
        np.full(len(test), np.nan),
    )


def curves(**test) -> dict[str, Curve]:
    """Curves by name, from their test errors; NMLDC and MLDC are the paper's as printed."""
    names = {"NMLDC": NMLDC, "MLDC": MLDC}
    return {names.get(name, name): curve(names.get(name, name), errors) for name, errors in test.items()}


def ended(fx: float, *, J: float = 1e-20, test_nce: float = 1.5) -> Eq7Search:
    """An end of eq. (7)'s search at a camera with this focal length."""
    return Eq7Search("low", "identity 1", J, Judgement(1.0, test_nce, fx, 750.0, 320.0, 240.0, 0.0))


def outcome(
    entry: str, level: float, trial: int, test_nce: float, *, study: str = "noise", failure: str = ""
) -> Outcome:
    """A trial in the low distortion; training error half the test error."""
    judgement = (
        Judgement(failure=failure)
        if failure
        else Judgement(0.5 * test_nce, test_nce, 750.0, 750.0, 320.0, 240.0, 0.0)
    )
    return Outcome(study, "low", level, entry, trial, judgement)
