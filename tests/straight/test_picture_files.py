"""A straight picture is the file that it was: depth, channels and all that stands beside the pixels, as
another library reads them back.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from PIL import Image, PngImagePlugin

from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.straight.picture_files import encoded, read_picture
from orthoscope.straight.undistort import undistort, undistort_photographs

CAMERA = Camera((96, 64), Intrinsics(70.0, 70.0, 47.0, 32.0), Brown(k1=-0.2))
RNG = np.random.default_rng(0)
SMOOTH = cv2.GaussianBlur(RNG.integers(0, 256, (64, 96, 4)).astype(np.uint8), (0, 0), 3)
PROFILE = bytes(range(256)) * 5


def exif(orientation: int = 6) -> Image.Exif:
    tags = Image.Exif()
    tags[0x0112] = orientation
    tags[0x010F] = "A maker"
    tags.get_ifd(0x8769)[0x829A] = 0.01  # exposure time, in the table within
    return tags


def straightened(path, folder):
    (place,), failed = undistort_photographs([path], CAMERA, folder)
    assert failed == []
    return place


@pytest.mark.parametrize(
    "pixels",
    [
        pytest.param(SMOOTH[..., 0], id="grey"),
        pytest.param(SMOOTH[..., :3], id="colour"),
        pytest.param(SMOOTH, id="with alpha"),
        pytest.param(SMOOTH[..., 0].astype(np.uint16) * 113, id="grey 16 bits"),
        pytest.param(SMOOTH[..., :3].astype(np.uint16) * 7, id="colour 16 bits"),
        pytest.param(SMOOTH.astype(np.uint16) * 251, id="with alpha 16 bits"),
    ],
)
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_depth_channels_and_brightness_stay(tmp_path, pixels, suffix):
    cv2.imwrite(str(tmp_path / f"a{suffix}"), pixels)
    place = straightened(tmp_path / f"a{suffix}", tmp_path / "out")
    assert_array_equal(cv2.imread(str(place), cv2.IMREAD_UNCHANGED), undistort(pixels, CAMERA))


def test_a_picture_of_real_numbers_stays_one(tmp_path):
    pixels = (SMOOTH[..., 0] / 7.0).astype(np.float32)
    cv2.imwrite(str(tmp_path / "a.tif"), pixels)
    place = straightened(tmp_path / "a.tif", tmp_path / "out")
    assert_array_equal(cv2.imread(str(place), cv2.IMREAD_UNCHANGED), undistort(pixels, CAMERA))


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif", ".webp"])
@pytest.mark.parametrize("orientation", [1, 6])
def test_exif_orientation_profile_and_resolution_stay(tmp_path, suffix, orientation):
    settings = {"exif": exif(orientation), "icc_profile": PROFILE, "dpi": (300, 300)}
    Image.fromarray(SMOOTH[..., :3]).save(tmp_path / f"a{suffix}", **settings)
    place = straightened(tmp_path / f"a{suffix}", tmp_path / "out")
    with Image.open(place) as made, Image.open(tmp_path / f"a{suffix}") as given:
        assert made.format == given.format
        assert made.size == given.size  # as the sensor has it, not turned
        assert made.info["icc_profile"] == PROFILE
        assert made.getexif()[0x0112] == orientation
        assert made.getexif()[0x010F] == "A maker"
        assert made.getexif().get_ifd(0x8769) == given.getexif().get_ifd(0x8769)
        if suffix != ".webp":  # which has no resolution of its own
            assert made.info["dpi"] == pytest.approx(given.info["dpi"])
        made.load()


def test_a_tiff_of_the_other_byte_order_keeps_its_tags(tmp_path):
    cv2.imwrite(str(tmp_path / "a.tif"), SMOOTH[..., :3])
    picture = read_picture(tmp_path / "a.tif")
    big = tmp_path / "big.tif"
    Image.fromarray(SMOOTH[..., 0].astype(">u2")).save(big, dpi=(300, 300), software="of the other order")
    assert big.read_bytes()[:2] == b"MM"
    (tmp_path / "b.tif").write_bytes(encoded(picture.pixels, picture._replace(content=big.read_bytes()), big))
    with Image.open(tmp_path / "b.tif") as made:
        assert made.info["dpi"] == (300, 300)
        assert made.getexif()[305] == "of the other order"


def test_texts_of_a_png_stay(tmp_path):
    texts = PngImagePlugin.PngInfo()
    texts.add_text("Title", "A board")
    Image.fromarray(SMOOTH[..., :3]).save(tmp_path / "a.png", pnginfo=texts)
    with Image.open(straightened(tmp_path / "a.png", tmp_path / "out")) as made:
        assert made.info["Title"] == "A board"


def test_the_kind_of_file_is_known_by_its_content(tmp_path):
    Image.fromarray(SMOOTH[..., :3]).save(tmp_path / "a.jpg", format="PNG")
    with Image.open(straightened(tmp_path / "a.jpg", tmp_path / "out")) as made:
        assert made.format == "PNG"


def test_damage_beside_the_pixels_does_no_harm(tmp_path):
    Image.fromarray(SMOOTH[..., :3]).save(tmp_path / "a.tif", exif=exif())
    picture = read_picture(tmp_path / "a.tif")
    damaged = picture._replace(content=picture.content[:-40])
    assert encoded(picture.pixels, damaged, tmp_path / "b.tif")[:4] == b"II*\0"


def test_no_picture_is_written_onto_one_that_is_read(tmp_path):
    photos = tmp_path / "photos"
    photos.mkdir()
    cv2.imwrite(str(photos / "a.png"), SMOOTH)
    before = (photos / "a.png").read_bytes()
    (tmp_path / "same").symlink_to(photos)
    (tmp_path / "other").mkdir()
    (tmp_path / "other/a.png").hardlink_to(photos / "a.png")
    for folder in ("photos", "same", "other"):
        with pytest.raises(InputError, match="what is read is never written onto"):
            undistort_photographs([photos / "a.png"], CAMERA, tmp_path / folder)
    assert (photos / "a.png").read_bytes() == before
