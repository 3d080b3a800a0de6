"""Cameras for other tools: what is written reads back as the same camera, and what cannot be exact is fitted
and said.
"""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.laws import FREE_LENSES_TO_TRY, displaced
from orthoscope.formats.export import LIMIT_PX, export, exportable
from orthoscope.formats.load import load_camera
from orthoscope.formats.table import FORMATS
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.models.camera import Camera
from orthoscope.models.difference import frame_grid
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.opencv_order import opencv_coefficients
from orthoscope.models.lenses.table import Brown, Division, Fov, KannalaBrandt, Rational
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.target import chessboard

SIZE = (640, 480)
INTRINSICS = Intrinsics(500.0 + 1 / 3, 501.25, 319.5, 1e-5)
MILD = Brown(k1=-0.2, k2=1e-5, p1=1e-3, p2=-5e-4, k3=-1 / 7)

OPENCV_LENSES = {
    "5": MILD,
    "8": Rational(k1=0.5, k4=0.8),
    "8 of which none divides": Rational(k1=0.5),
    "12": Rational(k1=0.5, k4=0.8, s4=0.003),
    "12 of brown": Brown(k1=0.1, s1=0.01),
    "14": Rational(k1=0.5, k6=0.01, tau_y=0.02),
    "14 of brown": Brown(k1=0.1, tau_x=0.02),
    "fisheye": KannalaBrandt(1 / 3, -0.02, 1e-20, -0.001),
}
YAML_TOOLS = ("opencv", "ros", "kalibr")
FOR_EVERY_OPENCV_LENS = pytest.mark.parametrize("lens", OPENCV_LENSES.values(), ids=OPENCV_LENSES.keys())


def numbers(text: str, name: str) -> list[float]:
    """The numbers of a `name: [..]` or of the data below `name:`."""
    found = re.search(rf"^ *{name}:(?:[^\[]|\n)*?\[([^\]]*)\]", text, flags=re.MULTILINE)
    assert found
    return [float(number) for number in found[1].split(",")]


def written(camera: Camera, tmp_path, tool: str) -> str:
    export(camera, tmp_path / "camera.yaml", tool)
    return (tmp_path / "camera.yaml").read_text()


@FOR_EVERY_OPENCV_LENS
def test_a_camera_for_opencv_reads_back_to_the_last_bit(tmp_path, lens):
    written(Camera(SIZE, INTRINSICS, lens), tmp_path, "opencv")
    again = load_camera(tmp_path / "camera.yaml")
    assert (again.image_size, again.intrinsics.as_tuple()) == (SIZE, INTRINSICS.as_tuple())
    assert type(again.lens) is type(lens)
    assert_array_equal(again.lens.coefficients, lens.coefficients)


@FOR_EVERY_OPENCV_LENS
def test_opencv_projects_as_we_do_with_the_file_it_reads(tmp_path, lens):
    camera = Camera(SIZE, INTRINSICS, lens)
    written(camera, tmp_path, "opencv")
    storage = cv2.FileStorage(str(tmp_path / "camera.yaml"), cv2.FILE_STORAGE_READ)
    matrix, coefficients = (
        storage.getNode("camera_matrix").mat(),
        storage.getNode("distortion_coefficients").mat(),
    )
    points = np.array([[0.1, -0.2, 1.0], [0.4, 0.3, 1.5], [0.0, 0.0, 1.0]])
    project = cv2.fisheye.projectPoints if isinstance(lens, KannalaBrandt) else cv2.projectPoints
    expected, _ = project(points[:, None], np.zeros(3), np.zeros(3), matrix, coefficients)
    assert_allclose(
        camera.project(points), expected[:, 0], atol=1e-9
    )  # px; the same formula in another order


def test_ros_is_written_with_its_names(tmp_path):
    text = written(Camera(SIZE, INTRINSICS, MILD), tmp_path, "ros")
    assert "image_width: 640\nimage_height: 480\n" in text
    assert "distortion_model: plumb_bob\n" in text
    assert numbers(text, "distortion_coefficients") == [-0.2, 1e-5, 1e-3, -5e-4, -1 / 7]
    assert numbers(text, "camera_matrix") == INTRINSICS.matrix.ravel().tolist()
    assert numbers(text, "rectification_matrix") == np.eye(3).ravel().tolist()
    assert (
        numbers(text, "projection_matrix")
        == np.hstack([INTRINSICS.matrix, np.zeros((3, 1))]).ravel().tolist()
    )


@pytest.mark.parametrize(
    ("lens", "model", "count"),
    [(Rational(k4=0.1), "rational_polynomial", 8), (KannalaBrandt(0.1), "equidistant", 4)],
)
def test_ros_has_more_lenses(tmp_path, lens, model, count):
    text = written(Camera(SIZE, INTRINSICS, lens), tmp_path, "ros")
    assert f"distortion_model: {model}\n" in text
    assert len(numbers(text, "distortion_coefficients")) == count


@pytest.mark.parametrize(
    ("lens", "model", "coefficients"),
    [
        (Brown(k1=-0.2, k2=0.05, p1=1e-3, p2=-5e-4), "radtan", [-0.2, 0.05, 1e-3, -5e-4]),
        (KannalaBrandt(0.1, -0.02, 0.003, -0.001), "equidistant", [0.1, -0.02, 0.003, -0.001]),
        (Fov(w=0.9), "fov", [0.9]),
    ],
)
def test_kalibr_is_written_with_its_names(tmp_path, lens, model, coefficients):
    text = written(Camera(SIZE, INTRINSICS, lens), tmp_path, "kalibr")
    assert text.startswith("cam0:\n")
    assert f"  distortion_model: {model}\n" in text
    assert numbers(text, "distortion_coeffs") == coefficients
    assert numbers(text, "intrinsics") == list(INTRINSICS.as_tuple()[:4])
    assert numbers(text, "resolution") == [640, 480]


def test_a_number_in_yaml_has_a_point(tmp_path):
    # to YAML 1.1, 1e-05 is a string
    for tool in YAML_TOOLS:
        text = written(Camera(SIZE, INTRINSICS, Brown(k1=1e-5)), tmp_path, tool)
        assert "1.0e-05" in text
        assert not re.search(r"[\[ ]-?\d+e", text)


FITTED = {
    "a lens that opencv does not have": ("opencv", Division(l=-0.1), "this division lens"),
    "a prism for ros": ("ros", Brown(s1=0.01), "all coefficients of this brown lens"),
    "a third radial term for kalibr": ("kalibr", MILD, "all coefficients of this brown lens"),
    "a rational lens for kalibr": ("kalibr", Rational(k4=0.1), "this rational lens"),
}


@pytest.mark.parametrize(("tool", "lens", "lacks"), FITTED.values(), ids=FITTED.keys())
def test_what_cannot_be_exact_is_the_nearest_and_said(tmp_path, tool, lens, lacks):
    camera = Camera(SIZE, Intrinsics(500.0, 501.25, 319.5, 240.0), lens)
    exported = export(camera, tmp_path / "camera.yaml", tool)
    assert f"since {tool} cannot hold {lacks}: " in exported.remarks()[0]
    again = load_camera(tmp_path / "camera.yaml")
    rays = camera.unproject(frame_grid(SIZE))
    rays = rays[np.isfinite(rays).all(1)]
    apart = np.hypot(*(again.project(rays) - camera.project(rays)).T)
    assert_allclose(
        (exported.held.apart_px, exported.held.farthest_px), (apart.mean(), apart.max()), rtol=1e-6
    )


def test_what_is_too_far_is_refused_and_nothing_written_unless_one_insists(tmp_path):
    strong = Camera(SIZE, Intrinsics(300.0, 300.0, 319.5, 240.0), Brown(k1=-0.05, s1=0.1, s3=0.05))
    with pytest.raises(
        InputError, match=r"is [\d.]+ px away on average over the frame .* insist \(--anyway\)"
    ):
        export(strong, tmp_path / "camera.yaml", "kalibr")
    assert not (tmp_path / "camera.yaml").exists()
    assert export(strong, tmp_path / "camera.yaml", "kalibr", anyway=True).held.apart_px > LIMIT_PX
    assert (tmp_path / "camera.yaml").exists()


def test_a_distortion_centre_of_its_own_is_fitted_away_and_said(tmp_path):
    camera = Camera(
        SIZE, Intrinsics(500.0, 500.0, 320.0, 240.0), Brown(k1=-0.1), Intrinsics(500.0, 500.0, 325.0, 240.0)
    )
    exported = export(camera, tmp_path / "camera.yaml", "opencv")
    assert "a distortion centre of its own" in exported.remarks()[0]
    assert exported.held.apart_px < 0.3  # decentering does most of what another centre does


def test_a_tool_that_is_not_known_is_refused(tmp_path):
    with pytest.raises(
        InputError, match="no file for 'sketch' can be written; expected one of orthoscope, opencv, ros"
    ):
        export(Camera(SIZE, INTRINSICS, Brown()), tmp_path / "camera.m", "sketch")


def test_coefficients_are_as_few_as_hold_them_all():
    assert opencv_coefficients(Brown()) == [0.0] * 5
    assert len(opencv_coefficients(Rational())) == 8
    assert opencv_coefficients(Brown(k3=0.1, s2=0.2)) == [0.0] * 4 + [0.1] + [0.0] * 4 + [0.2, 0.0, 0.0]
    assert len(opencv_coefficients(Brown(tau_x=0.1))) == 14


SAMPLE = """%YAML:1.0
---
image_Width: 320
image_Height: 240
Camera_Matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 250., 0., 160., 0., 251., 120., 0., 0., 1. ]
Distortion_Coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.1, 0.02, 0.001, -0.002, 0.003 ]
"""


def test_older_names_of_opencvs_sample_are_read(tmp_path):
    (tmp_path / "out.yml").write_text(SAMPLE)
    camera = load_camera(tmp_path / "out.yml")
    assert camera.image_size == (320, 240)
    assert camera.intrinsics.as_tuple() == (250.0, 251.0, 160.0, 120.0, 0.0)
    assert camera.lens.coefficients[:5].tolist() == [-0.1, 0.02, 0.001, -0.002, 0.003]


def test_the_fisheye_flag_of_opencvs_sample_is_understood(tmp_path):
    text = (
        SAMPLE.replace("---\n", "---\nfisheye_model: 1\n")
        .replace("rows: 5", "rows: 4")
        .replace(", 0.003 ]", " ]")
    )
    (tmp_path / "out.yml").write_text(text)
    assert isinstance(load_camera(tmp_path / "out.yml").lens, KannalaBrandt)


def test_a_file_written_by_opencv_itself_is_read(tmp_path):
    storage = cv2.FileStorage(str(tmp_path / "camera.xml"), cv2.FILE_STORAGE_WRITE)
    storage.write("K", INTRINSICS.matrix)
    storage.write("D", np.array([[-0.1, 0.02, 0.001, -0.002]]))
    storage.release()
    camera = load_camera(tmp_path / "camera.xml", image_size=SIZE)
    assert camera.image_size == SIZE
    assert isinstance(camera.lens, Brown)
    with pytest.raises(InputError, match=r"does not say how large its images are .* Hand in image_size"):
        load_camera(tmp_path / "camera.xml")


OPENCV_FAULTS = {
    "no yaml": ("%YAML:1.0\n---\nhello: [", r"cannot be read; expected YAML, XML or JSON"),
    "no matrix": ("%YAML:1.0\n---\na: 1\n", r"has no 3x3 matrix named camera_matrix"),
    "a skew": (SAMPLE.replace("[ 250., 0.,", "[ 250., 0.5,"), r"has a skew of 0.5 px"),
    "six coefficients": (
        SAMPLE.replace("rows: 5", "rows: 6").replace("0.003 ]", "0.003, 0. ]"),
        r"has 6 distortion coefficients",
    ),
}


@pytest.mark.parametrize(("text", "message"), OPENCV_FAULTS.values(), ids=OPENCV_FAULTS.keys())
def test_a_file_that_is_none_of_opencvs_is_refused(tmp_path, text, message):
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(InputError, match=message):
        load_camera(tmp_path / "camera.yaml")


FREE = Camera(
    SIZE, Intrinsics(500.0, 501.25, 319.5, 240.0), displaced(Brown(k1=-0.2, k2=0.05), (0.7, 0.5), 0.001)
)


@pytest.mark.parametrize("tool", YAML_TOOLS)
def test_a_formula_is_handed_on_as_it_is(tool):
    camera = Camera(SIZE, INTRINSICS, Brown(k1=-0.2, p2=1e-3))
    known = exportable(camera, tool)
    assert known.camera is camera
    assert (known.apart_px, known.farthest_px) == (0.0, 0.0)


@pytest.mark.parametrize("tool", YAML_TOOLS)
def test_of_a_free_lens_the_nearest_formula_is_handed_on_with_what_it_costs(tmp_path, tool):
    known = exportable(FREE, tool)
    export(known.camera, tmp_path / "camera.yaml", tool)  # which the free lens itself cannot be
    rays = FREE.unproject(frame_grid(SIZE))
    apart = np.hypot(*(known.camera.project(rays) - FREE.project(rays)).T)
    assert_allclose((known.apart_px, known.farthest_px), (apart.mean(), apart.max()), rtol=1e-9)
    assert known.where == "over the frame"
    assert 0.0 < known.apart_px < known.farthest_px < 2.0  # displacements of half a pixel


def test_a_free_lens_without_displacement_costs_nothing():
    known = exportable(
        Camera(SIZE, FREE.intrinsics, FREE_LENSES_TO_TRY["free without displacement"]), "opencv"
    )
    assert isinstance(known.camera.lens, Brown)
    assert known.farthest_px < 1e-6


def test_with_the_calibration_the_nearest_is_the_one_where_corners_were_seen():
    board = chessboard(9, 6, 0.025)
    rng = np.random.default_rng(0)
    seen = simulate_detections(
        Scene(FREE, board, random_views(FREE, board, 8, rng=rng, fill=(0.3, 0.4))), noise_px=0.1, rng=rng
    )
    calibration = decoupled(seen, lens="free", shape="flat")
    near, everywhere = (
        exportable(calibration.camera, "opencv", made_from=calibration),
        exportable(calibration.camera, "opencv"),
    )
    assert (near.where, everywhere.where) == ("where corners were seen", "over the frame")
    rays = calibration.camera.unproject(np.concatenate([view.pixels for view in seen.views]))
    wanted = calibration.camera.project(rays)
    apart = [np.hypot(*(known.camera.project(rays) - wanted).T) for known in (near, everywhere)]
    assert_allclose((near.apart_px, near.farthest_px), (apart[0].mean(), apart[0].max()), rtol=1e-9)
    assert (apart[0] ** 2).sum() <= (apart[1] ** 2).sum()


def test_where_no_formula_of_the_tool_sees_so_far_there_is_no_camera_for_it():
    wide = Camera(SIZE, Intrinsics(150.0, 150.0, 320.0, 240.0), displaced(KannalaBrandt(), (2.2, 1.7), 0.002))
    assert isinstance(exportable(wide, "ros").camera.lens, KannalaBrandt)
    with pytest.MonkeyPatch.context() as patch:
        plain = replace(FORMATS["ros"], holdings=FORMATS["ros"].holdings[:2])
        patch.setitem(FORMATS, "plain", plain)
        with pytest.raises(CalibrationError, match="none of brown, rational sees as far"):
            exportable(wide, "plain")


def test_a_tool_that_is_not_known_is_refused_for_a_free_lens_too():
    with pytest.raises(InputError, match="no file for 'sketch' can be written"):
        exportable(FREE, "sketch")
