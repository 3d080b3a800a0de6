"""Pictures that once lost something: 16 bits, grey, alpha, EXIF; tried where the cases are at hand."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from orthoscope.formats.load import load_camera
from orthoscope.straight.undistort import undistort_photographs

ROOT = Path(__file__).resolve().parents[2]
CASES = (ROOT / os.environ.get("ORTHOSCOPE_DATASETS", "../shared/datasets")).parent / "cases"
NAMES = ("a16.png", "b16.png", "grey.png", "rgba.png", "exif.jpg")


@pytest.fixture(scope="module")
def straightened(tmp_path_factory):
    if not CASES.is_dir():
        pytest.skip(f"no cases at {CASES}")
    folder = tmp_path_factory.mktemp("straight")
    camera = load_camera(CASES / "made/camera-of-pictures.json")
    written, failed = undistort_photographs([CASES / "pictures" / name for name in NAMES], camera, folder)
    assert failed == []
    return {path.name: path for path in written}


@pytest.mark.parametrize("name", NAMES)
def test_depth_channels_brightness_and_exif_are_those_of_the_photograph(straightened, name):
    given, made = (
        cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        for path in (CASES / "pictures" / name, straightened[name])
    )
    assert made.dtype == given.dtype
    assert made.shape == given.shape
    middle = (slice(120, 360), slice(160, 480))
    assert made[middle].mean() == pytest.approx(given[middle].mean(), rel=0.05)
    with Image.open(straightened[name]) as straight, Image.open(CASES / "pictures" / name) as photograph:
        assert dict(straight.getexif()) == dict(photograph.getexif())
        assert straight.info.get("icc_profile") == photograph.info.get("icc_profile")


def test_two_exposures_of_one_scene_come_out_as_one_scene(straightened):
    a, b = (cv2.imread(str(straightened[name]), cv2.IMREAD_UNCHANGED) for name in ("a16.png", "b16.png"))
    assert (a == b).mean() > 0.95  # all but what one column touches
    assert np.abs(a.mean() / b.mean() - 1) < 0.01
