"""Maps for other programs: what cv2.remap makes of them is what we make."""

from __future__ import annotations

import io

import cv2
import numpy as np
from numpy.testing import assert_array_equal

from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.straight.map_files import map_files
from orthoscope.straight.views import map_of, straight_camera

CAMERA = Camera((64, 48), Intrinsics(40.0, 41.0, 31.0, 24.0), Brown(k1=-0.3))
MAPS = map_of(CAMERA, straight_camera(CAMERA, keep="all"))


def test_numpys_files_hold_the_maps():
    files = map_files(*MAPS, kind="npy")
    for name, values in zip(("map_x.npy", "map_y.npy"), MAPS, strict=True):
        assert_array_equal(np.load(io.BytesIO(files[name])), values)


def test_opencvs_file_is_read_by_its_own_reader_to_the_last_bit(tmp_path):
    ((name, content),) = map_files(*MAPS, kind="opencv").items()
    (tmp_path / name).write_bytes(content)
    storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_READ)
    read = [storage.getNode(each).mat() for each in ("map_x", "map_y")]
    assert [values.dtype for values in read] == [np.float32, np.float32]
    assert_array_equal(read, MAPS)


def test_the_same_maps_give_the_same_bytes():
    assert map_files(*MAPS, kind="opencv") == map_files(*MAPS, kind="opencv")
