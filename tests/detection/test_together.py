"""Several targets in the same photographs, each with its own pose: ids, names, files, and the camera."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.quick import first_quick
from helpers.scenes import side_by_side
from orthoscope.detection.detect import detect
from orthoscope.evaluation.evaluate import evaluate
from orthoscope.formats.own.json import load, save
from orthoscope.geometry.arrays import InputError
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.models.target_shape import polynomials, without_similarity
from orthoscope.report.page import report_page
from orthoscope.simulation.render import Renderer
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections, View, photograph_of, view_name
from orthoscope.targets.left_out import left_out
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

CAMERA = Camera((800, 600), Intrinsics(700.0, 698.0, 404.0, 296.0), Brown(k1=-0.2, k2=0.05))
RENDERER = Renderer(CAMERA)
APART = {
    "chessboard beside a ChArUco of the same corners": (
        "chessboard:6x5:25mm + charuco:7x6:25mm:18mm:DICT_5X5_100"
    ),
    "two ChArUco boards of one dictionary": (
        "charuco:6x5:30mm:22mm:DICT_4X4_50 + charuco:6x5:30mm:22mm:DICT_4X4_50:first=15"
    ),
    "two AprilGrids of one family": "aprilgrid:4x3:36mm:0.3 + aprilgrid:4x3:36mm:0.3:first=12",
    "chessboards and discs": ("chessboard:5x4:25mm + chessboard:6x5:25mm + circles:3x7:20mm:asymmetric"),
}


@pytest.mark.parametrize("name", first_quick(APART))
def test_each_of_several_targets_in_a_photograph_is_found_with_its_own_ids(name):
    target = parse_target(name)
    stands = side_by_side(CAMERA, target, 0.2)
    found = detect(RENDERER.photograph_of(stands, rng=np.random.default_rng(0)), target)
    assert [view.image for view in found.views] == [
        view_name("picture01", number) for number in range(len(target.members))
    ]
    for view, part, (member, pose) in zip(found.views, target.parts, stands, strict=True):
        ids = view.ids - part.start
        assert len(ids) >= 0.95 * len(member.points)
        truth = CAMERA.project(pose.apply(member.points))
        ways = [np.arange(len(truth)), *member.symmetries()]
        off = min(np.linalg.norm(truth[way[ids]] - view.pixels, axis=1).max() for way in ways)
        assert off < 1.0  # px, of discs the outline's centre


@pytest.mark.parametrize(
    "name",
    [
        "chessboard:9x6:25mm + chessboard:6x9:20mm",
        "charuco:6x5:30mm:22mm:DICT_4X4_50 + charuco:5x4:30mm:22mm:DICT_4X4_50",
        "aprilgrid:4x3:36mm:0.3 + aprilgrid:4x3:36mm:0.3:first=11",
    ],
)
def test_targets_that_could_be_taken_for_each_other_are_refused(name):
    with pytest.raises(InputError, match="cannot be told apart"):
        parse_target(name)


def test_corners_of_two_targets_are_not_one_view():
    target = parse_target("chessboard:9x6:25mm + chessboard:7x5:25mm")
    with pytest.raises(InputError, match="corners of several targets"):
        Detections(target, (640, 480), (View("a", np.array([53, 54]), np.zeros((2, 2))),))


@pytest.fixture(scope="module")
def simulated() -> Detections:
    """Corners with noise of two boards, each elsewhere in each of ten photographs."""
    target, rng = (
        parse_target("chessboard:8x5:30mm + charuco:7x8:25mm:18mm:DICT_5X5_100"),
        np.random.default_rng(1),
    )
    views = []
    for number, (member, part) in enumerate(zip(target.members, target.parts, strict=True)):
        poses = random_views(CAMERA, member, 10, rng=rng, fill=(0.4, 0.8))
        seen = simulate_detections(Scene(CAMERA, member, poses), noise_px=0.1, rng=rng)
        views += [View(view_name(f"{v.image}.png", number), v.ids + part.start, v.pixels) for v in seen.views]
    return Detections(target, CAMERA.image_size, tuple(sorted(views, key=lambda view: view.image)))


def off_by(camera: Camera) -> float:
    """The largest difference of focal lengths and principal point, px."""
    ours, truth = camera.intrinsics, CAMERA.intrinsics
    return max(abs(getattr(ours, name) - getattr(truth, name)) for name in ("fx", "fy", "cx", "cy"))


def test_full_calibration_finds_the_camera_from_several_targets(simulated, tmp_path):
    calibration = fccm(simulated, lens="brown:k1,k2")
    assert off_by(calibration.camera) < 3.0 * max(calibration.uncertainty.deviations.values())
    assert calibration.rms_px == pytest.approx(0.1 * np.sqrt(2.0), rel=0.1)
    save(calibration, tmp_path / "calibration.json")
    again = load(tmp_path / "calibration.json")
    assert again.detections.target.parts == simulated.target.parts
    assert_array_equal(again.detections.target.points, simulated.target.points)
    assert_allclose(np.concatenate(again.residuals()), np.concatenate(calibration.residuals()))
    assert json.loads((tmp_path / "calibration.json").read_text())["detections"]["target"]["members"]


@pytest.mark.slow
def test_the_default_method_estimates_the_shape_of_each_target(simulated):
    """The second board is curled by two millimetres, the first is flat; only their poses tie them."""
    part = simulated.target.parts[1]
    points = simulated.target.points
    flat = fccm(simulated, lens="brown:k1,k2")
    x = points[part, 0] - points[part, 0].mean()
    bent = points.copy()
    bent[part, 2] = 2e-3 * (x / np.abs(x).max()) ** 2
    views = tuple(
        View(
            view.image,
            view.ids,
            view.pixels
            + CAMERA.project(pose.apply(bent[view.ids]))
            - CAMERA.project(pose.apply(points[view.ids])),
        )
        for view, pose in zip(simulated.views, flat.camera_from_target, strict=True)
    )
    curled = Detections(simulated.target, simulated.image_size, views)
    calibration = decoupled(curled, base="brown", first_lens="formula", shape="smooth")
    shape = calibration.target_shape.displacements
    assert np.ptp(shape[part, 2]) == pytest.approx(2e-3, rel=0.15)
    assert np.ptp(shape[simulated.target.parts[0], 2]) < 2e-4
    assert off_by(calibration.camera) < 2.0
    page = report_page(evaluate(calibration, folds=2))
    assert "chessboard:8x5:30mm" in page


def test_without_a_photograph_all_its_targets_are_left_out(simulated):
    fewer = left_out(simulated, ["view03.png"])
    assert len(fewer.views) == len(simulated.views) - 2
    assert {photograph_of(entry.image) for entry in fewer.set_aside} == {"view03.png"}


def test_shapes_have_no_similarity_of_either_target_and_no_pattern_over_both(simulated):
    target = simulated.target
    seen, rng = np.ones(len(target.points), dtype=bool), np.random.default_rng(0)
    patterns = polynomials(target.points, seen, parts=target.parts)
    for one, other in pairwise(target.parts):
        assert not (patterns[one].any(0) & patterns[other].any(0)).any()
    moved = target.points + rng.normal(0.0, 1e-4, target.points.shape)
    moved[target.parts[0]] = 1.01 * moved[target.parts[0]] + [0.1, 0.0, 0.0]
    settled = without_similarity(target.points, moved - target.points, seen, parts=target.parts)
    assert np.abs(settled).max() < 1e-3
    for part in target.parts:
        assert_allclose(settled[part].mean(0), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "spec", ["chessboard:6x5:25mm", "charuco:6x5:30mm:22mm:DICT_4X4_50", "aruco:4x3:40mm:10mm:DICT_4X4_50"]
)
def test_of_two_boards_alike_the_choice_is_said(spec, tmp_path):
    board = parse_target(spec)
    one, other = side_by_side(CAMERA, Target("twice", board.points, members=(board, board)), 0.1)
    found = detect(RENDERER.photograph_of([one, other], rng=np.random.default_rng(0)), board)
    assert len(found.views[0].ids) == len(board.points)
    ((image, words),) = found.remarks
    assert image == "picture01"
    assert "more than once" in words
    save(found, tmp_path / "d.json")
    assert load(tmp_path / "d.json").remarks == found.remarks
    assert not detect(RENDERER.photograph_of([one], rng=np.random.default_rng(0)), board).remarks
