"""What the default method is told on the command line: which shape the target has, and for which tool the
camera is meant.
"""

from __future__ import annotations

import numpy as np
import pytest

from helpers.quick import first_quick
from orthoscope.formats.load import load_camera
from orthoscope.formats.own.json import load_calibration
from orthoscope.models.difference import image_difference
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.table import Brown, KannalaBrandt, Rational


@pytest.fixture
def calibrate(run, calibrated, tmp_path):
    """Runs `orthoscope calibrate` on the corners that were found before, into the folder that it gives back
    with what was told.
    """

    def runner(*arguments: str):
        out = tmp_path / "out"
        return (
            run(
                "calibrate",
                calibrated / "detections.json",
                *arguments,
                "--folds",
                "2",
                "--no-report",
                "-o",
                out,
            ),
            out,
        )

    return runner


@pytest.mark.parametrize("shape", first_quick(["free", "flat", "smooth"]))
def test_the_shape_that_is_asked_for_is_the_one_that_is_estimated(calibrate, shape):
    told, out = calibrate("--shape", shape, "--lens", "free")
    assert told.code == 0, told.err
    made = load_calibration(out / "calibration.json")
    assert made.settings["shape"] == made.target_shape.kind == shape
    assert isinstance(made.camera.lens, FreeLens)
    assert made.target_shape.displacements.any() == (shape != "flat")


def test_a_shape_that_is_none_is_refused(calibrate):
    told, out = calibrate("--shape", "wavy")
    assert told.code == 2
    assert "expected one of auto, flat, smooth, free" in told.err
    assert not (out / "calibration.json").exists()


def test_a_method_that_takes_the_target_as_flat_refuses_a_shape(calibrate):
    told, _ = calibrate("--shape", "free", "--method", "fccm")
    assert told.code == 2
    assert "method 'fccm' has no setting 'shape'" in told.err


@pytest.mark.slow
def test_for_a_tool_a_lens_that_it_has_is_chosen_and_written(calibrate):
    told, out = calibrate("--shape", "flat", "--export", "opencv")
    assert told.code == 0, told.err
    made, written = load_calibration(out / "calibration.json"), load_camera(out / "camera-opencv.yaml")
    assert isinstance(made.camera.lens, Brown | Rational | KannalaBrandt)
    assert type(written.lens) is type(made.camera.lens)
    assert written.lens.coefficients.tobytes() == made.camera.lens.coefficients.tobytes()
    assert {"brown", "kannala_brandt", "rational"} <= {
        candidate.lens.split()[0] for candidate in made.candidates
    }  # "from pairs"
    assert "camera-opencv.yaml" in told.out


@pytest.mark.slow
def test_of_a_free_lens_the_nearest_formula_is_written_for_the_tool(calibrate):
    told, out = calibrate("--shape", "flat", "--lens", "free", "--export", "opencv")
    assert told.code == 0, told.err
    made, written = load_calibration(out / "calibration.json"), load_camera(out / "camera-opencv.yaml")
    assert isinstance(made.camera.lens, FreeLens)
    apart = image_difference(
        made.camera, written, np.concatenate([view.pixels for view in made.detections.views])
    )
    assert np.hypot(*apart.T).mean() < 0.05  # the photographs were rendered with a brown lens


@pytest.mark.parametrize("method", ["decoupled", "fccm"])
def test_a_tool_that_is_not_known_is_refused_before_any_work(calibrate, method):
    told, out = calibrate("--export", "sketch", "--method", method)
    assert told.code == 2
    assert "no file for 'sketch' can be written; expected one of orthoscope, opencv, ros" in told.err
    assert not (out / "calibration.json").exists()


@pytest.mark.slow
def test_the_export_verb_says_what_a_formula_instead_of_the_free_lens_costs(run, calibrate, tmp_path):
    _, out = calibrate("--shape", "flat", "--lens", "free")
    told = run("export", out / "calibration.json", "--to", "ros", "-o", tmp_path / "camera.yaml")
    assert told.code == 0, told.err
    assert "since ros cannot hold this free lens: " in told.out
    assert "px apart on average where corners were seen" in told.out
    assert (tmp_path / "camera.yaml").exists()


@pytest.mark.slow
def test_of_a_formula_the_export_verb_has_nothing_to_say_but_what_it_wrote(run, calibrate, tmp_path):
    _, out = calibrate("--shape", "flat", "--lens", "brown")
    told = run("export", out / "calibration.json", "--to", "opencv", "-o", tmp_path / "camera.yaml")
    assert told.out == f"wrote      {tmp_path / 'camera.yaml'}\n"
    camera, written = load_calibration(out / "calibration.json").camera, load_camera(tmp_path / "camera.yaml")
    assert written.intrinsics.as_tuple() == camera.intrinsics.as_tuple()
    assert written.lens.coefficients.tobytes() == camera.lens.coefficients.tobytes()
