"""One trial: data, calibration, NCE on training views and on test views.

As in section 4.1: 20 views, the first 15 to compute and the last 5 to test; noise that grows with the tilt on
training data, none on test data. A trial's views and noise are the same at every level, so that curves differ
by the level alone.

Training NCE is that of the calibration's own poses. For test NCE the camera stays fixed and each test pose is
fitted, although the simulation knows it: a camera's orientation trades against K and the poses, so true poses
would charge a method for a rotation that no use of the camera ever sees; and real photographs leave no other
way. Test corners for which the camera has no ray are left out of NCE and counted; more than 1 % of them fail
the trial, since leaving so many out would reward a lens that folds over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.evaluate import evaluate_on
from orthoscope.evaluation.metrics import lateral_errors, normalised_calibration_error
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.methods import calibrate
from orthoscope.models.camera import Camera
from orthoscope.paper.entries import Entry
from orthoscope.paper.subgrids import on_subgrid
from orthoscope.simulation.scene import paper_scene, simulate_detections
from orthoscope.targets.detections import Detections

__all__ = [
    "TEST_VIEWS",
    "TRAINING_VIEWS",
    "Condition",
    "Judgement",
    "Outcome",
    "Study",
    "judged",
    "simulated",
    "trial_outcomes",
]

TRAINING_VIEWS, TEST_VIEWS = 15, 5
NOWHERE = float("nan")
UNSEEN = 0.01  # of the test corners; a camera without rays for more of them has failed


class Condition(NamedTuple):
    """What training data a trial has: sigma in pixels, a sub-grid (columns, rows) or all corners, the number
    of views.
    """

    noise_px: float = 0.1
    subgrid: tuple[int, int] | None = None
    views: int = TRAINING_VIEWS


class Study(NamedTuple):
    """Conditions that differ in one thing, its value in each of them (`levels`), and who is tried on them."""

    name: str
    levels: tuple[float, ...]
    conditions: tuple[Condition, ...]
    entries: tuple[Entry, ...]


class Judgement(NamedTuple):
    """A entry's errors and camera (pixels) on one set of data, NaN and the reason where it failed; the share
    of test corners unseen.
    """

    training_nce: float = NOWHERE
    test_nce: float = NOWHERE
    fx: float = NOWHERE
    fy: float = NOWHERE
    cx: float = NOWHERE
    cy: float = NOWHERE
    skew: float = NOWHERE
    failure: str = ""
    unseen: float = NOWHERE


class Outcome(NamedTuple):
    """A judgement and where it belongs: the study, the scene (`low`, `high`, `photographs`), the level, who,
    and which trial.
    """

    study: str
    scene: str
    level: float
    entry: str
    trial: int
    judgement: Judgement


def judged(entry: Entry, training: Detections, test: Detections) -> Judgement:
    """Calibrate from the training views and judge on both; a CalibrationError is an outcome like any
    other.
    """
    try:
        calibration = calibrate(training, method=entry.method, **entry.settings)
        test_nce = evaluate_on(calibration.camera, test).nce
        unseen = _unseen(calibration.camera, test)
    except CalibrationError as error:
        return Judgement(failure=str(error))
    camera = calibration.camera
    estimated, observed = lateral_errors(camera, calibration.camera_from_target, calibration.detections)
    training_nce = normalised_calibration_error(estimated, observed, camera.intrinsics)
    K = camera.intrinsics
    return Judgement(training_nce, test_nce, K.fx, K.fy, K.cx, K.cy, K.skew, unseen=unseen)


def simulated(scene: str, condition: Condition, *, seed: int, trial: int) -> tuple[Detections, Detections]:
    """Training and test data of the paper's simulation with `low` or `high` distortion.

    The random numbers are those of SeedSequence(seed).spawn's child `trial`, whoever asks first.
    """
    views, noise = (
        np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial, part))) for part in range(2)
    )
    truth = paper_scene(scene, count=TRAINING_VIEWS + TEST_VIEWS, rng=views)
    training, test = (
        replace(truth, camera_from_target=truth.camera_from_target[part])
        for part in (slice(TRAINING_VIEWS), slice(TRAINING_VIEWS, TRAINING_VIEWS + TEST_VIEWS))
    )
    detected = simulate_detections(training, noise_px=condition.noise_px, rng=noise, tilt_noise=True)
    thinned = on_subgrid(detected.only(range(condition.views)), condition.subgrid)
    return thinned, simulate_detections(test, noise_px=0.0, rng=noise)


def trial_outcomes(study: Study, scene: str, *, seed: int, trial: int) -> list[Outcome]:
    """Every entry at every level of a study, in one trial."""
    return [
        Outcome(study.name, scene, level, entry.name, trial, judged(entry, *data))
        for level, data in zip(study.levels, _data(study.conditions, scene, seed, trial), strict=True)
        for entry in study.entries
    ]


def _data(
    conditions: Sequence[Condition], scene: str, seed: int, trial: int
) -> list[tuple[Detections, Detections]]:
    return [simulated(scene, condition, seed=seed, trial=trial) for condition in conditions]


def _unseen(camera: Camera, test: Detections) -> float:
    """The share of test corners for which the camera has no ray.

    Raises CalibrationError where they are too many.
    """
    lost = np.isnan(camera.unproject(np.concatenate([view.pixels for view in test.views]))[:, 2])
    if lost.mean() > UNSEEN:
        raise CalibrationError(
            f"the camera has no ray for {int(lost.sum())} of {len(lost)} test corners. Use a lens that"
            " reaches over the image."
        )
    return float(lost.mean())
