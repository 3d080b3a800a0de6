"""Homographies: exact without noise, for partial views and for rays past 90 degrees."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.geometry.projective import homographies_to_pixels, homographies_to_rays
from orthoscope.targets.target import chessboard

BOARD = chessboard(9, 6, 0.025).points[:, :2]
K = np.array([[700.0, 0.5, 320.0], [0.0, 710.0, 240.0], [0.0, 0.0, 1.0]])
PIXEL = (
    1e-8  # px: the normal matrix squares the condition, some 1e3 of a normalised board, of 1e-16 times 1e3 px
)


def plane_to_camera(vector: list[float], translation: list[float]) -> np.ndarray:
    """[r1 r2 t] of a pose, so that H (X, Y, 1) is the corner in the camera frame."""
    rotation = rotation_from_vector(np.array(vector))
    return np.stack([rotation[:, 0], rotation[:, 1], np.array(translation)], axis=1)


POSES = np.stack(
    [
        plane_to_camera([0.0, 0.0, 0.0], [-0.1, -0.06, 0.4]),  # fronto-parallel
        plane_to_camera([0.4, -0.3, 0.1], [-0.1, -0.06, 0.5]),
        plane_to_camera([-0.7, 0.5, 2.0], [0.1, 0.0, 0.6]),
    ]
)


def homogeneous(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points, np.ones_like(points[..., :1])], axis=-1)


def seen_from(poses: np.ndarray) -> np.ndarray:
    """Corners in the camera frame, (views, corners, 3)."""
    return homogeneous(BOARD) @ np.swapaxes(poses, 1, 2)


def pixels_of(homographies: np.ndarray, points: np.ndarray) -> np.ndarray:
    seen = homogeneous(points) @ np.swapaxes(homographies, 1, 2)
    return seen[..., :2] / seen[..., 2:]


def test_pixels_without_noise_are_met_exactly():
    pixels = pixels_of(K @ POSES, BOARD)
    points = np.repeat(BOARD[None], 3, axis=0)
    found = homographies_to_pixels(points, pixels, np.ones((3, 54)))
    assert_allclose(pixels_of(found, BOARD), pixels, atol=PIXEL)


def test_a_homography_is_found_up_to_its_scale_with_the_plane_in_front():
    points = np.repeat(BOARD[None], 3, axis=0)
    found = homographies_to_pixels(points, pixels_of(K @ POSES, BOARD), np.ones((3, 54)))
    expected = K @ POSES
    expected /= np.sqrt((expected**2).sum((1, 2), keepdims=True))
    assert_allclose(found, expected, atol=1e-9)
    assert_allclose((found**2).sum((1, 2)), 1.0, atol=1e-14)


@pytest.mark.parametrize("corners", [4, 20])
def test_weight_zero_is_no_corner(corners):
    pixels = pixels_of(K @ POSES, BOARD)
    points = np.repeat(BOARD[None], 3, axis=0)
    seen = [0, 8, 45, 53] if corners == 4 else list(range(20))
    weights = np.zeros((3, 54))
    weights[:, seen] = 1.0
    spoilt = np.where(weights[..., None] > 0, pixels, 1e5)
    found = homographies_to_pixels(points, spoilt, weights)
    assert_allclose(
        pixels_of(found, BOARD), pixels, atol=1e-6
    )  # from few corners to the others: extrapolated 3 boards wide


def test_views_may_have_different_corners():
    weights = np.ones((3, 54))
    weights[1, ::2] = 0.0
    weights[2, 30:] = 0.0
    pixels = pixels_of(K @ POSES, BOARD)
    together = homographies_to_pixels(np.repeat(BOARD[None], 3, axis=0), pixels, weights)
    alone = homographies_to_pixels(BOARD[None, :30], pixels[2:, :30], np.ones((1, 30)))
    assert_allclose(together[2], alone[0], atol=1e-9)


def test_a_weight_of_two_is_the_corner_twice():
    generator = np.random.default_rng(0)
    pixels = pixels_of(K @ POSES[:1], BOARD) + generator.normal(scale=0.3, size=(1, 54, 2))
    weights = np.ones((1, 54))
    weights[0, :9] = 2.0
    twice = np.concatenate([np.arange(54), np.arange(9)])
    weighted = homographies_to_pixels(BOARD[None], pixels, weights)
    repeated = homographies_to_pixels(BOARD[None, twice], pixels[:, twice], np.ones((1, 63)))
    assert_allclose(weighted, repeated, atol=1e-9)


def test_rays_of_any_length_are_met_exactly():
    seen = seen_from(POSES) * np.linspace(0.3, 5.0, 54)[None, :, None]
    found = homographies_to_rays(np.repeat(BOARD[None], 3, axis=0), seen, np.ones((3, 54)))
    assert_allclose(
        np.cross(homogeneous(BOARD) @ np.swapaxes(found, 1, 2), seen_from(POSES)), 0.0, atol=1e-10
    )


def test_rays_past_90_degrees_are_met_and_point_forward():
    # a board over the camera's head: some corners in front, some behind
    pose = plane_to_camera([np.pi / 2 + 0.2, 0.1, 0.0], [-0.1, -0.15, -0.05])[None]
    seen = seen_from(pose)
    assert (seen[..., 2] < 0).any()
    assert (seen[..., 2] > 0).any()
    found = homographies_to_rays(BOARD[None], seen, np.ones((1, 54)))
    met = homogeneous(BOARD) @ np.swapaxes(found, 1, 2)
    assert_allclose(
        met / np.linalg.norm(met, axis=-1, keepdims=True),
        seen / np.linalg.norm(seen, axis=-1, keepdims=True),
        atol=1e-9,
    )


def test_moving_the_origin_of_the_pixels_moves_the_homography_with_it():
    pixels = pixels_of(K @ POSES, BOARD)
    points, weights = np.repeat(BOARD[None], 3, axis=0), np.ones((3, 54))
    shift = np.array([1000.0, -400.0])
    moved = homographies_to_pixels(points, pixels + shift, weights)
    assert_allclose(pixels_of(moved, BOARD), pixels + shift, atol=PIXEL)
