"""What a user types after `import orthoscope`: the names, what they print, and a newcomer's first script."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import orthoscope
from helpers.scenes import NARROW, camera_with, photographed
from orthoscope.methods import settings, settings_of
from orthoscope.models.lenses.table import LENSES, Brown
from orthoscope.simulation.render import rendered_photographs

SOURCE = Path(orthoscope.__file__).parent
LONGEST = 400  # characters of a repr: a few lines of a notebook


@pytest.fixture(scope="module")
def calibration():
    return orthoscope.calibrate(photographed(NARROW, noise_px=0.05), method="fccm", lens="brown")


def test_the_two_lists_of_public_names_agree():
    for_editors = {
        alias.name: node.module
        for block in ast.parse((SOURCE / "__init__.py").read_text()).body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    at_run_time = {name: f"orthoscope.{room}" for room, names in orthoscope.ROOMS.items() for name in names}
    assert for_editors == at_run_time


@pytest.mark.parametrize("name", orthoscope.__all__)
def test_every_public_name_is_there_and_says_what_it_is(name):
    thing = getattr(orthoscope, name)
    assert name in dir(orthoscope)
    assert name in ("LENSES", "METHODS", "FORMATS", "TARGETS", "__version__") or thing.__doc__


def test_a_name_that_is_not_there_is_told_with_those_that_are():
    with pytest.raises(AttributeError, match=r"has no 'calibate'; it has .*calibrate"):
        importlib.import_module("orthoscope").calibate  # noqa: B018


def test_what_is_printed_of_a_thing_is_a_few_lines(calibration):
    free = camera_with(Brown(k1=-0.2))
    for thing in (
        calibration,
        calibration.detections,
        calibration.camera,
        calibration.detections.target,
        free,
    ):
        assert 10 < len(repr(thing)) < LONGEST
    for thing in (calibration.uncertainty, calibration.target_shape, calibration.detections.views[0]):
        assert 10 < len(repr(thing)) < LONGEST


@pytest.mark.parametrize("lens", [kind() for kind in LENSES.values()], ids=list(LENSES))
def test_a_lens_prints_its_coefficients_as_it_would_be_made(lens):
    assert repr(lens).startswith(type(lens).__name__ + "(")
    assert "=0.0" not in repr(lens)


def test_one_point_is_projected_as_a_point_and_a_wrong_shape_is_named(calibration):
    camera = calibration.camera
    assert_allclose(camera.project([0.0, 0.0, 1.0]), camera.project(np.array([[0.0, 0.0, 1.0]]))[0], rtol=0)
    ray = camera.unproject(camera.project([0.1, -0.1, 1.0]))
    assert_allclose(ray, np.array([0.1, -0.1, 1.0]) / np.sqrt(1.02), atol=1e-12)
    with pytest.raises(orthoscope.InputError, match=r"points have shape \(2,\); expected \(n, 3\)"):
        camera.project([1.0, 2.0])
    with pytest.raises(orthoscope.InputError, match="pixels are not numbers"):
        camera.unproject(["left", "right"])


def test_matrix_and_distortion_are_a_line_each(calibration):
    K, distortion = calibration.camera.opencv()
    assert_allclose(K, calibration.camera.K, rtol=0)
    assert distortion.shape == (5,)
    with pytest.raises(orthoscope.InputError, match="OpenCV has no"):
        camera_with(LENSES["fov"]()).opencv()


@pytest.mark.parametrize("method", ["decoupled", "fccm", "mldc", "nmldc", "hartley_kang", "fitzgibbon"])
def test_editors_know_the_settings_that_a_method_has(method):
    told = getattr(settings, "".join(map(str.capitalize, method.split("_"))) + "Settings")
    assert list(told.__annotations__) == settings_of(method)


# What somebody writes on the first day, with `photographs`, a list of pictures, and `rig.yaml` of ROS.
FIRST_DAY = """
import numpy as np
import orthoscope

x, y = np.meshgrid(np.arange(7), np.arange(5))
points = 0.03 * np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
target = orthoscope.Target("my board", points, grid=(7, 5))
detections = orthoscope.detect(photographs, target)
calibration = orthoscope.calibrate(detections)
camera = calibration.camera
print(target, detections, calibration, camera, calibration.uncertainty)
print(orthoscope.evaluate(calibration))
print(camera.K)
print(camera.project([0, 0, 1]), camera.unproject([[160, 120]]))
exported = orthoscope.export(calibration, "camera.yml", "opencv")
K, dist = orthoscope.load_camera("camera.yml").opencv()
print(K, dist, *exported.remarks())
orthoscope.save(calibration, "calibration.json")
ros = orthoscope.load_camera("rig.yaml")
straight = orthoscope.undistort(photographs[0], ros)
"""


def test_the_script_of_the_first_day_runs(tmp_path, monkeypatch, capsys):
    board = orthoscope.chessboard(7, 5, 0.03)
    truth = orthoscope.Camera((320, 240), orthoscope.Intrinsics(260.0, 260.0, 161.0, 118.0), Brown(k1=-0.2))
    rng = np.random.default_rng(1)
    poses = orthoscope.random_views(truth, board, 6, rng=rng, fill=(0.5, 0.9))
    scene = orthoscope.Scene(truth, board, poses)
    monkeypatch.chdir(tmp_path)
    orthoscope.export(truth, "rig.yaml", "ros")
    found = {"photographs": [image for _, image in rendered_photographs(scene, rng=rng)]}
    exec(FIRST_DAY, found)
    told = capsys.readouterr().out
    assert len(told.splitlines()) < 40
    assert len(found["detections"].views) == 6
    assert_allclose(found["K"][[0, 1], [0, 1]], 260.0, rtol=0.02)
    assert found["dist"][0] < -0.1
    assert found["straight"].shape == (240, 320)
    assert_allclose(found["ros"].project([[0.1, 0.1, 1.0]]), truth.project([[0.1, 0.1, 1.0]]), atol=1e-9)
    assert orthoscope.load_calibration("calibration.json").camera.K.tolist() == found["camera"].K.tolist()
