"""One trial: data, calibration, NCE on training views and on test views.

As in section 4.1: 20 views, the first 15 to compute and the last 5 to test; noise that grows with the tilt on
training data, none on test data. A trial's views and noise are the same at every level, so that curves differ
by the level alone.

Training NCE is that of the calibration's own poses. Test NCE has two readings. With the camera fixed each
test pose is fitted: the only way with photographs, and what a user of the camera sees. With the *true* poses,
which a simulation knows ("the calibration scene is simulated and the precise camera parameters are known"), a
method is charged for a camera that is turned against the true one as well. And training data have noise, test
data none: to compare like with like, test NCE is also taken on test views with the noise of the training
views.

Test corners for which the camera has no ray are left out of NCE and counted; more than 1 % of them fail the
trial, since leaving so many out would reward a lens that folds over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.evaluate import evaluate_on
from orthoscope.evaluation.metrics import lateral_errors, normalised_calibration_error
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.paper.entries import PaperEntry
from orthoscope.paper.straightness import bent_px
from orthoscope.paper.subgrids import on_subgrid
from orthoscope.simulation.scene import PAPER_FILL, Scene, paper_scene, simulate_detections
from orthoscope.targets.detections import Detections

__all__ = [
    "TEST_VIEWS",
    "TRAINING_VIEWS",
    "Condition",
    "Judgement",
    "Outcome",
    "Study",
    "Trial",
    "papers_scene",
    "simulated",
    "simulated_trial",
    "trial_judged",
    "trial_outcomes",
]

# A trial calibrates from so many views, as in the paper.
TRAINING_VIEWS = 15
# A trial is tested on so many other views, as in the paper.
TEST_VIEWS = 5
# This stands for a figure that a trial does not have.
NOWHERE = float("nan")
# A camera without rays for more than this share of the test corners has failed.
UNSEEN_SHARE = 0.01


class Condition(NamedTuple):
    """What data a trial has.

    Attributes:
        noise_px: sigma of training data.
        subgrid: (columns, rows) of training data, None for all corners.
        views: to compute from.
        tilt: least and greatest, of all views, radians.
        fill: least and greatest share of the image that the board has, of all views.
    """

    noise_px: float = 0.1
    subgrid: tuple[int, int] | None = None
    views: int = TRAINING_VIEWS
    tilt: tuple[float, float] = (0.0, np.pi / 4)
    fill: tuple[float, float] = PAPER_FILL


class Study(NamedTuple):
    """Conditions that differ in one thing, its value in each of them (`levels`), and who is tried on them."""

    name: str
    levels: tuple[float, ...]
    conditions: tuple[Condition, ...]
    entries: tuple[PaperEntry, ...]


class Trial(NamedTuple):
    """Data of one trial: to compute from, to test on without and with noise, and where the target was in the
    test views (empty where no one knows).
    """

    training: Detections
    test: Detections
    noisy_test: Detections
    test_poses: tuple[Pose, ...] = ()


class Judgement(NamedTuple):
    """An entry's errors and camera (pixels) on one set of data, NaN and the reason where it failed.

    Attributes:
        training_nce: of the calibration's own poses.
        test_nce: of fitted poses.
        noisy_test_nce: the same on test views as noisy as the training views.
        true_pose_nce: of the true poses.
        unseen: the share of test corners without a ray.
        centre_x, centre_y: of distortion.
        lens: its coefficients, as `name=value name=value`.
        steps: of the search, or rounds.
        bent_px: how far rows and columns of the noisy test views are off straight lines, straightened.
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
    noisy_test_nce: float = NOWHERE
    true_pose_nce: float = NOWHERE
    centre_x: float = NOWHERE
    centre_y: float = NOWHERE
    lens: str = ""
    steps: float = NOWHERE
    bent_px: float = NOWHERE


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


def trial_judged(entry: PaperEntry, trial: Trial) -> Judgement:
    """Calibrate from the training views and judge on both; a CalibrationError is an outcome like any other.

    So is whatever else a function of the user's own raises: it shall not end a run of hours.
    """
    outcomes = CalibrationError if isinstance(entry.method, str) else Exception
    try:
        calibration = entry.calibrate(trial.training)
        camera = calibration.camera
        test_nce = evaluate_on(camera, trial.test).nce
        noisy_nce = test_nce if trial.noisy_test is trial.test else evaluate_on(camera, trial.noisy_test).nce
        unseen = _unseen(camera, trial.test)
    except outcomes as error:
        told = "" if isinstance(error, CalibrationError) else f"{type(error).__name__}: "
        return Judgement(failure=f"{told}{error}")
    K, frame = camera.intrinsics, camera.lens_frame or camera.intrinsics
    coefficients = dict(zip(camera.lens.names(), camera.lens.coefficients.tolist(), strict=True))
    return Judgement(
        _nce(camera, calibration.camera_from_target, calibration.detections),
        test_nce,
        K.fx,
        K.fy,
        K.cx,
        K.cy,
        K.skew,
        unseen=unseen,
        noisy_test_nce=noisy_nce,
        true_pose_nce=_nce(camera, trial.test_poses, trial.test) if trial.test_poses else NOWHERE,
        centre_x=frame.cx,
        centre_y=frame.cy,
        lens=" ".join(f"{name}={value:.6g}" for name, value in coefficients.items() if value),
        steps=float(calibration.steps),
        bent_px=bent_px(camera, trial.noisy_test),
    )


def _nce(camera: Camera, poses: Sequence[Pose], detections: Detections) -> float:
    """NCE over all corners that have a ray."""
    estimated, observed = lateral_errors(camera, poses, detections)
    return normalised_calibration_error(estimated, observed, camera.intrinsics)


def simulated(scene: str, condition: Condition, *, seed: int, trial: int) -> tuple[Detections, Detections]:
    """Training and test data of the paper's simulation with `low` or `high` distortion."""
    return simulated_trial(scene, condition, seed=seed, trial=trial)[:2]


def simulated_trial(scene: str, condition: Condition, *, seed: int, trial: int) -> Trial:
    """All that a trial of the paper's simulation knows.

    The random numbers are those of SeedSequence(seed).spawn's child `trial`, whoever asks first.
    """
    noise, of_test = (_random(seed, trial, part) for part in (1, 2))
    truth = papers_scene(scene, condition, seed=seed, trial=trial)
    training, test = (
        replace(truth, camera_from_target=truth.camera_from_target[part])
        for part in (slice(TRAINING_VIEWS), slice(TRAINING_VIEWS, TRAINING_VIEWS + TEST_VIEWS))
    )
    detected = simulate_detections(training, noise_px=condition.noise_px, rng=noise, tilt_noise=True)
    thinned = on_subgrid(detected.only(range(condition.views)), condition.subgrid)
    exact = simulate_detections(test, noise_px=0.0, rng=noise)
    noisy = simulate_detections(test, noise_px=condition.noise_px, rng=of_test, tilt_noise=True)
    return Trial(thinned, exact, noisy if condition.noise_px else exact, test.camera_from_target)


def papers_scene(scene: str, condition: Condition, *, seed: int, trial: int) -> Scene:
    """The camera, the target and all poses of a trial, those to compute from first."""
    return paper_scene(
        scene,
        count=TRAINING_VIEWS + TEST_VIEWS,
        rng=_random(seed, trial, 0),
        tilt=condition.tilt,
        fill=condition.fill,
    )


def _random(seed: int, trial: int, part: int) -> np.random.Generator:
    """The random numbers of views (0), of noise (1) and of noise on test views (2)."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial, part)))


def trial_outcomes(study: Study, scene: str, *, seed: int, trial: int) -> list[Outcome]:
    """Every entry at every level of a study, in one trial."""
    return [
        Outcome(study.name, scene, level, entry.name, trial, trial_judged(entry, data))
        for level, data in zip(study.levels, _data(study.conditions, scene, seed, trial), strict=True)
        for entry in study.entries
        if entry.most_trials is None or trial < entry.most_trials
    ]


def _data(conditions: Sequence[Condition], scene: str, seed: int, trial: int) -> list[Trial]:
    return [simulated_trial(scene, condition, seed=seed, trial=trial) for condition in conditions]


def _unseen(camera: Camera, test: Detections) -> float:
    """The share of test corners for which the camera has no ray.

    Raises:
        CalibrationError: they are too many.
    """
    lost = np.isnan(camera.unproject(np.concatenate([view.pixels for view in test.views]))[:, 2])
    if lost.mean() > UNSEEN_SHARE:
        raise CalibrationError(
            f"the camera has no ray for {int(lost.sum())} of {len(lost)} test corners. Use a lens that"
            " reaches over the image."
        )
    return float(lost.mean())
