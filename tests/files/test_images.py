"""Photographs are found in a sensible order, read upright whatever they are, and never half."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from PIL import Image

from orthoscope.files.image_headers import without_turning
from orthoscope.files.images import names_of, pages_of, photographs, read_image, write_image
from orthoscope.geometry.arrays import InputError

PICTURE = np.random.default_rng(0).integers(0, 256, (48, 64), dtype=np.uint8)


@pytest.fixture
def folder(tmp_path):
    for name in ("left10.png", "left2.png", "notes.txt", ".hidden.png"):
        (tmp_path / name).write_bytes(cv2.imencode(".png", PICTURE)[1].tobytes())
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner/left2.png").write_bytes(b"")
    return tmp_path


def test_a_folder_means_its_photographs_with_numbers_in_order(folder):
    assert [path.name for path in photographs(folder)] == ["left2.png", "left10.png"]


def test_files_folders_and_globs_mix_and_each_photograph_comes_once(folder):
    assert [
        path.name for path in photographs([folder / "left10.png", folder, str(folder / "left*.png")])
    ] == ["left10.png", "left2.png"]


def test_names_tell_photographs_of_one_name_apart(folder):
    assert names_of([folder / "left2.png", folder / "left10.png"]) == ["left2.png", "left10.png"]
    assert names_of([folder / "left2.png", folder / "inner/left2.png"]) == [
        f"{folder.name}/left2.png",
        "inner/left2.png",
    ]


@pytest.mark.parametrize("path", ["missing.png", "nothing*.png", "inner/empty"])
def test_a_path_that_leads_to_no_photograph_is_named(folder, path):
    (folder / "inner/empty").mkdir()
    with pytest.raises(InputError, match=r"expected"):
        photographs(folder / path)


def test_no_path_at_all_is_refused():
    with pytest.raises(InputError, match="no photographs were named"):
        photographs([])


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif", ".pgm"])
def test_what_is_written_is_read_back(tmp_path, suffix):
    write_image(tmp_path / f"a{suffix}", PICTURE)
    assert_array_equal(read_image(tmp_path / f"a{suffix}", grey=True), PICTURE)


def test_colour_comes_as_three_channels_and_grey_as_one(tmp_path):
    write_image(tmp_path / "a.png", np.dstack([PICTURE, PICTURE // 2, PICTURE // 4]))
    assert read_image(tmp_path / "a.png", grey=False).shape == (48, 64, 3)
    assert read_image(tmp_path / "a.png", grey=True).shape == (48, 64)


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_16_bit_pictures_fill_the_8_bits_whatever_part_of_theirs_the_camera_used(tmp_path, bits):
    deep = (np.linspace(0, 2**bits - 1, 48 * 64).reshape(48, 64)).astype(np.uint16)
    (tmp_path / "a.png").write_bytes(cv2.imencode(".png", deep)[1].tobytes())
    shown = read_image(tmp_path / "a.png", grey=False)[..., 0]
    assert shown.dtype == np.uint8
    assert shown.max() == 255
    assert np.abs(shown.astype(float) - deep * (255.0 / deep.max())).max() <= 0.5


def test_alpha_is_dropped(tmp_path):
    (tmp_path / "a.png").write_bytes(cv2.imencode(".png", np.dstack([PICTURE] * 4))[1].tobytes())
    assert_array_equal(read_image(tmp_path / "a.png", grey=True), PICTURE)
    assert read_image(tmp_path / "a.png", grey=False).shape == (48, 64, 3)


def test_a_tag_that_says_how_the_camera_was_held_turns_nothing(tmp_path):
    jpeg = cv2.imencode(".jpg", np.repeat(np.arange(64, dtype=np.uint8)[None] * 3, 48, axis=0))[1].tobytes()
    turned = struct.pack("<2sHI", b"II", 42, 8) + struct.pack(
        "<HHHIHHI", 1, 0x0112, 3, 1, 6, 0, 0
    )  # TIFF header, one tag: orientation 6
    exif = b"Exif\0\0" + turned
    (tmp_path / "a.jpg").write_bytes(
        jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]
    )
    seen = read_image(tmp_path / "a.jpg", grey=True)
    assert seen.shape == (48, 64)
    assert seen[:, 0].mean() < seen[:, -1].mean()


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_a_photograph_that_is_cut_off_is_refused_not_read_half(tmp_path, suffix, share):
    whole = cv2.imencode(suffix, PICTURE)[1].tobytes()
    (tmp_path / f"a{suffix}").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"a\.(jpg|png) is cut off"):
        read_image(tmp_path / f"a{suffix}", grey=True)


@pytest.mark.parametrize("suffix", [".bmp", ".tif", ".webp", ".pgm"])
def test_other_formats_that_are_cut_off_are_refused_by_their_decoders(tmp_path, suffix):
    whole = cv2.imencode(suffix, PICTURE)[1].tobytes()
    (tmp_path / f"a{suffix}").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not an image that can be read"):
        read_image(tmp_path / f"a{suffix}", grey=True)


def with_thumbnail(jpeg: bytes) -> bytes:
    """A JPEG that carries a whole smaller one before its own picture."""
    thumbnail = cv2.imencode(".jpg", PICTURE[::4, ::4])[1].tobytes()
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(thumbnail) + 2) + thumbnail + jpeg[2:]


def test_the_end_of_a_thumbnail_is_not_taken_for_the_end_of_the_photograph(tmp_path):
    whole = with_thumbnail(cv2.imencode(".jpg", PICTURE)[1].tobytes())
    (tmp_path / "whole.jpg").write_bytes(whole)
    assert read_image(tmp_path / "whole.jpg", grey=True).shape == PICTURE.shape
    (tmp_path / "cut.jpg").write_bytes(whole[: 2 * len(whole) // 3])
    with pytest.raises(InputError, match="is cut off"):
        read_image(tmp_path / "cut.jpg", grey=True)


@pytest.mark.parametrize(
    "flags",
    [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 2]],
    ids=["plain", "progressive", "restarts"],
)
def test_what_a_telephone_puts_after_the_picture_does_no_harm(tmp_path, flags):
    jpeg = cv2.imencode(".jpg", PICTURE, flags)[1].tobytes()
    (tmp_path / "a.jpg").write_bytes(jpeg + bytes(10_000))
    assert_array_equal(
        read_image(tmp_path / "a.jpg", grey=True),
        cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE),
    )


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "is empty"),
        (b"not an image", "is not an image"),
        (b"BM", "is not an image"),
        (b"\x89PNG\r\n\x1a\n", "cut off"),
    ],
)
def test_what_is_no_photograph_is_named_and_opencv_says_nothing_besides(tmp_path, capfd, content, word):
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(InputError, match=word):
        read_image(tmp_path / "a.png", grey=True)
    assert capfd.readouterr() == ("", "")


def test_one_photograph_named_in_two_ways_comes_once(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert photographs(["left2.png", folder / "left2.png", "./inner/../left2.png"]) == [Path("left2.png")]


def test_a_glob_takes_photographs_only(folder):
    assert [path.name for path in photographs(str(folder / "*"))] == ["left2.png", "left10.png"]


def test_a_place_that_cannot_be_written_is_named(folder):
    with pytest.raises(InputError, match="cannot be written"):
        write_image(folder / "notes.txt/a.png", PICTURE)


def test_a_name_without_a_format_is_refused_and_nothing_is_written(tmp_path):
    with pytest.raises(InputError, match="no image format"):
        write_image(tmp_path / "a.xyz", PICTURE)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("settings", [{}, {"big_tiff": True}], ids=["usual", "of more than 4 GB"])
def test_a_tag_that_says_how_the_camera_was_held_turns_no_tiff_on_any_page(tmp_path, settings):
    pages = [PICTURE[:24, :36], PICTURE[24:, :36]]
    upright, *others = map(Image.fromarray, pages)
    path = tmp_path / "held.tif"
    upright.save(path, save_all=True, append_images=others, tiffinfo={274: 6}, **settings)
    with Image.open(path) as image:
        assert image.tag_v2[274] == 6  # pyright: ignore[reportAttributeAccessIssue]
    for page, pixels in zip(pages_of(path), pages, strict=True):
        assert_array_equal(page, pixels)


@given(st.binary(max_size=60), st.sampled_from([b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"]))
def test_a_damaged_tiff_is_followed_as_far_as_it_can_be(rest, opening):
    assert len(without_turning(opening + rest)) == 4 + len(rest)
