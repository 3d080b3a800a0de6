"""Evaluations made by hand: a known camera, boards in front of it, seeded noise; no solver takes part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orthoscope.evaluation.camera_error import CameraError
from orthoscope.evaluation.evaluate import Evaluation, ViewError
from orthoscope.evaluation.misfit.misfit import misfit
from orthoscope.evaluation.verdict.grades import Grade
from orthoscope.evaluation.verdict.verdict import Verdict
from orthoscope.fitting.calibration import Calibration, Candidate, Uncertainty, rms
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections, SetAside, View
from orthoscope.targets.target import Target, chessboard

NOISE = 0.15  # px per coordinate
PRINT = np.stack(
    [1e-3 * np.sin(np.arange(54)), 2e-4 * (np.arange(54) // 9), 2e-3 * np.cos(np.arange(54) // 9)], axis=-1
)  # metres


def photographed(
    camera: Camera,
    target: Target,
    views: int,
    *,
    tilt: float,
    distance: float,
    turn: float = 0.0,
    seed: int = 1,
) -> Calibration:
    """`views` boards at about `distance` metres, the corners that fall in the frame seen with noise.

    tilt: boards are turned in themselves by up to this about each axis; turn: and carried around the camera
    by up to this (radians).
    """
    generator = np.random.default_rng(seed)
    poses = [_pose(generator, target, tilt, distance, turn) for _ in range(views)]
    seen = [_seen(camera, pose, target, f"left{i + 1:02d}.jpg", generator) for i, pose in enumerate(poses)]
    detections = Detections(
        target,
        camera.image_size,
        tuple(seen),
        (SetAside("<blurred> & dark.jpg", "no chessboard of 9x6 found"),),
    )
    return Calibration(
        camera=camera,
        camera_from_target=tuple(poses),
        detections=detections,
        method="fccm",
        settings={"lens": "brown", "skew": False, "loss": "linear"},
        uncertainty=_uncertainty(camera),
        status="converged: the step no longer changes the parameters",
        steps=9,
        version="0.1.0",
    )


def evaluated(calibration: Calibration, *, held_out: bool = True) -> Evaluation:
    """An evaluation with the calibration's own residuals; held-out ones a tenth larger, or NaN."""
    residuals = calibration.residuals()
    factor = 1.1 if held_out else np.nan
    views = tuple(
        ViewError(
            view.image, len(view.ids), rms(e) if len(e) else np.nan, factor * rms(e) if len(e) else np.nan
        )
        for view, e in zip(calibration.detections.views, residuals, strict=True)
    )
    size = np.sqrt((np.concatenate(residuals) ** 2).sum(-1))
    return Evaluation(
        calibration=calibration,
        rms_px=calibration.rms_px,
        median_px=float(np.median(size)),
        largest_px=float(size.max()),
        held_out_rms_px=factor * calibration.rms_px,
        held_out_error_px=0.012 if held_out else np.nan,
        nce=0.31,
        misfit=misfit(calibration),
        coverage=0.87,
        views=views,
        held_out_residuals=tuple(factor * e for e in residuals),
        suspects=(),
        warnings=(),
        verdict=Verdict(
            Grade.REGION,
            "",
            "Good within a region: off by about 0.12 px where corners were seen, and by less than 0.5 px over"
            " 64 % of the frame.",
            "",
            "Photograph the target at the bottom left.",
        ),
        error=_camera_error(calibration) if held_out else None,
    )


def _camera_error(calibration: Calibration) -> CameraError:
    """Small in the middle of the frame and large at its corners, used within an ellipse."""
    width, height = calibration.camera.image_size
    x, y = np.meshgrid(np.linspace(-1, 1, 28), np.linspace(-1, 1, 21))
    far, around = 0.05 + 0.3 * (x * x + y * y), np.linspace(0, 2 * np.pi, 48, endpoint=False)
    region = 0.5 * np.array([width, height]) * (1 + 0.7 * np.stack([np.cos(around), np.sin(around)], -1))
    views = len(calibration.detections.views)
    figures = dict(
        zip(("seen_px", "frame_px", "near_seen_px", "near_frame_px"), (0.12, 0.3, 0.1, 0.2), strict=True)
    )
    parts = dict.fromkeys(("model_px", "alike_px", "views_px", "bias_px"), 0.05)
    return CameraError(
        **figures,
        **parts,
        distance=0.5,
        far=far,
        near=0.8 * far,
        limit_px=0.24,
        region=region,
        share=0.6,
        seen_share=0.7,
        without_px=0.01 * (1.0 + np.arange(views) % 5),
    )


def with_suspect(evaluation: Evaluation, index: int = 3) -> Evaluation:
    """The same with one view whose corners were found 1.5 px off."""
    calibration = evaluation.calibration
    views = list(calibration.detections.views)
    views[index] = replace(views[index], pixels=views[index].pixels + np.array([1.2, -0.9]))
    calibration = replace(calibration, detections=replace(calibration.detections, views=tuple(views)))
    return replace(
        evaluated(calibration), suspects=((views[index].image, "its error is 7 times that of the others"),)
    )


def narrow_camera() -> Camera:
    """640x480, 62 degrees, the barrel distortion of a cheap lens."""
    return Camera(
        (640, 480),
        Intrinsics(536.1, 536.3, 342.4, 235.5),
        Brown(k1=-0.281, k2=0.091, p1=0.0008, p2=-0.0003, k3=-0.02),
    )


def fisheye_camera() -> Camera:
    """640x720, past 90 degrees from the axis; the frame's corners have no ray."""
    return Camera(
        (640, 720),
        Intrinsics(205.0, 205.4, 318.2, 361.7),
        KannalaBrandt(k1=0.01, k2=-0.02, k3=0.004, k4=-0.0012),
    )


@pytest.fixture(scope="session")
def ordinary() -> Evaluation:
    return evaluated(photographed(narrow_camera(), chessboard(9, 6, 0.025), 14, tilt=0.6, distance=0.45))


@pytest.fixture(scope="session")
def fisheye() -> Evaluation:
    evaluation = evaluated(
        photographed(fisheye_camera(), chessboard(9, 6, 0.04), 20, tilt=0.4, distance=0.2, turn=1.2)
    )
    return replace(evaluation, warnings=("No corners were seen in a third of the frame.",))


@pytest.fixture(scope="session")
def suspicious(ordinary) -> Evaluation:
    return with_suspect(ordinary)


@pytest.fixture(scope="session")
def single(ordinary) -> Evaluation:
    """One photograph: nothing could be held out, and the focal lengths were tied."""
    calibration = photographed(narrow_camera(), chessboard(9, 6, 0.025), 1, tilt=0.6, distance=0.3)
    calibration = replace(
        calibration,
        uncertainty=Uncertainty(("fx=fy", "k1"), np.diag([4.0, 1e-4])),
        assumptions=("One view cannot tell the principal point: it was taken to be the image's middle.",),
    )
    return replace(
        evaluated(calibration, held_out=False), nce=np.nan, coverage=np.nan, warnings=("Only one view.",)
    )


@pytest.fixture(scope="session")
def unheld(ordinary) -> Evaluation:
    """No held-out errors, no uncertainty, and a corner without image."""
    calibration = ordinary.calibration
    poses = (
        Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, -1.0])),
        *calibration.camera_from_target[1:],
    )  # the first lies behind
    calibration = replace(
        calibration, camera_from_target=poses, uncertainty=Uncertainty((), np.zeros((0, 0)))
    )
    return replace(evaluated(calibration, held_out=False), rms_px=np.nan)


@pytest.fixture(scope="session")
def misshapen(ordinary) -> Evaluation:
    """A board whose print is stretched and wavy, taken as flat and true."""
    calibration = ordinary.calibration
    true = replace(
        calibration.detections.target, points=calibration.detections.target.points + PRINT * [1.0, 1.0, 0.0]
    )
    poses, camera = calibration.camera_from_target, calibration.camera
    shifts = (
        (
            camera.project(pose.apply(true.points))
            - camera.project(pose.apply(calibration.detections.target.points))
        )[view.ids]
        for pose, view in zip(poses, calibration.detections.views, strict=True)
    )
    views = (
        replace(view, pixels=view.pixels + shift)
        for view, shift in zip(calibration.detections.views, shifts, strict=True)
    )
    return evaluated(replace(calibration, detections=replace(calibration.detections, views=tuple(views))))


@pytest.fixture(scope="session")
def shaped(misshapen) -> Evaluation:
    """The same with its shape estimated, and a formula that was chosen among others and stands for a free
    lens.
    """
    camera = misshapen.calibration.camera
    other = replace(camera, lens=camera.lens.with_coefficients(k1=-0.279))
    tried = (Candidate("flat", "brown", 0.31, 0.02, 0.09), Candidate("free", "brown", 0.22, 0.01, 0.0))
    shape = TargetShape("free", PRINT)
    return evaluated(replace(misshapen.calibration, target_shape=shape, free_camera=other, candidates=tried))


@pytest.fixture(scope="session")
def every_evaluation(
    ordinary, fisheye, suspicious, single, unheld, misshapen, shaped
) -> dict[str, Evaluation]:
    """All of the above by name."""
    return {
        "ordinary": ordinary,
        "fisheye": fisheye,
        "suspicious": suspicious,
        "single": single,
        "unheld": unheld,
        "misshapen": misshapen,
        "shaped": shaped,
    }


@pytest.fixture(scope="session")
def dense() -> Evaluation:
    """50 views of 280 corners, the size that the page is budgeted for."""
    camera = Camera((1920, 1080), Intrinsics(1500.0, 1500.0, 958.0, 541.0), Brown(k1=-0.2, k2=0.05))
    return evaluated(photographed(camera, chessboard(20, 14, 0.02), 50, tilt=0.6, distance=0.5))


@pytest.fixture(scope="session")
def two_hundred() -> Evaluation:
    """200 views of 280 corners, the most that the page is made for."""
    camera = Camera((1920, 1080), Intrinsics(1500.0, 1500.0, 958.0, 541.0), Brown(k1=-0.2, k2=0.05))
    return evaluated(photographed(camera, chessboard(20, 14, 0.02), 200, tilt=0.6, distance=0.5))


def _pose(generator: np.random.Generator, target: Target, tilt: float, distance: float, turn: float) -> Pose:
    rotation = rotation_from_vector(generator.uniform(-tilt, tilt, 3))
    middle = np.array([0.0, 0.0, distance]) + generator.uniform(-0.35, 0.35, 3) * distance
    carried = rotation_from_vector(np.append(generator.uniform(-turn, turn, 2), 0.0))
    return Pose(carried, np.zeros(3)) @ Pose(rotation, middle - rotation @ target.points.mean(0))


def _seen(camera: Camera, pose: Pose, target: Target, image: str, generator: np.random.Generator) -> View:
    pixels = camera.project(pose.apply(target.points)) + generator.normal(0.0, NOISE, (len(target.points), 2))
    inside = ((pixels >= 0) & (pixels <= np.array(camera.image_size) - 1)).all(-1)
    ids = np.flatnonzero(inside)
    return View(image, ids, pixels[ids])


def _uncertainty(camera: Camera) -> Uncertainty:
    names = ("fx", "fy", "cx", "cy", *type(camera.lens).free)
    deviations = np.array([0.31, 0.30, 0.62, 0.55, *(0.002 * 2.0 ** np.arange(len(names) - 4))])
    return Uncertainty(names, np.diag(deviations**2))
