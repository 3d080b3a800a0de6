"""What can be looked at: arrays, files, pages, films; and what cannot is told of before memory is taken."""

from __future__ import annotations

import os
import struct

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from orthoscope.files.films import frames_of
from orthoscope.files.image_headers import size_in_header
from orthoscope.files.images import passed_over, photographs, read_image, to_grey
from orthoscope.files.pictures import pictures
from orthoscope.geometry.arrays import InputError

RAMP = np.tile(np.arange(64, dtype=np.uint8) * 3, (48, 1))


def test_arrays_are_pictures_alone_several_or_by_name():
    assert [picture.name for picture in pictures(RAMP)] == ["picture01"]
    assert [picture.name for picture in pictures([RAMP, RAMP])] == ["picture01", "picture02"]
    named = pictures({"left": RAMP, "right": np.dstack([RAMP] * 3)})
    assert [picture.name for picture in named] == ["left", "right"]
    for picture in named:
        assert_array_equal(picture.grey(most_megapixels=1.0), RAMP)


@pytest.mark.parametrize("shape", [(5,), (0, 4), (4, 4, 7), (2, 4, 4, 3)])
def test_an_array_that_is_no_picture_is_refused(shape):
    with pytest.raises(InputError, match="shape"):
        pictures([np.zeros(shape)])


def test_every_page_of_a_file_is_a_picture(tmp_path):
    pages = [RAMP, RAMP[:, ::-1].copy()]
    cv2.imwritemulti(str(tmp_path / "scan.tif"), pages)
    found = pictures(tmp_path)
    assert [picture.name for picture in found] == ["scan.tif#1", "scan.tif#2"]
    for picture, page in zip(found, pages, strict=True):
        assert_array_equal(picture.grey(most_megapixels=1.0), page)


@pytest.mark.skipif(not hasattr(cv2, "imdecodeanimation"), reason="this OpenCV reads no animations")
@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_every_picture_of_an_animation_is_a_picture(tmp_path, suffix):
    image = pytest.importorskip("PIL.Image")
    pages = [np.roll(RAMP, 7 * shift, axis=1) for shift in range(3)]
    first, *others = (image.fromarray(page) for page in pages)
    first.save(tmp_path / f"scan{suffix}", save_all=True, append_images=others, lossless=True)
    found = pictures(tmp_path)
    assert [picture.name for picture in found] == [f"scan{suffix}#{page}" for page in (1, 2, 3)]
    for picture, page in zip(found, pages, strict=True):
        assert_array_equal(picture.grey(most_megapixels=1.0), page)


def test_of_many_pages_some_that_are_sharp_and_differ_are_taken(tmp_path):
    image = pytest.importorskip("PIL.Image")
    pages = [np.roll(RAMP, shift // 2, axis=1) for shift in range(150)]
    first, *others = (image.fromarray(page) for page in pages)
    first.save(tmp_path / "walk.tif", save_all=True, append_images=others)
    found = pictures(tmp_path / "walk.tif")
    assert 20 < len(found) <= 60
    for picture in found:
        number = int(picture.name.removeprefix("walk.tif#"))
        assert_array_equal(picture.grey(most_megapixels=1.0), pages[number - 1])
    with pytest.raises(InputError, match=r"expected at most 0\.001"):
        found[0].grey(most_megapixels=0.001)


def test_contrast_follows_the_picture_and_one_infinite_pixel_does_no_harm():
    thermal = (29500 + RAMP.astype(float) / 2).astype(np.uint16)
    shown = to_grey(thermal)
    assert shown.max() - shown.min() > 150
    wild = RAMP.astype(np.float32) * 1e-3
    calm = to_grey(wild)
    wild[3, 5], wild[4, 6] = np.inf, np.nan
    assert np.abs(to_grey(wild).astype(int) - calm)[10:].max() <= 1
    assert to_grey(np.full((4, 4), np.nan)).max() == 0


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif"])
def test_a_header_tells_the_size(suffix):
    content = cv2.imencode(suffix, RAMP)[1].tobytes()
    assert size_in_header(content) == (64, 48)
    for length in range(0, 40, 3):
        size_in_header(content[:length])  # cut off: no size or none that harms


def test_a_picture_that_asks_for_too_much_is_refused_before_it_is_read(tmp_path):
    png = bytearray(cv2.imencode(".png", RAMP)[1].tobytes())
    png[16:24] = struct.pack(">II", 60_000, 60_000)
    (tmp_path / "bomb.png").write_bytes(png)
    with pytest.raises(InputError, match="3600 megapixels"):
        read_image(tmp_path / "bomb.png")
    (tmp_path / "a.png").write_bytes(cv2.imencode(".png", RAMP)[1].tobytes())
    with pytest.raises(InputError, match=r"expected at most 0\.001"):
        read_image(tmp_path / "a.png", most_megapixels=0.001)


def test_a_pipe_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(InputError, match="pipe"):
        photographs(tmp_path / "pipe.png")
    with pytest.raises(InputError, match="pipe"):
        read_image(tmp_path / "pipe.png")


def test_files_that_are_passed_over_are_counted_by_their_ending(tmp_path):
    for name in ("a.png", "notes.txt", "more.txt", "raw.cr2", ".hidden"):
        (tmp_path / name).write_bytes(b"x")
    assert passed_over(tmp_path) == {".cr2": 1, ".txt": 2}


def film(path, count: int, *, still: bool = False) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (320, 240))
    assert writer.isOpened()
    for i in range(count):
        frame = np.full((240, 320, 3), 90, np.uint8)
        x = 20 if still else 20 + (i * 3) % 200
        frame[60:180, x : x + 80] = 220
        writer.write(cv2.GaussianBlur(frame, (0, 0), 4.0) if i % 4 else frame)  # three of four are blurred
    writer.release()


def test_of_a_film_sharp_frames_that_differ_are_taken_with_their_times(tmp_path):
    film(tmp_path / "walk.avi", 300)
    found = pictures(tmp_path)
    assert 20 <= len(found) <= 60
    assert found[0].name == "walk.avi@0.000s"
    frames = frames_of(tmp_path / "walk.avi")
    assert all(round(frame.seconds * 30) % 4 == 0 for frame in frames)  # the sharp ones


def test_of_a_film_in_which_nothing_moves_one_frame_is_taken(tmp_path):
    film(tmp_path / "still.avi", 40, still=True)
    assert len(frames_of(tmp_path / "still.avi")) == 1


def test_what_is_no_film_is_told_of(tmp_path):
    (tmp_path / "a.avi").write_bytes(b"no film")
    with pytest.raises(InputError, match="cannot be read as a film"):
        frames_of(tmp_path / "a.avi")
