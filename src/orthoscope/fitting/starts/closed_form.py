"""Closed forms that start a calibration: K from homographies (Zhang), poses from any camera.

B = K^-T K^-1 is the image of the absolute conic; each homography H = [h1 h2 h3] of the target's plane gives
h1' B h2 = 0 and h1' B h1 = h2' B h2. With few views B is narrowed, as the paper's section 3.1 and Zhang's 3.1
say: two views take skew = 0, one takes the principal point at the image's centre and fx = fy. Z. Zhang, A
flexible new technique for camera calibration, TPAMI 22(11), 2000.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.observations import Observations, Poses
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import nearest_rotation
from orthoscope.geometry.projective import homographies_to_rays
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics

__all__ = [
    "CENTRED",
    "CENTRED_SQUARE",
    "GENERAL",
    "NO_SKEW",
    "intrinsics_of_homographies",
    "poses_of_camera",
    "poses_of_homographies",
]

# The rows of a basis are B, written (B11, B12, B22, B13, B23, B33), of which every allowed one is a sum.

# Any B is allowed.
GENERAL = np.eye(6)
# The pixel axes are square to each other.
NO_SKEW = np.eye(6)[[0, 2, 3, 4, 5]]
# Besides, the principal point is the image's centre.
CENTRED = np.eye(6)[[0, 2, 5]]
# Besides, fx = fy.
CENTRED_SQUARE = np.array([[1.0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 0, 1]])


def intrinsics_of_homographies(
    homographies: Float[ndarray, "m 3 3"], image_size: tuple[int, int], basis: Float[ndarray, "b 6"]
) -> Intrinsics | None:
    """K from homographies to pixels; None where they belong to no real K (noise, distortion, parallel views).

    Args:
        homographies: from the target's plane to pixels, (m,3,3).
        image_size: (width, height) pixels.
        basis: which B are allowed, in pixels from the image's centre: GENERAL, NO_SKEW, CENTRED or
            CENTRED_SQUARE.
    """
    half = 0.5 * max(image_size)
    centre = 0.5 * (np.array(image_size) - 1.0)
    normal_from_pixels = np.array(
        [[1 / half, 0, -centre[0] / half], [0, 1 / half, -centre[1] / half], [0, 0, 1]]
    )
    h = normal_from_pixels @ homographies
    h = h / np.sqrt((h[:, :, :2] ** 2).sum((1, 2), keepdims=True))  # each view one vote
    rows = np.concatenate(
        [
            _conic_row(h[:, :, 0], h[:, :, 1]),
            _conic_row(h[:, :, 0], h[:, :, 0]) - _conic_row(h[:, :, 1], h[:, :, 1]),
        ]
    )
    b = np.linalg.svd(np.linalg.qr(rows @ basis.T, mode="r"))[2][-1] @ basis
    return _intrinsics_of_conic(b if b[0] > 0 else -b, half, centre)


def poses_of_camera(camera: Camera, observations: Observations, points: Float[ndarray, "p 3"]) -> Poses:
    """camera_from_target of every row, by the homography from the target's plane to the camera's rays.

    Any lens will do, past 90 degrees too. A corner without a ray has no say.

    Args:
        camera: gives the rays.
        observations: the views, a row each.
        points: of the target, (p,3) metres.
    Returns:
        The poses of the rows, NaN where a view has fewer than four rays.
    """
    m, n = observations.ids.shape
    rays = camera.unproject(observations.pixels().reshape(-1, 2)).reshape(m, n, 3)
    weights = observations.present * np.isfinite(rays[..., 0])
    H = homographies_to_rays(points[observations.ids, :2], np.nan_to_num(rays), weights)
    poses = poses_of_homographies(H)
    return Poses(poses.rotation, np.where(weights.sum(1)[:, None] < 4, np.nan, poses.translation))


def poses_of_homographies(homographies: Float[ndarray, "m 3 3"]) -> Poses:
    """camera_from_target of homographies from the target's plane to rays, known up to a positive factor.

    Source:
        Zhang's section 3.1.
    """
    H = homographies * (2.0 / np.sqrt((homographies[:, :, :2] ** 2).sum(1)).sum(1))[:, None, None]
    axes = np.concatenate([H[:, :, :2], np.cross(H[:, :, 0], H[:, :, 1])[:, :, None]], axis=2)
    return Poses(nearest_rotation(axes), H[:, :, 2])


def _conic_row(a: ndarray, b: ndarray) -> ndarray:
    """The coefficients of a' B b in (B11, B12, B22, B13, B23, B33)."""
    return np.stack(
        [
            a[:, 0] * b[:, 0],
            a[:, 0] * b[:, 1] + a[:, 1] * b[:, 0],
            a[:, 1] * b[:, 1],
            a[:, 2] * b[:, 0] + a[:, 0] * b[:, 2],
            a[:, 2] * b[:, 1] + a[:, 1] * b[:, 2],
            a[:, 2] * b[:, 2],
        ],
        axis=-1,
    )


def _intrinsics_of_conic(b: ndarray, half: float, centre: ndarray) -> Intrinsics | None:
    """K of B, back in pixels, or None where B belongs to no real K.

    Args:
        b: (B11, B12, B22, B13, B23, B33), in half image sides from the centre.
        half: of the image's longer side, pixels.
        centre: of the image, pixels.
    Source:
        Zhang's appendix B.
    """
    B11, B12, B22, B13, B23, B33 = b
    minor = B11 * B22 - B12**2
    if not (B11 > 0 and minor > 0):
        return None
    v0 = (B12 * B13 - B11 * B23) / minor
    scale = B33 - (B13**2 + v0 * (B12 * B13 - B11 * B23)) / B11
    if not scale > 0:
        return None
    alpha, beta = np.sqrt(scale / B11), np.sqrt(scale * B11 / minor)
    gamma = -B12 * alpha**2 * beta / scale
    u0 = gamma * v0 / beta - B13 * alpha**2 / scale
    return Intrinsics(half * alpha, half * beta, half * u0 + centre[0], half * v0 + centre[1], half * gamma)
