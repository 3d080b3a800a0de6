"""Rotations and rigid motions."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import (
    Pose,
    cross_matrix,
    nearest_rotation,
    rotation_from_vector,
    vector_from_rotation,
)

EXACT = 1e-14  # a few roundings of numbers of size 1
POINTS = np.array([[0.1, -0.2, 0.3], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
VECTORS = {
    "none": [0.0, 0.0, 0.0],
    "tiny": [1e-9, -2e-9, 3e-9],
    "at the switch to the series": [0.0, 0.99e-4, 0.0],
    "past that switch": [1.01e-4, 0.0, 0.0],
    "usual": [0.3, -0.5, 0.2],
    "a right angle": [0.0, 0.0, np.pi / 2],
    "nearly half a turn": [0.0, np.pi - 1e-9, 0.0],
    "half a turn about a slanted axis": (np.pi * np.array([2.0, -1.0, 2.0]) / 3.0).tolist(),
}
FOR_EVERY_VECTOR = pytest.mark.parametrize(
    "vector", [np.array(v) for v in VECTORS.values()], ids=VECTORS.keys()
)


def some_pose(seed: int) -> Pose:
    generator = np.random.default_rng(seed)
    return Pose(rotation_from_vector(generator.normal(size=3)), generator.normal(size=3))


@FOR_EVERY_VECTOR
def test_a_rotation_is_orthonormal(vector):
    rotation = rotation_from_vector(vector)
    assert_allclose(rotation @ rotation.T, np.eye(3), atol=EXACT)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=EXACT)


@FOR_EVERY_VECTOR
def test_a_rotation_keeps_its_axis(vector):
    assert_allclose(rotation_from_vector(vector) @ vector, vector, atol=EXACT)


@FOR_EVERY_VECTOR
def test_the_vector_of_a_rotation_gives_the_rotation_back(vector):
    rotation = rotation_from_vector(vector)
    again = vector_from_rotation(rotation)
    assert_allclose(rotation_from_vector(again), rotation, atol=EXACT)
    assert np.linalg.norm(again) <= np.pi + EXACT


@pytest.mark.parametrize("name", [name for name in VECTORS if name != "half a turn about a slanted axis"])
def test_below_half_a_turn_the_vector_itself_comes_back(name):
    assert_allclose(
        vector_from_rotation(rotation_from_vector(np.array(VECTORS[name]))), VECTORS[name], atol=1e-13
    )


def test_half_a_turn_comes_back_about_its_axis():
    vector = np.array(VECTORS["half a turn about a slanted axis"])
    again = vector_from_rotation(rotation_from_vector(vector))
    assert_allclose(
        np.abs(again @ vector), np.pi**2, rtol=1e-12
    )  # either sense of the axis is the same half turn


def test_a_right_angle_about_z_takes_x_to_y():
    assert_allclose(
        rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])) @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=EXACT
    )


def test_rotation_vectors_come_in_stacks():
    vectors = np.array(list(VECTORS.values())).reshape(2, 4, 3)
    assert_allclose(rotation_from_vector(vectors)[1, 2], rotation_from_vector(vectors[1, 2]), atol=0.0)


def test_a_step_on_the_left_has_the_stated_derivative():
    pose, step = some_pose(1), 1e-6
    rotated = pose.rotation @ POINTS[0]
    for axis in np.eye(3):
        difference = (
            rotation_from_vector(step * axis) @ rotated - rotation_from_vector(-step * axis) @ rotated
        )
        assert_allclose(
            difference / (2.0 * step), -cross_matrix(rotated) @ axis, atol=1e-9
        )  # rounding over step


def test_the_cross_matrix_is_the_cross_product():
    a, b = np.array([1.0, 2.0, 3.0]), np.array([-0.5, 0.25, 4.0])
    assert_allclose(cross_matrix(a) @ b, np.cross(a, b), atol=EXACT)


def test_a_pose_and_its_inverse_cancel():
    pose = some_pose(2)
    for identity in (pose @ pose.inverse(), pose.inverse() @ pose):
        assert_allclose(identity.rotation, np.eye(3), atol=EXACT)
        assert_allclose(identity.translation, 0.0, atol=EXACT)


def test_composing_poses_is_applying_them_in_turn():
    camera_from_world, world_from_target = some_pose(3), some_pose(4)
    camera_from_target = camera_from_world @ world_from_target
    assert_allclose(
        camera_from_target.apply(POINTS), camera_from_world.apply(world_from_target.apply(POINTS)), atol=EXACT
    )


def test_composition_is_associative():
    a, b, c = some_pose(5), some_pose(6), some_pose(7)
    assert_allclose(((a @ b) @ c).apply(POINTS), (a @ (b @ c)).apply(POINTS), atol=EXACT)


def test_the_nearest_rotation_of_a_rotation_is_itself():
    rotations = np.stack([some_pose(seed).rotation for seed in range(5)])
    assert_allclose(nearest_rotation(rotations), rotations, atol=EXACT)


def test_the_nearest_rotation_is_one_even_of_a_mirror():
    nearest = nearest_rotation(np.diag([1.0, 1.0, -1.0]) * 0.9)
    assert_allclose(nearest @ nearest.T, np.eye(3), atol=EXACT)
    assert np.linalg.det(nearest) == pytest.approx(1.0, abs=EXACT)


def test_a_scaled_rotation_is_taken_back_to_it():
    rotation = some_pose(8).rotation
    assert_allclose(nearest_rotation(1.7 * rotation), rotation, atol=EXACT)


@pytest.mark.parametrize(
    "wrong", [np.diag([1.0, 1.0, -1.0]), 1.01 * np.eye(3), np.zeros((3, 3))], ids=["mirror", "scaled", "zero"]
)
def test_what_is_no_rotation_is_refused(wrong):
    with pytest.raises(InputError, match="not orthonormal"):
        Pose(wrong, np.zeros(3))


def test_a_translation_with_nan_is_refused():
    with pytest.raises(InputError, match=r"translation has nan at \[1\]; expected finite numbers"):
        Pose(np.eye(3), np.array([0.0, np.nan, 0.0]))


def test_a_pose_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        some_pose(9).translation[0] = 1.0
