"""Closed forms are exact where there is no noise and, for K, no distortion."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.laws import for_every_lens
from helpers.scenes import (
    BOARD,
    NARROW,
    WIDE,
    camera_with,
    facing,
    photographed,
    seen,
    some_corners,
    turned_boards,
)
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.starts.closed_form import (
    CENTRED,
    CENTRED_SQUARE,
    GENERAL,
    NO_SKEW,
    intrinsics_of_homographies,
    poses_of_camera,
)
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import Brown, Pfet
from orthoscope.simulation.scene import random_views
from orthoscope.targets.detections import Detections

SIZE = (640, 480)
CENTRE = (319.5, 239.5)


def homographies(K: Intrinsics, poses: tuple[Pose, ...]) -> np.ndarray:
    """K [r1 r2 t] of each pose."""
    return np.array([K.matrix @ np.column_stack([pose.rotation[:, :2], pose.translation]) for pose in poses])


def tilted(views: int) -> tuple[Pose, ...]:
    return random_views(NARROW, BOARD, views, rng=np.random.default_rng(3), tilt=(0.3, 0.8))


@pytest.mark.parametrize(
    ("K", "views", "basis"),
    [
        (Intrinsics(800.0, 830.0, 300.0, 250.0, 4.0), 3, GENERAL),
        (Intrinsics(800.0, 830.0, 300.0, 250.0, 4.0), 12, GENERAL),
        (Intrinsics(800.0, 830.0, 300.0, 250.0), 2, NO_SKEW),
        (Intrinsics(800.0, 830.0, 300.0, 250.0), 12, NO_SKEW),
        (Intrinsics(800.0, 830.0, *CENTRE), 2, CENTRED),
        (Intrinsics(800.0, 800.0, *CENTRE), 1, CENTRED_SQUARE),
    ],
)
def test_exact_homographies_give_the_exact_camera(K, views, basis):
    found = intrinsics_of_homographies(homographies(K, tilted(views)), SIZE, basis)
    assert found is not None
    assert_allclose(
        found.as_tuple(), K.as_tuple(), rtol=1e-9, atol=1e-7
    )  # rounding times the condition of views so little tilted


@pytest.mark.parametrize("scale", [1e-3, -1.0, 1e4])
def test_the_scale_of_a_homography_does_not_matter(scale):
    K = Intrinsics(800.0, 830.0, 300.0, 250.0)
    found = intrinsics_of_homographies(scale * homographies(K, tilted(4)), SIZE, NO_SKEW)
    assert found is not None
    assert_allclose(found.as_tuple(), K.as_tuple(), rtol=1e-9, atol=1e-7)


def test_homographies_of_no_real_camera_give_none():
    pixels_from_normal = np.array([[320.0, 0.0, CENTRE[0]], [0.0, 320.0, CENTRE[1]], [0.0, 0.0, 1.0]])
    views = []
    for rapidity in (
        0.0,
        0.3,
        -0.5,
        0.8,
    ):  # frames that diag(1, -1, 1) takes for orthonormal, where a camera's B is definite
        sh, ch = np.sinh(rapidity), np.cosh(rapidity)
        boosts = np.array([[ch, sh, 0.0], [sh, ch, 0.0], [0.0, 0.0, 1.0]]) @ np.array(
            [[1.0, 0.0, 0.0], [0.0, ch, sh], [0.0, sh, ch]]
        )
        views.append(pixels_from_normal @ boosts[:, [0, 2, 1]])
    assert intrinsics_of_homographies(np.array(views), SIZE, GENERAL) is None


def rows_as_views(observations: Observations, rows: np.ndarray) -> np.ndarray:
    """Rows of the observations' table in the order of the views."""
    return rows[np.argsort(observations.order)]


def assert_poses_exact(
    camera: Camera, detections: Detections, poses: tuple[Pose, ...], atol: float = 1e-9
) -> None:
    observations = Observations.of(detections)
    found = poses_of_camera(camera, observations, BOARD.points)
    assert_allclose(rows_as_views(observations, found.rotation), [pose.rotation for pose in poses], atol=atol)
    assert_allclose(
        rows_as_views(observations, found.translation), [pose.translation for pose in poses], atol=atol
    )


@for_every_lens
def test_poses_are_exact_for_every_lens(lens: Lens):
    camera = camera_with(lens)
    near_the_axis = tuple(Pose(rotation_from_vector(w), t) for w, t in zip(*turned_boards(), strict=True))
    detections = seen(camera, near_the_axis)
    torn = (
        isinstance(lens, Pfet) and lens.a0 != 0.0
    )  # what lies on its ring or in its hole is no part of the image
    # rounding of pixels, 1e-13 of 500, times the condition of a homography: 1e3, and beside a ring more
    assert_poses_exact(camera, detections, near_the_axis, atol=1e-7 if torn else 1e-9)


def test_poses_are_exact_past_90_degrees_and_for_partial_boards():
    poses = random_views(WIDE, BOARD, 20, rng=np.random.default_rng(0), whole=False, fill=(0.5, 0.9))
    detections = some_corners(seen(WIDE, poses), (0.3, 0.9))
    rays = WIDE.unproject(np.concatenate([view.pixels for view in detections.views]))
    assert np.degrees(np.arccos(rays[:, 2].min())) > 95
    assert_poses_exact(
        WIDE, detections, poses, atol=1e-7
    )  # boards of a few corners, seen small and askew, are less well conditioned


def test_a_target_on_the_axis_and_face_on_is_no_exception():
    poses = (Pose(np.eye(3), np.array([0.0, 0.0, 0.5])), *facing(2, np.eye(3)))
    assert_poses_exact(NARROW, seen(NARROW, poses), poses)


def test_a_view_that_the_lens_does_not_see_has_no_pose():
    folding = camera_with(
        Brown(k1=-0.5)
    )  # folds over at 39 degrees: nothing is seen beyond 0.54 focal lengths from the centre
    detections = photographed(NARROW, 3)
    far_out = Detections(
        BOARD,
        SIZE,
        (type(detections.views[0])("corner", np.arange(4), np.array([[0, 0], [9, 0], [0, 9], [9, 9]])),),
    )
    assert np.isnan(poses_of_camera(folding, Observations.of(far_out), BOARD.points).translation).all()
