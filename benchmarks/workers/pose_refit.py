"""Where a view's target was, the camera being fixed: one piece of code for every peer, so that nobody's own
refit flatters him.

Plain numpy, because it runs inside every peer's environment. Levenberg-Marquardt over six numbers, the
Jacobian by central differences through the peer's own `project`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

__all__ = ["refit_pose", "rotation_of"]

STEPS = 200
STEP_SIZE = 1e-6  # of the differences: radians, and shares of the distance
ENOUGH = 1e-14  # relative fall of the cost below which nothing more is to be had

Project = Callable[[np.ndarray], np.ndarray]


def refit_pose(
    project: Project, points: np.ndarray, pixels: np.ndarray, start: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Residuals (n,2), predicted minus detected, pixels, at the pose of least squares.

    project: points (n,3) of the camera frame to pixels. points: (n,3) of the target, as the peer believes
    them to be. start: rotation (3,3) and translation (3,), camera from target.
    """
    rotation, translation = (np.asarray(part, dtype=float) for part in start)
    damping, error = 1e-3, project(points @ rotation.T + translation) - pixels
    for _ in range(STEPS):
        slopes = _slopes(project, points @ rotation.T, translation)
        normal, gradient = slopes.T @ slopes, slopes.T @ error.ravel()
        cost = (error * error).sum()
        while damping < 1e12:
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -gradient)
            tried = rotation_of(step[:3]) @ rotation, translation + step[3:]
            tried_error = project(points @ tried[0].T + tried[1]) - pixels
            tried_cost = (tried_error * tried_error).sum()
            if tried_cost < cost:  # False for NaN too
                break
            damping *= 10.0
        else:
            return error
        (rotation, translation), error, damping = tried, tried_error, damping / 10.0
        if cost - tried_cost <= ENOUGH * cost:
            return error
    return error


def rotation_of(vector: np.ndarray) -> np.ndarray:
    """The rotation by |vector| radians about it (Rodrigues)."""
    angle = float(np.sqrt(vector @ vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-12:
        return np.eye(3) + cross
    return np.eye(3) + np.sin(angle) / angle * cross + (1.0 - np.cos(angle)) / angle**2 * cross @ cross


def _slopes(project: Project, turned: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """d pixels / d (rotation about the target's origin, translation), (2n,6)."""
    size = STEP_SIZE * np.repeat([1.0, float(np.sqrt(translation @ translation))], 3)
    columns = []
    for i in range(6):
        step = np.zeros(6)
        step[i] = size[i]
        ends = [
            project(turned @ rotation_of(sign * step[:3]).T + translation + sign * step[3:])
            for sign in (1.0, -1.0)
        ]
        columns.append((ends[0] - ends[1]).ravel() / (2.0 * size[i]))
    return np.stack(columns, axis=-1)
