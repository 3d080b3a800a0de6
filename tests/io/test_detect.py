"""Corners are found where they are: against the truth of rendered photographs, and against OpenCV's detectors on real ones."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from orthoscope.evaluate.render import Renderer
from orthoscope.evaluate.simulate import random_views
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.geometry.target import Target, chessboard
from orthoscope.io.chessboard import find_chessboard
from orthoscope.io.detect import detect
from orthoscope.io.images import write_image
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera, Intrinsics
from orthoscope.models.lenses import Brown, KannalaBrandt
from real_sets import photographs_of

BOARD = chessboard(9, 6, 0.025)
CAMERAS = {
    "brown": Camera((640, 480), Intrinsics(520.0, 518.0, 324.0, 236.0), Brown(k1=-0.25, k2=0.08)),
    "kannala_brandt": Camera((640, 480), Intrinsics(250.0, 250.0, 320.0, 240.0), KannalaBrandt(k1=-0.02)),
}


def photographed(camera: Camera, count: int, *, seed: int = 0, tilt: float = 0.8, **look):
    """Pictures with the true corners."""
    rng = np.random.default_rng(seed)
    renderer = Renderer(camera, **look)
    for pose in random_views(camera, BOARD, count, rng=rng, tilt=(0.0, tilt), roll=(-0.3, 0.3), margin=0.025):
        yield renderer.photograph(BOARD, pose, rng=rng), camera.project(pose.apply(BOARD.points))


def classic(grey, columns, rows):
    found, corners = cv2.findChessboardCorners(grey, (columns, rows))
    if not found:
        return None
    return cv2.cornerSubPix(grey, corners, (5, 5), (-1, -1), (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)).reshape(-1, 2)


def sector_based(grey, columns, rows):
    found, corners = cv2.findChessboardCornersSB(grey, (columns, rows), flags=cv2.CALIB_CB_ACCURACY)
    return corners.reshape(-1, 2) if found else None


def rms_to(truth, corners) -> float:
    """rms of |corner - truth|, whichever end the detector began at."""
    return min(float(np.sqrt(((some - truth) ** 2).sum(1).mean())) for some in (corners, corners[::-1]))


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_corners_are_twice_as_near_to_the_truth_as_those_of_corner_sub_pix(camera):
    ours, theirs = [], []
    for grey, truth in photographed(camera, 6):
        corners, usual = find_chessboard(grey, 9, 6), classic(grey, 9, 6)
        assert corners is not None
        ours.append(rms_to(truth, corners))
        if usual is not None:
            theirs.append(rms_to(truth, usual))
    assert np.sqrt(np.mean(np.square(ours))) < 0.5 * np.sqrt(np.mean(np.square(theirs)))


@pytest.mark.parametrize("look", [{"blur_px": 0.4}, {"blur_px": 2.0}, {"noise": 8.0}, {"vignetting": 0.7, "light": 0.6}], ids=str)
def test_blur_noise_and_uneven_light_cost_little(look):
    for grey, truth in photographed(CAMERAS["brown"], 4, seed=1, **look):
        corners = find_chessboard(grey, 9, 6)
        assert corners is not None
        assert rms_to(truth, corners) < 0.06  # noise 8 gives 0.04; the rest stay below 0.02


def test_a_large_photograph_is_refined_as_well_as_a_small_one():
    camera = Camera((3000, 2250), Intrinsics(2400.0, 2400.0, 1500.0, 1120.0), Brown(k1=-0.1))
    ((grey, truth),) = photographed(camera, 1)
    corners = find_chessboard(grey, 9, 6)
    assert corners is not None
    assert rms_to(truth, corners) < 0.1


def test_every_window_may_be_too_flat_for_a_saddle_and_the_corners_stay():
    ((grey, truth),) = photographed(CAMERAS["brown"], 1)
    dull = (120 + (grey.astype(float) - 120) * 0.15).astype(np.uint8)
    corners = find_chessboard(dull, 9, 6)
    assert corners is not None
    assert rms_to(truth, corners) < 0.3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photographs")
    for i, (grey, _) in enumerate(photographed(CAMERAS["brown"], 5), 1):
        write_image(folder / f"view{i}.png", grey)
    return folder


def test_the_same_photographs_give_the_same_corners_whatever_runs_them(folder):
    one = detect(folder, "chessboard:9x6:25mm", jobs=1)
    with ThreadPoolExecutor(4) as executor:
        other = detect(sorted(folder.iterdir()), BOARD, executor=executor)
    assert [view.image for view in one.views] == [view.image for view in other.views] == [f"view{i}.png" for i in range(1, 6)]
    for a, b in zip(one.views, other.views, strict=True):
        assert_array_equal(a.pixels, b.pixels)


def test_progress_names_every_photograph(folder):
    told = []
    detect(folder, BOARD, progress=lambda *how_far: told.append(how_far))
    assert told == [(i, 5, f"view{i}.png") for i in range(1, 6)]


def test_a_board_of_another_size_is_told_of(folder):
    with pytest.raises(CalibrationError, match=r"seems to be a board of 9x6 inner corners.*--target chessboard:9x6:25mm"):
        detect(folder, "chessboard:10x7:25mm")


def test_a_target_that_no_detector_knows_is_refused(folder):
    with pytest.raises(InputError, match="cannot be looked for in photographs"):
        detect(folder, Target("dots", BOARD.points))


SETS = {  # photographs: inner corners, lens, boards that OpenCV's better detector finds
    "opencv-left/*.jpg": (9, 6, "brown", 14),
    "sony/*.jpg": (6, 4, "brown", 13),
    "bumblebee/left*.jpg": (6, 4, "brown", 11),
    "bumblebee/right*.jpg": (6, 4, "brown", 11),
    "udacity/*.jpg": (9, 6, "brown", 16),
    "calibrel/*.png": (16, 10, "brown", 20),
    "fisheye-180/*.jpg": (6, 4, "kannala_brandt", 26),
}


@pytest.mark.slow
@pytest.mark.datasets
@pytest.mark.parametrize("name", SETS)
def test_on_real_photographs_corners_agree_better_with_a_camera_than_those_of_either_opencv_detector(datasets, name):
    columns, rows, lens, boards = SETS[name]
    ours, others = photographs_of(datasets / name, columns, rows, (find_chessboard, classic, sector_based))
    assert len(ours.views) >= boards
    for theirs in others:
        both = [view.image for view in theirs.views]
        common = ours.only([i for i, view in enumerate(ours.views) if view.image in both])
        assert len(common.views) == len(theirs.views)  # no board that OpenCV finds is lost
        # the wavy board of udacity leaves 0.85 px to a flat one, in which no detector's noise is seen: there they are alike to 1 %
        share = 1.01 if "udacity" in name else 0.97
        assert fccm(common, lens=lens).rms_px < share * fccm(theirs, lens=lens).rms_px
