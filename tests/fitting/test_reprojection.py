"""The reprojection problem: its sums are those of the differences of its own residuals, for every lens and
every sort of view.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.laws import for_every_lens
from helpers.scenes import BOARD, NARROW, K, camera_with, seen, some_corners
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.models.parameters import Parameters
from orthoscope.solve.losses import Cauchy, Huber, Linear, Loss
from orthoscope.targets.detections import Detections

OF_K = ("fx", "fy", "cx", "cy", "skew")
OWN_FRAME = Intrinsics(500.0, 530.0, 340.0, 220.0, 3.0)


def boards() -> tuple[Pose, ...]:
    """Three boards near the axis, all corners in front and none straight ahead."""
    rotations = rotation_from_vector(np.array([[0.1, 0.5, -2.0], [0.3, -0.2, 0.1], [-0.4, 0.3, 1.0]]))
    middles = np.array([[-0.1, 0.04, 0.55], [0.01, 0.0, 0.5], [0.1, 0.05, 0.6]])
    return tuple(
        Pose(rotation, middle - rotation @ BOARD.points.mean(0))
        for rotation, middle in zip(rotations, middles, strict=True)
    )


def ragged() -> Detections:
    """4, 54 and 32 corners of these boards; where they were seen does not matter to a derivative."""
    few, whole, many = seen(NARROW, boards()).views
    size = NARROW.image_size
    few, many = (
        some_corners(Detections(BOARD, size, (view,)), (share, share)).views[0]
        for view, share in ((few, 0.0), (many, 0.6))
    )
    return Detections(BOARD, size, (few, whole, many))


POSES, RAGGED = boards(), ragged()


def stacked_differences(problem: Reprojection, at: Estimate) -> np.ndarray:
    """d residual / d (shared, pose of each row), by central differences along the problem's own moves (of all
    rows at once).
    """
    k, rows = len(problem.free), len(at.poses.rotation)
    columns = []
    for step in 1e-6 * np.eye(k + 6):
        ahead, back = (
            problem.residuals(problem.move(at, sign * step[:k], np.tile(sign * step[k:], (rows, 1)))).reshape(
                rows, -1
            )
            for sign in (1, -1)
        )
        columns.append((ahead - back) / 2e-6)
    shared, poses = np.split(np.moveaxis(np.array(columns), 0, -1), [k], axis=-1)
    own = np.zeros((rows, poses.shape[1], rows, 6))
    own[np.arange(rows), :, np.arange(rows)] = poses
    return np.concatenate([shared, own.reshape(rows, -1, 6 * rows)], axis=-1).reshape(-1, k + 6 * rows)


def assert_sums_agree(camera: Camera, free: tuple[str, ...]) -> None:
    """A, a, B, C, c and the cost are those of the differences, each relative to the lengths of its
    columns.
    """
    observations = Observations.of(RAGGED)
    problem = Reprojection(observations, BOARD.points, camera, free)
    at, k, m = Estimate(camera, observations.poses_of(POSES)), len(free), len(POSES)
    sums, e, J = (
        problem.linearise(at, Linear()),
        problem.residuals(at).ravel(),
        stacked_differences(problem, at),
    )
    full = np.zeros((k + 6 * m, k + 6 * m))
    full[:k, :k] = sums.A
    for j in range(m):
        own = slice(k + 6 * j, k + 6 * j + 6)
        full[:k, own], full[own, :k], full[own, own] = sums.B[j], sums.B[j].T, sums.C[j]
    gradient = np.concatenate([sums.a, sums.c.ravel()])
    size = np.maximum(1.0, np.sqrt((J * J).sum(0)))  # at w = 0 nothing moves with fov's w
    # differences over 1e-6: rounding of pixels, 1e-13 / 1e-6, against columns of length 1 and more;
    # third derivatives times 1e-12
    assert_allclose(full / np.outer(size, size), J.T @ J / np.outer(size, size), atol=1e-6)
    assert_allclose(gradient / size, J.T @ e / size, atol=1e-6 * float(np.sqrt(e @ e)))
    assert_allclose(sums.cost, e @ e, rtol=1e-12)


@for_every_lens
def test_every_lens_has_the_derivatives_of_its_residuals(lens):
    assert_sums_agree(camera_with(lens, Intrinsics(520.0, 540.0, 325.0, 236.0, 12.0)), (*OF_K, *lens.names()))


@pytest.mark.parametrize(
    "lens", [Brown(k1=-0.2, p1=1e-3), KannalaBrandt(k1=-0.02)], ids=["of the plane", "of the angle"]
)
@pytest.mark.parametrize("free", [(), ("skew",), OF_K, ("k2", "cx")], ids=" ".join)
def test_any_choice_of_free_parameters_has_them_too(lens, free):
    assert_sums_agree(camera_with(lens), free)


@for_every_lens
def test_a_lens_with_a_frame_of_its_own_has_them_too(lens):
    assert_sums_agree(Camera((640, 480), K, lens, OWN_FRAME), lens.names())


@pytest.mark.parametrize(
    "lens", [Brown(k1=-0.2, p1=1e-3), KannalaBrandt(k1=-0.02)], ids=["of the plane", "of the angle"]
)
@pytest.mark.parametrize(
    "free",
    [
        ("fx", "fy", "cx", "cy", "skew"),
        ("centre_x", "centre_y", "frame_fx", "frame_fy"),
        ("fx=frame_scale", "fy", "k1", "centre_y"),
    ],
    ids=" ".join,
)
def test_its_pin_hole_and_its_frame_move_its_pixels(lens, free):
    assert_sums_agree(Camera((640, 480), K, lens, OWN_FRAME), free)


@pytest.mark.parametrize(
    "free", [("fx=fy",), ("fx=fy", "cx", "k1=k2"), ("cy", "k2", "fy=fx"), ("k1=k2=k3", "p1=p2")], ids=" ".join
)
def test_tied_parameters_move_together(free):
    assert_sums_agree(NARROW, free)


def test_rays_past_90_degrees_have_derivatives():
    camera = camera_with(KannalaBrandt(k1=-0.02, k2=0.003), Intrinsics(150.0, 150.0, 320.0, 240.0))
    behind = Pose(rotation_from_vector(np.array([0.0, 1.8, 0.0])), np.array([0.2, 0.0, -0.05]))
    assert (behind.apply(BOARD.points)[:, 2] < 0).any()
    observations = Observations.of(seen(camera, [behind]))
    problem = Reprojection(observations, BOARD.points, camera, ("fx", "k1"))
    at = Estimate(camera, observations.poses_of([behind]))
    sums, J = problem.linearise(at, Linear()), stacked_differences(problem, at)
    size = np.sqrt((J * J).sum(0))
    assert_allclose(
        sums.C[0] / np.outer(size[2:], size[2:]), (J.T @ J)[2:, 2:] / np.outer(size[2:], size[2:]), atol=1e-6
    )
    assert_allclose(
        sums.B[0] / np.outer(size[:2], size[2:]), (J.T @ J)[:2, 2:] / np.outer(size[:2], size[2:]), atol=1e-6
    )


@pytest.mark.parametrize("loss", [Cauchy(3.0), Huber(3.0)], ids=repr)
def test_the_gradient_of_a_robust_cost_is_that_of_its_differences(loss: Loss):
    free = (*OF_K, *Brown.free)
    observations = Observations.of(RAGGED)
    camera = Parameters.of(("cx", "fy")).moved(
        NARROW, np.array([2.0, 5.0])
    )  # residuals of a few pixels, on both sides of the scale
    problem = Reprojection(observations, BOARD.points, camera, free)
    at, k, m = Estimate(camera, observations.poses_of(POSES)), len(free), len(POSES)
    sums = problem.linearise(at, loss)
    assert_allclose(sums.cost, loss.cost((problem.residuals(at) ** 2).sum(-1)).sum(), rtol=1e-12)
    gradient, slopes = np.concatenate([sums.a, sums.c.ravel()]), []
    for i in range(k + 6 * m):
        step = np.zeros(k + 6 * m)
        step[i] = 1e-6
        plus, minus = (
            problem.linearise(problem.move(at, s * step[:k], s * step[k:].reshape(m, 6)), loss).cost
            for s in (1.0, -1.0)
        )
        slopes.append((plus - minus) / 2e-6)
    # the gradient of the sum of rho is twice the solver's a; a cost of 1e3 is rounded to 1e-13, and
    # that over 1e-6
    assert_allclose(2.0 * gradient, slopes, rtol=1e-5, atol=1e-3)


def test_padding_has_no_say():
    together = Observations.of(RAGGED)
    free = ("fx", "k1")

    def summed(some: Detections, poses) -> np.ndarray:
        observations = Observations.of(some)
        problem = Reprojection(observations, BOARD.points, NARROW, free)
        return problem.linearise(Estimate(NARROW, observations.poses_of(poses)), Cauchy(2.0)).A

    alone = sum(summed(RAGGED.only([i]), POSES[i : i + 1]) for i in range(3))
    assert together.present.min() == 0.0
    assert_allclose(summed(RAGGED, POSES), alone, rtol=1e-12)


def test_a_corner_without_image_makes_the_cost_nothing_finite():
    observations = Observations.of(seen(NARROW, POSES))
    behind = [Pose(np.eye(3), np.array([0.0, 0.0, -0.5]))] * 3
    problem = Reprojection(observations, BOARD.points, NARROW, ("fx",))
    assert not np.isfinite(problem.linearise(Estimate(NARROW, observations.poses_of(behind)), Linear()).cost)


@pytest.mark.parametrize(
    ("camera", "free", "message"),
    [
        (NARROW, ("fx", "k9"), "'k9' of this camera cannot be estimated; expected some of fx, fy"),
        (NARROW, ("fx=fy", "fy"), "'fy' is to be estimated more than once"),
        (
            NARROW,
            ("k1", "centre_x"),
            "'centre_x' of this camera cannot be estimated; expected some of fx",
        ),
    ],
)
def test_parameters_that_cannot_be_estimated_are_refused(camera, free, message):
    with pytest.raises(InputError, match=message):
        Reprojection(Observations.of(RAGGED), BOARD.points, camera, free)
