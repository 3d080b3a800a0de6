"""What the tools themselves read: their own code, where it is installed, sees the image that we see.

Debian's python3-mrcal and python3-camera-calibration-parsers serve the system's Python, pycolmap and
lensfunpy any; a test skips and says so where its tool is absent.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io
from numpy.testing import assert_allclose

from helpers.cameras import SIZE, camera_held, poses, some_pixels
from orthoscope.formats.export import export
from orthoscope.formats.load import load_camera
from orthoscope.formats.record import Contents
from orthoscope.formats.table import FORMATS

# Interpreters that may have a tool's own reader: the one that runs the tests, and the system's.
PYTHONS = [sys.executable, *filter(Path.exists, map(Path, ("/usr/bin/python3",)))]


# Runs a script again for each line of arguments, so that the tool is imported once.
AGAIN = """
import json, sys
code = compile(sys.argv[1], "reader", "exec")
for line in sys.stdin:
    sys.argv[1:] = json.loads(line)
    exec(code)
    print(flush=True)
"""


@cache
def python_with(module: str) -> str | None:
    """An interpreter that can import a module; None where there is none."""
    for python in PYTHONS:
        found = subprocess.run([python, "-c", f"import {module}"], capture_output=True, check=False)
        if found.returncode == 0:
            return python
    return None


class Readers:
    """Scripts under way, each in a Python that has its tool."""

    def __init__(self):
        self._processes: dict[str, subprocess.Popen[str]] = {}

    def __call__(self, module: str, script: str, *arguments: Path | str) -> list:
        """What a script prints as JSON, run where the module is; skips the test where it is nowhere."""
        python = python_with(module)
        if python is None:
            pytest.skip(f"no Python here has {module}; .ci/run installs it")
        if script not in self._processes:
            self._processes[script] = subprocess.Popen(
                [python, "-c", AGAIN, script],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        process = self._processes[script]
        process.stdin.write(json.dumps([str(argument) for argument in arguments]) + "\n")
        process.stdin.flush()
        said = []
        while (line := process.stdout.readline()) not in ("", "\n"):
            said.append(line)
        assert line, self._processes.pop(script).communicate()[1]
        return json.loads(said[-1])

    def close(self) -> None:
        for process in self._processes.values():
            process.communicate()


@pytest.fixture(scope="module")
def answer() -> Iterator[Readers]:
    readers = Readers()
    yield readers
    readers.close()


def rays_of(camera) -> np.ndarray:
    rays = camera.unproject(some_pixels())
    return rays[np.isfinite(rays).all(1)]


def holdings(tool: str):
    """One test for each lens that a tool's file is written with."""
    return pytest.mark.parametrize(
        "holding",
        [holding for holding in FORMATS[tool].holdings if holding.written],
        ids=lambda holding: f"{holding.word}({len(holding.coefficients)})",
    )


MRCAL = """
import json, sys, numpy as np, mrcal
model = mrcal.cameramodel(sys.argv[1])
rays = np.array(json.load(open(sys.argv[2])))
print(json.dumps([mrcal.project(rays, *model.intrinsics()).tolist(), list(map(int, model.imagersize()))]))
"""


@holdings("mrcal")
def test_mrcal_projects_as_we_do(tmp_path, holding, answer):
    camera = camera_held(FORMATS["mrcal"], holding)
    trusted = np.array([[10.0, 10.0], [600.0, 20.0], [300.0, 200.0], [20.0, 450.0], [610.0, 440.0]])
    export(Contents(camera, trusted=trusted), tmp_path / "a.cameramodel", "mrcal")
    (tmp_path / "rays.json").write_text(json.dumps(rays_of(camera).tolist()))
    pixels, size = answer("mrcal", MRCAL, tmp_path / "a.cameramodel", tmp_path / "rays.json")
    assert tuple(size) == SIZE
    assert_allclose(pixels, camera.project(rays_of(camera)), atol=1e-9)


ROS = """
import json, sys, camera_calibration_parsers as parsers
name, info = parsers.readCalibration(sys.argv[1])
print(json.dumps([info.width, info.height, info.distortion_model, list(info.D), list(info.K), list(info.P)]))
"""


@holdings("ros")
def test_ross_own_parser_reads_every_number(tmp_path, holding, answer):
    camera = camera_held(FORMATS["ros"], holding)
    export(camera, tmp_path / "a.yaml", "ros")
    width, height, model, D, K, P = answer("camera_calibration_parsers", ROS, tmp_path / "a.yaml")
    assert (width, height, model) == (*SIZE, holding.word)
    assert_allclose(D, holding.values(camera.lens), rtol=1e-15)
    assert_allclose(K, camera.K.ravel(), rtol=1e-15)
    assert_allclose(np.reshape(P, (3, 4))[:, :3], camera.K, rtol=1e-15)


PYCOLMAP = """
import json, sys, numpy as np, pycolmap
model = pycolmap.Reconstruction(sys.argv[1])
rays = np.array(json.load(open(sys.argv[2])))
camera = next(iter(model.cameras.values()))
pixels = np.array([camera.img_from_cam(ray) for ray in rays])
poses = {}
for image in model.images.values():
    pose = image.cam_from_world() if callable(image.cam_from_world) else image.cam_from_world
    poses[image.name] = pose.matrix().tolist()
print(json.dumps([pixels.tolist(), [camera.width, camera.height], poses]))
"""


@holdings("colmap")
@pytest.mark.parametrize("suffix", FORMATS["colmap"].suffixes)
def test_colmap_projects_as_we_do_and_has_our_poses(tmp_path, holding, suffix, answer):
    camera = camera_held(FORMATS["colmap"], holding)
    export(Contents(camera, poses()), tmp_path / f"cameras{suffix}", "colmap")
    rays = rays_of(camera)
    (tmp_path / "rays.json").write_text(json.dumps(rays.tolist()))
    pixels, size, found = answer("pycolmap", PYCOLMAP, tmp_path, tmp_path / "rays.json")
    assert tuple(size) == SIZE
    assert_allclose(np.array(pixels) - 0.5, camera.project(rays), atol=1e-9)
    assert set(found) == set(poses())
    for image, pose in poses().items():
        assert_allclose(found[image], np.hstack([pose.rotation, pose.translation[:, None]]), atol=1e-12)


LENSFUN = """
import json, sys, lensfunpy
lens = lensfunpy.Database(xml=open(sys.argv[1]).read(), load_common=False, load_bundled=False).lenses[0]
width, height = int(sys.argv[2]), int(sys.argv[3])
modifier = lensfunpy.Modifier(lens, lens.crop_factor, width, height)
modifier.initialize(lens.min_focal, 8.0, flags=lensfunpy.ModifyFlags.DISTORTION)
print(json.dumps(modifier.apply_geometry_distortion().reshape(height, width, 2)[::40, ::40].tolist()))
"""


@holdings("lensfun")
@pytest.mark.parametrize("aspect", ["", "3:2", "639:479"])
def test_lensfun_straightens_as_we_do(tmp_path, holding, aspect, answer):
    """Its places are rough by .02 px from one pixel to the next (fast square roots in single precision)."""
    path = tmp_path / "lens.xml"
    export(camera_held(FORMATS["lensfun"], holding), path, "lensfun")
    if aspect:
        text = re.sub(
            "<aspect-ratio>.*</aspect-ratio>", f"<aspect-ratio>{aspect}</aspect-ratio>", path.read_text()
        )
        path.write_text(text)
    camera = load_camera(path, image_size=SIZE)
    looked_at = np.array(answer("lensfunpy", LENSFUN, path, *map(str, SIZE)))
    u, v = np.meshgrid(np.arange(0.0, SIZE[0], 40.0), np.arange(0.0, SIZE[1], 40.0))
    straight = _focal_of_its_straight_image(path)
    rays = np.stack(
        [(u - camera.K[0, 2]) / straight, (v - camera.K[1, 2]) / straight, np.ones_like(u)], axis=-1
    )
    assert_allclose(looked_at.reshape(-1, 2), camera.project(rays.reshape(-1, 3)), atol=0.03)


def _focal_of_its_straight_image(path: Path) -> float:
    """The focal length in the file, mm of a frame of 36 mm by 24 mm, in pixels."""
    found = re.search('focal="([^"]*)"', path.read_text())
    assert found
    return float(found[1]) * np.hypot(*SIZE) / np.hypot(36.0, 24.0)


@holdings("opencv")
@pytest.mark.parametrize("suffix", [".yaml", ".xml", ".json"])
def test_opencv_projects_as_we_do_with_the_file_it_reads(tmp_path, holding, suffix):
    camera = camera_held(FORMATS["opencv"], holding)
    export(camera, tmp_path / f"a{suffix}", "opencv")
    storage = cv2.FileStorage(str(tmp_path / f"a{suffix}"), cv2.FILE_STORAGE_READ)
    matrix, coefficients = (
        storage.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients")
    )
    wide = int(storage.getNode("fisheye_model").real())
    assert (storage.getNode("image_width").real(), storage.getNode("image_height").real()) == SIZE
    project = cv2.fisheye.projectPoints if wide else cv2.projectPoints
    rays = rays_of(camera)
    expected, _ = project(rays[:, None], np.zeros(3), np.zeros(3), matrix, coefficients)
    assert_allclose(camera.project(rays), expected[:, 0], atol=1e-9)


def test_a_mat_file_is_read_by_scipy_with_matlabs_names(tmp_path):
    (holding,) = FORMATS["matlab"].holdings
    camera = camera_held(FORMATS["matlab"], holding)
    export(camera, tmp_path / "a.mat", "matlab")
    fields = scipy.io.loadmat(tmp_path / "a.mat", simplify_cells=True)["cameraParams"]
    assert_allclose(fields["K"][:2, 2], camera.K[:2, 2] + 1)
    assert_allclose(fields["IntrinsicMatrix"].T, fields["K"])
    assert fields["ImageSize"].tolist() == [SIZE[1], SIZE[0]]
    assert_allclose(
        [*fields["RadialDistortion"], *fields["TangentialDistortion"]], holding.values(camera.lens)
    )
    assert fields["WorldUnits"] == "m"


@pytest.mark.parametrize("compressed", [False, True])
def test_a_mat_file_of_another_writer_is_read(tmp_path, compressed):
    from orthoscope.formats.load import load_camera

    fields = {
        "RadialDistortion": np.array([[-0.2, 0.05]]),
        "TangentialDistortion": np.array([[1e-3, -1e-3]]),
        "ImageSize": np.array([[480, 640]], dtype=np.uint16),
        "IntrinsicMatrix": np.array([[500.0, 0.0, 0.0], [0.5, 501.0, 0.0], [321.0, 241.0, 1.0]]),
        "WorldUnits": "mm",
        "Inner": {"a": 1.0},
    }
    scipy.io.savemat(tmp_path / "a.mat", {"params": fields, "x": 3}, do_compression=compressed)
    camera = load_camera(tmp_path / "a.mat")
    assert camera.image_size == SIZE
    assert camera.intrinsics.as_tuple() == (500.0, 501.0, 320.0, 240.0, 0.5)
    assert (camera.lens.k1, camera.lens.p2) == (-0.2, -1e-3)
