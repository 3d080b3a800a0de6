"""A camera that must not be used is a verdict, and with --strict an exit code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orthoscope.cli.shared.exit_codes import DONE, NOT_TO_BE_USED
from orthoscope.formats.own.json import save
from orthoscope.simulation.scene import simulate_detections


@pytest.fixture(scope="module")
def calibrated(scene, tmp_path_factory):
    """A folder with corners of a sound camera, and of one photograph, which tells none."""
    folder = tmp_path_factory.mktemp("strict")
    corners = simulate_detections(scene, noise_px=0.05, rng=np.random.default_rng(0))
    save(corners, folder / "sound.json")
    save(replace(corners, views=corners.views[:1]), folder / "one.json")
    return folder


@pytest.mark.parametrize(("corners", "code"), [("sound", DONE), ("one", NOT_TO_BE_USED)])
def test_strict_leaves_with_its_own_code_where_a_camera_must_not_be_used(run, calibrated, corners, code):
    given = (calibrated / f"{corners}.json", "--method", "fccm", "--no-report")
    usual = run("calibrate", *given, "--out", calibrated / "usual")
    assert usual.code == DONE
    strict = run("calibrate", *given, "--strict", "--out", calibrated / "strict")
    assert strict.code == code
    assert strict.out.replace("/strict/", "/usual/") == usual.out  # all is written and said first
    assert (calibrated / "strict" / "evaluation.json").exists()
    assert run("evaluate", calibrated / "strict" / "calibration.json").code == DONE
    assert run("evaluate", calibrated / "strict" / "calibration.json", "--strict").code == code
    on_itself = run("evaluate", calibrated / "strict" / "calibration.json", "--on", given[0], "--strict")
    assert on_itself.code == DONE  # another question: nothing tells that these photographs are off
