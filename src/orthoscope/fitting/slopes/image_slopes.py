"""How a camera's image of given directions moves with the camera, its own motion fitted out.

A camera's orientation trades against the poses of its views, and so, for things as near as the target, does
its position: only what no motion of the camera undoes is an error of it.  With G the slopes of the pixels by
the camera's unknowns and M those by a motion (a turn w, and for things at a finite distance a shift t), the
motion that undoes most over the places where the camera was seen to work is fitted there, by least squares in
pixels, and taken from everywhere else too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.parameters import Parameters

__all__ = ["difference_of_images", "image_slopes", "motion_slopes"]

# Newton is given so many steps.
NEWTON_STEPS = 20
# A step that moves less, in radians and shares of the distance, is the last.
SETTLED_STEP = 1e-9


def image_slopes(
    camera: Camera, rays: Float[ndarray, "n 3"], names: Sequence[str]
) -> Float[ndarray, "n 2 d"]:
    """Slopes of the pixels of rays by named parameters of the camera, then by its displacement's coefficients
    along x and along y.

    Raises:
        InputError: a name that the camera does not have.
    """
    parameters = Parameters.of(names)
    parameters.check(camera)
    slopes = camera.linearise(rays.T, parameters).by_parameters().transpose(2, 1, 0)
    if not isinstance(camera.lens, FreeLens):
        return slopes
    splines = camera.lens.over.lattice.design(*camera.lens.base.warp(*camera.lens.chart.flatten(*rays.T)))
    plane = (camera.lens_frame or camera.intrinsics).matrix[:2, :2]
    of_splines = [plane[:, i][None, :, None] * splines[:, None] for i in (0, 1)]
    return np.concatenate([slopes, *of_splines], axis=2)


def motion_slopes(
    camera: Camera, rays: Float[ndarray, "n 3"], distance: float = np.inf
) -> Float[ndarray, "n 2 s"]:
    """Slopes of the pixels of what lies along unit rays by a motion of the camera: a turn, and a shift in
    units of the distance.

    Args:
        distance: of what is looked at; infinite by default, and then there is no shift (s = 3, else 6).
    """
    by_point = _by_point(camera, rays)
    by_turn = np.cross(rays[:, None], by_point)
    return by_turn if np.isinf(distance) else np.concatenate([by_turn, by_point], axis=2)


def difference_of_images(
    camera: Camera,
    other: Camera,
    rays: Float[ndarray, "n 3"],
    fitted: Float[ndarray, "s 3"],
    *,
    distance: float = np.inf,
) -> Float[ndarray, "n 2"]:
    """Where the other camera sees what this one sees along unit rays, less where this one does; pixels, NaN
    where either has no image.

    Args:
        rays: of the places that are asked for.
        fitted: rays over which the motion of the other camera is fitted that makes the two images most alike.
        distance: of what is looked at; the motion is a turn alone where it is infinite.
    """
    wanted = camera.project(fitted)
    turn, shift = np.eye(3), np.zeros(3)
    for _ in range(NEWTON_STEPS):
        moved = fitted @ turn.T + shift
        with np.errstate(invalid="ignore"):
            e = other.project(moved) - wanted
        known = np.isfinite(e).all(1)
        if known.sum() < 3:
            break
        directions = moved[known]
        by_point = _by_point(other, directions)
        columns = [np.cross(directions[:, None], by_point)]
        if np.isfinite(distance):
            columns.append(by_point)
        slopes = np.concatenate(columns, axis=2)
        step = -np.linalg.lstsq(slopes.reshape(-1, slopes.shape[2]), e[known].ravel(), rcond=None)[0]
        turn = rotation_from_vector(step[None, :3])[0] @ turn
        shift = rotation_from_vector(step[None, :3])[0] @ shift + (step[3:] if len(step) > 3 else 0.0)
        if np.abs(step).max() < SETTLED_STEP:
            break
    with np.errstate(invalid="ignore"):
        return other.project(rays @ turn.T + shift) - camera.project(rays)


def _by_point(camera: Camera, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2 3"]:
    """d pixel / d point."""
    return np.stack([np.stack(row, axis=-1) for row in camera.linearise(points.T).by_point], axis=1)
