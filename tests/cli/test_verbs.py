"""Each verb does its arrow of the flow, says what it did, and does it the same way twice."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from orthoscope.cli import verbs
from orthoscope.files.images import read_image
from orthoscope.formats.own.json import load, load_detections, load_own_camera
from orthoscope.models.difference import frame_grid, image_difference

TARGET = "chessboard:9x6:25mm"


@pytest.mark.parametrize("verb", sorted(verbs.commands))
def test_help_of_every_verb_shows_an_example(run, verb):
    told = run(verb, "--help")
    assert told.code == 0
    assert f"$ orthoscope {verb}" in told.out


def test_help_imports_nothing_heavy():
    heavy = ("numpy", "scipy", "cv2", "matplotlib", "msgspec", "jinja2", "tqdm")
    code = (
        "import sys; sys.argv = ['orthoscope', '--help']\nfrom orthoscope.cli import main\ntry:"
        " main()\nexcept SystemExit: pass\n"
    )
    code += f"sys.exit(', '.join(set({heavy}) & set(sys.modules)) or 0)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_calibrate_writes_what_it_says_and_finds_the_camera(calibrated, scene):
    assert {path.name for path in calibrated.iterdir()} == {
        "detections.json",
        "calibration.json",
        "evaluation.json",
        "report.html",
    }
    camera = load_own_camera(calibrated / "calibration.json")
    seen = np.concatenate([view.pixels for view in load_detections(calibrated / "detections.json").views])
    apart = np.hypot(*image_difference(scene.camera, camera, seen).T)
    assert apart.max() < 0.25  # ten photographs of 640x480 with 0.03 px of corner noise


@pytest.mark.slow
def test_calibrate_prints_a_summary_of_a_few_lines(run, photos, tmp_path):
    told = run("calibrate", photos, "--target", TARGET, "--no-report", "-o", tmp_path)
    assert told.code == 0
    lines = told.out.splitlines()
    assert [line.split()[0] for line in lines] == ["verdict", "camera", "photos", "wrote"]
    assert "10 used, 540 corners" in lines[2]


@pytest.mark.slow
def test_calibrate_json_is_one_object_with_the_promised_numbers(run, photos, tmp_path):
    told = run("calibrate", photos, "--target", TARGET, "--json", "--no-report", "-o", tmp_path)
    numbers = json.loads(told.out)
    assert (tmp_path / "evaluation.json").read_text() == told.out
    assert len(numbers["views"]) == 10
    assert sum(view["corners"] for view in numbers["views"]) == 540
    assert 0 < numbers["rms_px"] < numbers["held_out_rms_px"] < 0.1
    assert numbers["nce"] < 0.3
    assert numbers["camera"]["lens"]["name"] in (
        "brown",
        "free",
    )  # the renderer's lens is brown, and a free one foresees it as well


@pytest.mark.slow
def test_the_same_command_twice_gives_the_same_bytes(run, photos, tmp_path):
    for folder in ("a", "b"):
        assert run("calibrate", photos, "--target", TARGET, "--undistort", "-o", tmp_path / folder).code == 0
    first, second = (
        sorted(p for p in (tmp_path / folder).rglob("*") if p.is_file()) for folder in ("a", "b")
    )
    assert [p.relative_to(tmp_path / "a") for p in first] == [p.relative_to(tmp_path / "b") for p in second]
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(first, second, strict=True))
    assert len(first) == 4 + 10 + 2  # four files, ten straight pictures, their camera and their list


@pytest.mark.slow
def test_detect_then_calibrate_is_calibrate(run, photos, calibrated, tmp_path):
    assert run("detect", photos, "--target", TARGET, "-o", tmp_path / "detections.json").code == 0
    assert (
        run(
            "calibrate",
            tmp_path / "detections.json",
            "--lens",
            "brown",
            "--no-report",
            "-o",
            tmp_path / "out",
        ).code
        == 0
    )
    assert (tmp_path / "out/calibration.json").read_bytes() == (calibrated / "calibration.json").read_bytes()


@pytest.mark.slow
def test_calibrate_takes_a_corners_vnl_table(run, calibrated, tmp_path):
    rows = ["# filename x y level"]
    for view in load_detections(calibrated / "detections.json").views:
        rows += [f"{view.image} {x:.6f} {y:.6f} 0" for x, y in view.pixels[np.argsort(view.ids)]]
    (tmp_path / "corners.vnl").write_text("\n".join(rows) + "\n")
    told = run(
        "calibrate",
        tmp_path / "corners.vnl",
        "--target",
        TARGET,
        "--image-size",
        "640x480",
        "--json",
        "--no-report",
        "-o",
        tmp_path / "out",
    )
    assert sum(view["corners"] for view in json.loads(told.out)["views"]) == 540


@pytest.mark.slow
def test_evaluate_judges_a_calibration_and_other_photographs(run, photos, calibrated):
    own = json.loads(run("evaluate", calibrated / "calibration.json", "--json").out)
    other = json.loads(run("evaluate", calibrated / "calibration.json", "--on", photos, "--json").out)
    assert own["held_out_rms_px"] > own["rms_px"]
    assert other["rms_px"] == pytest.approx(
        own["rms_px"], rel=1e-3
    )  # the same photographs, poses fitted anew
    assert "verdict" in run("evaluate", calibrated / "calibration.json").out


@pytest.mark.slow
def test_report_writes_the_page_that_calibrate_writes(run, photos, calibrated, tmp_path):
    assert (
        run(
            "report", calibrated / "calibration.json", "--photos", photos, "-o", tmp_path / "report.html"
        ).code
        == 0
    )
    assert (tmp_path / "report.html").read_bytes() == (calibrated / "report.html").read_bytes()


def test_undistort_makes_pictures_in_which_the_board_is_straight(run, photos, calibrated, tmp_path):
    assert (
        run("undistort", calibrated / "calibration.json", photos, "--keep", "valid", "-o", tmp_path).code == 0
    )
    assert len(list(tmp_path.glob("view*.png"))) == 10
    assert (read_image(tmp_path / "view01.png", grey=True) > 0).all()  # `valid`: no black border
    again = run("detect", tmp_path, "--target", TARGET, "--json", "-o", tmp_path / "again.json")
    assert again.code == 0
    for view in load_detections(tmp_path / "again.json").views:
        row = view.pixels[np.argsort(view.ids)].reshape(6, 9, 2)[2]
        normal = np.linalg.svd(row - row.mean(0))[2][1]
        assert np.abs((row - row.mean(0)) @ normal).max() < 0.2  # px; bent by several before


def test_export_writes_what_opencv_reads(run, calibrated, tmp_path):
    assert (
        run("export", calibrated / "calibration.json", "--to", "opencv", "-o", tmp_path / "camera.yaml").code
        == 0
    )
    assert "camera_matrix" in (tmp_path / "camera.yaml").read_text()


@pytest.mark.slow
def test_simulate_makes_detections_from_which_its_camera_is_found_again(run, tmp_path):
    assert run("simulate", "--noise", "0", "--views", "12", "-o", tmp_path).code == 0
    told = run(
        "calibrate",
        tmp_path / "detections.json",
        "--lens",
        "brown",
        "--json",
        "--no-report",
        "-o",
        tmp_path / "out",
    )
    assert json.loads(told.out)["rms_px"] < 1e-9
    truth, found = (
        load_own_camera(tmp_path / "truth.json"),
        load_own_camera(tmp_path / "out/calibration.json"),
    )
    assert (
        np.abs(image_difference(truth, found, frame_grid(truth.image_size))).max() < 1e-6
    )  # no noise: only rounding


def test_simulate_takes_a_lens_a_size_and_views_of_the_users_choice(run, tmp_path):
    lens = ("--lens", "kannala_brandt:k1=-0.02", "--image-size", "800x600", "--focal", "300")
    told = run(
        "simulate",
        *lens,
        "--views",
        "9",
        "--fill",
        "0.3",
        "0.6",
        "--tilt-noise",
        "--partial",
        "--seed",
        "2",
        "-o",
        tmp_path,
    )
    assert told.code == 0, told.err
    truth, found = load(tmp_path / "truth.json"), load_detections(tmp_path / "detections.json")
    assert truth.camera.image_size == found.image_size == (800, 600)
    assert truth.camera.lens.k1 == -0.02
    assert len(truth.camera_from_target) == len(found.views) == 9
    for pose, view in zip(truth.camera_from_target, found.views, strict=True):
        seen = truth.camera.project(pose.apply(truth.target.points[view.ids]))
        assert np.abs(seen - view.pixels).max() < 1.0  # noise of 0.1 to 0.2 px a coordinate


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--lens", "brown:k1"), "brown:k1=-0.3"),
        (("--lens", "brown:k9=1"), "k9"),
        (("--focal", "500"), "--lens"),
        (("--lens", "brown", "--camera", "truth.json"), "one of them"),
    ],
)
def test_simulate_refuses_cameras_that_are_none(run, tmp_path, arguments, word):
    told = run("simulate", *arguments, "-o", tmp_path / "out")
    assert told.code == 2
    assert word in told.err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_demo_finds_the_camera_it_rendered_with(run, tmp_path):
    told = run("demo", "-o", tmp_path)
    assert told.code == 0, told.err
    assert "truth" in told.out
    assert (tmp_path / "report.html").stat().st_size > 100_000
    truth, found = load_own_camera(tmp_path / "truth.json"), load_own_camera(tmp_path / "calibration.json")
    assert np.nanmean(np.abs(image_difference(truth, found, frame_grid(truth.image_size)))) < 0.1


def test_a_photograph_left_out_by_name_stays_in_the_corners_and_out_of_the_camera(run, calibrated, tmp_path):
    found = ("calibrate", calibrated / "detections.json", "--method", "fccm", "--no-report", "-o", tmp_path)
    assert run(*found, "--without", "view02.png", "--without", "view05.png").code == 0
    assert len(load_detections(tmp_path / "detections.json").views) == 10
    used = load(tmp_path / "calibration.json").detections
    assert len(used.views) == 8
    assert [entry.image for entry in used.set_aside] == ["view02.png", "view05.png"]
    told = run(*found, "--without", "view99.png")
    assert told.code == 2
    assert "view01.png" in told.err
