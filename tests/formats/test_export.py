"""Cameras for other tools: what is written reads back as the same camera, and what cannot be exact is
refused.
"""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.laws import FREE_LENSES_TO_TRY, displaced
from orthoscope.formats.export import EXPORTERS, export, exportable, opencv_coefficients
from orthoscope.formats.opencv import read_opencv
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.models.camera import Camera, Intrinsics
from orthoscope.models.difference import frame_grid
from orthoscope.models.lenses import LENSES, Brown, Division, Fov, KannalaBrandt, Rational
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import chessboard

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
    again = read_opencv(tmp_path / "camera.yaml")
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
    for tool in EXPORTERS:
        text = written(Camera(SIZE, INTRINSICS, Brown(k1=1e-5)), tmp_path, tool)
        assert "1.0e-05" in text
        assert not re.search(r"[\[ ]-?\d+e", text)


REFUSED = {
    "a lens that opencv does not have": (
        "opencv",
        Division(l=-0.1),
        "it has brown, rational and kannala_brandt",
    ),
    "a prism for ros": ("ros", Brown(s1=0.01), "it has brown and rational without prism and tilt"),
    "a third radial term for kalibr": (
        "kalibr",
        MILD,
        r"it has brown with k1, k2, p1 and p2 only \(--lens brown:k1,k2,p1,p2\)",
    ),
    "a rational lens for kalibr": ("kalibr", Rational(k4=0.1), "it has brown with k1, k2, p1 and p2 only"),
}


@pytest.mark.parametrize(("tool", "lens", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_exact_is_refused_and_nothing_written(tmp_path, tool, lens, message):
    with pytest.raises(InputError, match=message):
        export(Camera(SIZE, INTRINSICS, lens), tmp_path / "camera.yaml", tool)
    assert not (tmp_path / "camera.yaml").exists()


@pytest.mark.parametrize("tool", EXPORTERS)
def test_a_skew_or_a_lens_frame_is_refused(tmp_path, tool):
    with pytest.raises(InputError, match=r"has no skew, and this camera's is 0\.5 px"):
        export(
            Camera(SIZE, Intrinsics(500.0, 500.0, 320.0, 240.0, 0.5), Brown()), tmp_path / "camera.yaml", tool
        )
    with pytest.raises(InputError, match="has no distortion centre of its own"):
        export(Camera(SIZE, INTRINSICS, Brown(), INTRINSICS), tmp_path / "camera.yaml", tool)


def test_a_tool_that_is_not_known_is_refused(tmp_path):
    with pytest.raises(
        InputError, match="no file for 'matlab' can be written; expected one of opencv, ros, kalibr"
    ):
        export(Camera(SIZE, INTRINSICS, Brown()), tmp_path / "camera.m", "matlab")


def test_each_tool_has_these_lenses(tmp_path):
    def takes(tool: str, name: str) -> bool:
        try:
            export(Camera(SIZE, INTRINSICS, LENSES[name]()), tmp_path / "camera.yaml", tool)
        except InputError:
            return False
        return True

    assert {tool: [name for name in LENSES if takes(tool, name)] for tool in EXPORTERS} == {
        "opencv": ["brown", "rational", "kannala_brandt"],
        "ros": ["brown", "rational", "kannala_brandt"],
        "kalibr": ["brown", "fov", "kannala_brandt"],
    }


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
    camera = read_opencv(tmp_path / "out.yml")
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
    assert isinstance(read_opencv(tmp_path / "out.yml").lens, KannalaBrandt)


def test_a_file_written_by_opencv_itself_is_read(tmp_path):
    storage = cv2.FileStorage(str(tmp_path / "camera.xml"), cv2.FILE_STORAGE_WRITE)
    storage.write("K", INTRINSICS.matrix)
    storage.write("D", np.array([[-0.1, 0.02, 0.001, -0.002]]))
    storage.release()
    camera = read_opencv(tmp_path / "camera.xml", image_size=SIZE)
    assert camera.image_size == SIZE
    assert isinstance(camera.lens, Brown)
    with pytest.raises(InputError, match=r"does not say how large its images are .* hand in image_size"):
        read_opencv(tmp_path / "camera.xml")


OPENCV_FAULTS = {
    "no yaml": ("hello: [", r"cannot be read by OpenCV"),
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
        read_opencv(tmp_path / "camera.yaml")


FREE = Camera(
    SIZE, Intrinsics(500.0, 501.25, 319.5, 240.0), displaced(Brown(k1=-0.2, k2=0.05), (0.7, 0.5), 0.001)
)


@pytest.mark.parametrize("tool", EXPORTERS)
def test_a_formula_is_handed_on_as_it_is(tool):
    camera = Camera(SIZE, INTRINSICS, MILD)
    known = exportable(camera, tool)
    assert known.camera is camera
    assert (known.apart_px, known.farthest_px) == (0.0, 0.0)


@pytest.mark.parametrize("tool", EXPORTERS)
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


def test_a_free_lens_itself_is_refused_and_nothing_written(tmp_path):
    for tool in EXPORTERS:
        with pytest.raises(InputError, match="cannot hold this free lens exactly"):
            export(FREE, tmp_path / "camera.yaml", tool)
    assert not (tmp_path / "camera.yaml").exists()


def test_with_the_calibration_the_nearest_is_the_one_where_corners_were_seen():
    board = chessboard(9, 6, 0.025)
    rng = np.random.default_rng(0)
    seen = simulate_detections(
        Scene(FREE, board, random_views(FREE, board, 8, rng=rng, fill=(0.3, 0.4))), noise_px=0.1, rng=rng
    )
    calibration = decoupled(seen, lens="free", target="flat")
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
        patch.setitem(EXPORTERS, "plain", EXPORTERS["ros"]._replace(lenses=("brown", "rational")))
        with pytest.raises(CalibrationError, match="none of brown, rational sees as far"):
            exportable(wide, "plain")


def test_a_tool_that_is_not_known_is_refused_for_a_free_lens_too():
    with pytest.raises(InputError, match="no file for 'matlab' can be written"):
        exportable(FREE, "matlab")
