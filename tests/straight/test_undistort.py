"""Straight pictures are what cv2.remap makes of the map, for one photograph or a folder of them, wherever the
work is done.
"""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from orthoscope.files.images import write_image
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.straight.undistort import Straightener, undistort, undistort_photographs

CAMERA = Camera((320, 240), Intrinsics(250.0, 250.0, 158.0, 121.0), Brown(k1=-0.3, k2=0.1, p1=1e-3))
PICTURE = cv2.GaussianBlur(
    np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8), (0, 0), 2
)


@pytest.mark.parametrize(
    "picture", [PICTURE, PICTURE[:, :, 0], PICTURE.astype(np.uint16), PICTURE.astype(np.float32)]
)
@pytest.mark.parametrize("keep", ["all", "valid"])
def test_a_straight_picture_is_the_photograph_remapped(picture, keep):
    maps = [np.nan_to_num(part, nan=-10.0) for part in CAMERA.undistort_map(CAMERA.straight_intrinsics(keep))]
    expected = cv2.remap(picture, *maps, interpolation=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    assert_array_equal(undistort(picture, CAMERA, keep=keep), expected)


def test_where_the_camera_saw_nothing_the_picture_is_black():
    straight = undistort(np.full((240, 320, 3), 255, dtype=np.uint8), CAMERA)
    assert (
        straight[0, 160] == 0
    ).all()  # barrel distortion: the middle of a side lies nearer than its corners
    assert (straight[120, 160] == 255).all()


def test_straight_pictures_keep_their_own_memory_unless_the_next_may_have_it():
    straightener, other = Straightener(CAMERA), PICTURE[::-1]
    kept, expected = straightener(PICTURE), undistort(other, CAMERA)
    first = straightener(PICTURE, reuse=True)
    assert_array_equal(first, kept)
    assert straightener(other, reuse=True) is first
    assert_array_equal(first, expected)
    assert not np.shares_memory(straightener(other), straightener(other))
    assert_array_equal(kept, undistort(PICTURE, CAMERA))


def test_the_threads_of_opencv_are_as_many_after_a_folder_as_before(tmp_path):
    before = cv2.getNumThreads()
    write_image(tmp_path / "a.png", PICTURE)
    with ThreadPoolExecutor(2) as executor:
        undistort_photographs([tmp_path / "a.png"], CAMERA, tmp_path / "straight", executor=executor)
    assert cv2.getNumThreads() == before


def test_a_photograph_of_another_size_is_refused():
    with pytest.raises(
        InputError, match=r"the photographs are 320x200; this camera was calibrated at 320x240.*--crop"
    ):
        undistort(PICTURE[:200], CAMERA)


def test_a_straightener_goes_to_another_process_without_its_map():
    straightener = Straightener(CAMERA, keep="valid")
    sent = pickle.dumps(straightener)
    assert len(sent) < 2 * 320 * 240 * 4  # the map has two float32 for each pixel
    assert_array_equal(pickle.loads(sent)(PICTURE), straightener(PICTURE))


@pytest.fixture
def folder(tmp_path):
    for i in range(7):
        write_image(tmp_path / f"photos/{i}.png", np.roll(PICTURE, 20 * i, axis=1))
    (tmp_path / "photos/3.png").write_bytes(b"no picture")
    return tmp_path


def test_threads_make_the_pictures_that_one_alone_makes_in_the_same_order(folder):
    paths, told = sorted((folder / "photos").iterdir()), []
    alone = undistort_photographs(paths, CAMERA, folder / "alone")
    with ThreadPoolExecutor(3) as executor:
        many = undistort_photographs(
            paths, CAMERA, folder / "many", executor=executor, progress=lambda *at: told.append(at)
        )
    assert (
        [path.name for path in alone[0]]
        == [path.name for path in many[0]]
        == [f"{i}.png" for i in range(7) if i != 3]
    )
    assert alone[1] == many[1]
    assert [name for name, _ in many[1]] == ["3.png"]
    assert told == [(i + 1, 7, f"{i}.png") for i in range(7)]
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(alone[0], many[0], strict=True))


def test_two_photographs_of_one_name_are_refused(folder):
    with pytest.raises(InputError, match="have the same name"):
        undistort_photographs([folder / "photos/1.png", folder / "1.png"], CAMERA, folder / "out")
