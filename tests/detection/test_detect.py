"""Corners are found where they are: against the truth of rendered photographs, and against OpenCV's detectors
on real ones.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from helpers.quick import first_quick
from orthoscope.detection.chessboards.chessboard import find_chessboard
from orthoscope.detection.detect import detect
from orthoscope.files.images import read_image, write_image
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.simulation.render import Renderer
from orthoscope.simulation.scene import random_views
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import Target, chessboard

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
    return cv2.cornerSubPix(
        grey, corners, (5, 5), (-1, -1), (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    ).reshape(-1, 2)


def rms_to(truth, corners) -> float:
    """rms of |corner - truth|, whichever end the detector began at."""
    return min(float(np.sqrt(((some - truth) ** 2).sum(1).mean())) for some in (corners, corners[::-1]))


@pytest.mark.parametrize("camera", first_quick(CAMERAS))
def test_corners_are_twice_as_near_to_the_truth_as_those_of_corner_sub_pix(camera):
    ours, theirs = [], []
    for grey, truth in photographed(camera, 6):
        corners, usual = find_chessboard(grey, 9, 6), classic(grey, 9, 6)
        assert corners is not None
        ours.append(rms_to(truth, corners))
        if usual is not None:
            theirs.append(rms_to(truth, usual))
    assert np.sqrt(np.mean(np.square(ours))) < 0.5 * np.sqrt(np.mean(np.square(theirs)))


@pytest.mark.parametrize(
    "look", [{"blur_px": 0.4}, {"blur_px": 2.0}, {"noise": 8.0}, {"vignetting": 0.7, "light": 0.6}], ids=str
)
def test_blur_noise_and_uneven_light_cost_little(look):
    for grey, truth in photographed(CAMERAS["brown"], 4, seed=1, **look):
        corners = find_chessboard(grey, 9, 6)
        assert corners is not None
        assert rms_to(truth, corners) < 0.06  # noise 8 gives 0.04; the rest stay below 0.02


@pytest.mark.slow
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
    assert (
        [view.image for view in one.views]
        == [view.image for view in other.views]
        == [f"view{i}.png" for i in range(1, 6)]
    )
    for a, b in zip(one.views, other.views, strict=True):
        assert_array_equal(a.pixels, b.pixels)


def test_progress_names_every_photograph(folder):
    told = []
    detect(folder, BOARD, progress=lambda *how_far: told.append(how_far))
    assert told == [(i, 5, f"view{i}.png") for i in range(1, 6)]


def test_a_board_of_another_size_is_told_of(folder):
    with pytest.raises(
        CalibrationError, match=r"seems to be a board of 9x6 inner corners.*--target chessboard:9x6:25mm"
    ):
        detect(folder / "view1.png", "chessboard:10x7:25mm")


def test_a_board_of_another_size_in_most_photographs_is_told_of_where_some_show_the_target(folder):
    other, camera = chessboard(7, 5, 0.025), CAMERAS["brown"]
    rng = np.random.default_rng(4)
    (pose,) = random_views(camera, other, 1, rng=rng, tilt=(0.0, 0.5), margin=0.025)
    pictures = {"other": Renderer(camera).photograph(other, pose, rng=rng)}
    pictures |= {path.name: read_image(path, grey=True) for path in sorted(folder.iterdir())[:3]}
    found = detect(pictures, other)
    assert [view.image for view in found.views] == ["other"]
    (remark,) = found.remarks
    assert remark.image == "view1.png"
    assert "a board of 9x6 inner corners in it and others" in remark.words
    assert "--target chessboard:9x6:25mm" in remark.words


def test_a_target_that_no_detector_knows_is_refused(folder):
    with pytest.raises(InputError, match="cannot be looked for in photographs"):
        detect(folder, Target("dots", BOARD.points))


@pytest.fixture
def mixed(folder, tmp_path):
    """Five photographs of the board, and one of each kind that cannot take part."""
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    whole = (folder / "view1.png").read_bytes()
    (tmp_path / "again.jpg").write_bytes(whole)  # the name does not matter, the pixels do
    (tmp_path / "cut.png").write_bytes(whole[:9000])
    (tmp_path / "notes.png").write_bytes(b"no image")
    write_image(tmp_path / "wall.png", np.full((480, 640), 128, np.uint8))
    write_image(tmp_path / "cropped.png", read_image(folder / "view2.png", grey=True)[:, 8:])
    return tmp_path


def test_photographs_that_cannot_take_part_are_set_aside_with_the_reason_and_the_others_go_on(mixed):
    detections = detect(mixed, BOARD)
    assert detections.image_size == (640, 480)
    assert [view.image for view in detections.views] == ["again.jpg", *(f"view{i}.png" for i in range(2, 6))]
    reasons = dict(detections.set_aside)
    assert set(reasons) == {"cropped.png", "cut.png", "notes.png", "view1.png", "wall.png"}
    assert "632x480" in reasons["cropped.png"]
    assert "640x480" in reasons["cropped.png"]
    assert "cut off" in reasons["cut.png"]
    assert "not an image" in reasons["notes.png"]
    assert "again.jpg" in reasons["view1.png"]
    assert "not found" in reasons["wall.png"]


def test_of_two_sizes_that_are_as_frequent_the_larger_is_kept(folder, tmp_path):
    for i in (1, 2):
        picture = read_image(folder / f"view{i}.png", grey=True)
        write_image(tmp_path / f"a{i}.png", picture[:, 8:])
        write_image(tmp_path / f"b{i}.png", picture)
    assert detect(tmp_path, BOARD).image_size == (640, 480)


def test_photographs_of_one_name_in_two_folders_keep_as_much_of_the_folder_as_tells_them_apart(
    folder, tmp_path
):
    for name, i in (("left", 1), ("right", 2)):
        write_image(tmp_path / name / "1.png", read_image(folder / f"view{i}.png", grey=True))
    views = detect([tmp_path / "left", tmp_path / "right"], BOARD).views
    assert [view.image for view in views] == ["left/1.png", "right/1.png"]


def test_photographs_none_of_which_can_be_read_are_told_of(tmp_path):
    (tmp_path / "a.png").write_bytes(b"")
    with pytest.raises(CalibrationError, match=r"none of 1 photographs can be read(.|\n)*a\.png: is empty"):
        detect(tmp_path, BOARD)


@pytest.mark.parametrize("asked", first_quick(["8x6", "8x5", "9x5", "10x6"]))
def test_a_part_of_a_board_is_not_taken_for_the_whole(folder, asked):
    """OpenCV finds 8x6 corners in a board of 9x6, and not the same ones in each photograph."""
    with pytest.raises(CalibrationError, match=r"seems to be a board of 9x6 inner corners"):
        detect(folder / "view1.png", f"chessboard:{asked}:25mm")


def test_the_board_laid_the_other_way_is_the_same_board(folder):
    assert len(detect(folder, "chessboard:6x9:25mm").views) == 5


def test_a_board_too_small_to_be_looked_for_is_refused(folder):
    with pytest.raises(InputError, match="expected at least 3x3"):
        detect(folder, "chessboard:3x2:25mm")


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_board_that_tells_its_ends_apart_begins_at_the_same_corner_however_it_lies(turns):
    ((grey, _),) = photographed(CAMERAS["brown"], 1)
    upright, turned = (
        find_chessboard(grey, 9, 6),
        find_chessboard(np.ascontiguousarray(np.rot90(grey, turns)), 9, 6),
    )
    assert upright is not None
    assert turned is not None
    for left in range(
        turns, 0, -1
    ):  # back from a picture that was turned counter-clockwise, a quarter at a time
        side = 640 if left % 2 else 480
        turned = np.stack([side - 1 - turned[:, 1], turned[:, 0]], axis=1)
    assert np.abs(turned - upright).max() < 0.02  # the same pixels, smoothed in another order


@pytest.mark.parametrize("size", [(1, 1), (10, 10), (15, 3000), (480, 640)])
def test_a_picture_without_a_board_has_none_however_small(size):
    noise = np.random.default_rng(0).integers(0, 256, size, dtype=np.uint8)
    assert find_chessboard(noise, 9, 6) is None


# photographs: inner corners, lens, boards that OpenCV's better detector finds, our rms over that of either
# detector at most
SETS = {
    "opencv-left/*.jpg": (9, 6, "brown", 14, 0.95),
    "sony/*.jpg": (6, 4, "brown", 13, 0.95),
    "bumblebee/left*.jpg": (6, 4, "brown", 11, 0.95),
    "bumblebee/right*.jpg": (6, 4, "brown", 11, 0.95),
    "udacity/*.jpg": (9, 6, "brown", 16, 1.003),  # a wavy board: it, not the corners, makes the 0.84 px
    "calibrel/*.png": (16, 10, "brown", 20, 0.98),  # nor is this one flat
    "fisheye-180/*.jpg": (6, 4, "kannala_brandt", 26, 0.97),
}
STORED = {
    "bumblebee/left*.jpg": "corners-boof-bumblebee-left.npz",
    "bumblebee/right*.jpg": "corners-boof-bumblebee-right.npz",
}


def stored(folder, pattern, target):
    """What OpenCV's two detectors found in a set."""
    table = np.load((folder / pattern).parent / STORED.get(pattern, "corners.npz"))
    for key in ("image_points_classic", "image_points_sb"):
        found = zip(table["files"], table[key].astype(float), strict=True)
        views = [
            View(str(file), np.arange(len(target.points)), pixels)
            for file, pixels in found
            if np.isfinite(pixels).all()
        ]
        yield Detections(target, tuple(map(int, table["image_size"])), tuple(views))


@pytest.mark.slow
@pytest.mark.datasets
@pytest.mark.parametrize("name", SETS)
def test_on_real_photographs_no_board_is_lost_and_corners_agree_with_a_camera_better_than_those_of_opencv(
    datasets, name
):
    columns, rows, lens, boards, most = SETS[name]
    ours = detect(str(datasets / name), chessboard(columns, rows, 0.03), jobs=1)
    assert len(ours.views) >= boards
    for theirs in stored(datasets, name, ours.target):
        by_name = {view.image: i for i, view in enumerate(ours.views)}
        common = ours.only(
            [by_name[view.image] for view in theirs.views]
        )  # a KeyError here is a board that was lost
        assert fccm(common, lens=lens).rms_px < most * fccm(theirs, lens=lens).rms_px
