"""Where OpenCV has the lens, both give the same pixels: cv2.projectPoints, cv2.fisheye.projectPoints,
cv2.initUndistortRectifyMap.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import Brown, KannalaBrandt, Rational

SIZE = (640, 480)
INTRINSICS = Intrinsics(500.0, 510.0, 310.0, 245.0)
EXACT = 1e-9  # px: the same formula in another order, 1e-16 times 500 px times its condition

LENSES_OF_OPENCV: dict[int, tuple[Lens, list[float]]] = {
    4: (Brown(k1=-0.2, k2=0.05, p1=1e-3, p2=-5e-4), [-0.2, 0.05, 1e-3, -5e-4]),
    5: (Brown(k1=-0.2, k2=0.05, p1=1e-3, p2=-5e-4, k3=-0.01), [-0.2, 0.05, 1e-3, -5e-4, -0.01]),
    8: (
        Rational(0.5, -0.1, 1e-3, -1e-3, 0.02, 0.8, 0.05, 0.01),
        [0.5, -0.1, 1e-3, -1e-3, 0.02, 0.8, 0.05, 0.01],
    ),
    12: (
        Rational(0.5, -0.1, 1e-3, -1e-3, 0.02, 0.8, 0.05, 0.01, 0.01, -0.02, 0.005, 0.003),
        [0.5, -0.1, 1e-3, -1e-3, 0.02, 0.8, 0.05, 0.01, 0.01, -0.02, 0.005, 0.003],
    ),
    14: (
        Rational(0.5, -0.1, 1e-3, -1e-3, 0.02, 0.8, 0.05, 0.01, 0.01, -0.02, 0.005, 0.003, 0.05, -0.08),
        [0.5, -0.1, 1e-3, -1e-3, 0.02, 0.8, 0.05, 0.01, 0.01, -0.02, 0.005, 0.003, 0.05, -0.08],
    ),
}
FOR_EVERY_LENGTH = pytest.mark.parametrize("count", LENSES_OF_OPENCV)


def points_in_front(angle: float) -> np.ndarray:
    """Points 1 to 3 m away, up to `angle` from the axis, the axis among them."""
    theta, phi = np.meshgrid(np.linspace(0.0, angle, 15), np.linspace(0.0, 2.0 * np.pi, 24))
    rays = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    ).reshape(-1, 3)
    return rays * np.linspace(1.0, 3.0, len(rays))[:, None]


@FOR_EVERY_LENGTH
def test_projection_is_that_of_opencv(count):
    lens, coefficients = LENSES_OF_OPENCV[count]
    points = points_in_front(0.7)
    expected, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), INTRINSICS.matrix, np.array(coefficients)
    )
    assert_allclose(Camera(SIZE, INTRINSICS, lens).project(points), expected[:, 0], atol=EXACT)


@pytest.mark.parametrize("extra", [4, 6], ids=["12 of brown", "14 of brown"])
def test_brown_is_opencvs_longer_list_without_k4_to_k6(extra):
    values = [-0.2, 0.05, 1e-3, -5e-4, -0.01, 0.01, -0.02, 0.005, 0.003, 0.05, -0.08][: 5 + extra]
    points = points_in_front(0.7)
    coefficients = np.array([*values[:5], 0.0, 0.0, 0.0, *values[5:]])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), INTRINSICS.matrix, coefficients)
    assert_allclose(Camera(SIZE, INTRINSICS, Brown(*values)).project(points), expected[:, 0], atol=EXACT)


def test_fisheye_projection_is_that_of_opencv():
    coefficients = [0.1, -0.03, 0.01, -0.001]
    points = points_in_front(1.5)
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), INTRINSICS.matrix, np.array(coefficients)
    )
    assert_allclose(
        Camera(SIZE, INTRINSICS, KannalaBrandt(*coefficients)).project(points), expected[:, 0], atol=EXACT
    )


@FOR_EVERY_LENGTH
def test_the_undistortion_map_is_that_of_opencv(count):
    lens, coefficients = LENSES_OF_OPENCV[count]
    straight = Intrinsics(520.0, 515.0, 300.0, 250.0)
    ours = Camera(SIZE, INTRINSICS, lens).undistort_map(straight)
    theirs = cv2.initUndistortRectifyMap(
        INTRINSICS.matrix, np.array(coefficients), None, straight.matrix, SIZE, cv2.CV_32FC1
    )
    seen = np.isfinite(ours[0])
    assert seen.mean() > 0.8
    for a, b in zip(ours, theirs, strict=True):
        assert_allclose(
            a[seen], b[seen], atol=1e-3
        )  # float32 at 640 px is 6e-5, and OpenCV may compute in it


def test_undistorted_pixels_are_those_of_opencv():
    lens, coefficients = LENSES_OF_OPENCV[5]
    pixels = np.stack(np.meshgrid(np.linspace(0, 639, 13), np.linspace(0, 479, 11)), axis=-1).reshape(-1, 2)
    undistort = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)  # OpenCV 5 has made one of the two
    matrix, criteria = INTRINSICS.matrix, (cv2.TERM_CRITERIA_COUNT, 100, 0.0)
    expected = undistort(
        pixels[:, None], matrix, np.array(coefficients), R=np.eye(3), P=matrix, criteria=criteria
    )[:, 0]
    assert_allclose(
        Camera(SIZE, INTRINSICS, lens).undistort_pixels(pixels), expected, atol=1e-6
    )  # OpenCV's iteration converges linearly
