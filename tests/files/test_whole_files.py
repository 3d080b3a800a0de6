"""Files are written as wholes or not at all."""

from __future__ import annotations

import os

import pytest

from orthoscope.files import whole_files as files
from orthoscope.files.whole_files import check_folder, read_bytes, read_text, write_bytes, write_text
from orthoscope.geometry.arrays import InputError


def test_what_was_written_is_read(tmp_path):
    write_text(tmp_path / "a.txt", "25 µm\nsecond line\n")
    assert read_text(tmp_path / "a.txt") == "25 µm\nsecond line\n"


def test_any_line_ends_and_a_byte_order_mark_are_read(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"\xef\xbb\xbfone\r\ntwo\rthree\n")
    assert read_text(tmp_path / "a.txt") == "one\ntwo\nthree\n"


def test_missing_folders_are_made(tmp_path):
    write_bytes(tmp_path / "new" / "folder" / "a.bin", b"\x00\x01")
    assert read_bytes(tmp_path / "new" / "folder" / "a.bin") == b"\x00\x01"


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, MemoryError])
def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, interruption):
    place = tmp_path / "a.json"
    write_text(place, "old")

    def interrupted(*_):
        raise interruption

    monkeypatch.setattr(files.os, "replace", interrupted)
    with pytest.raises(interruption):
        write_text(place, "new")
    assert os.listdir(tmp_path) == ["a.json"]
    assert place.read_text() == "old"


def test_a_full_disk_is_an_error_that_leaves_nothing_behind(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(InputError, match=r"a\.json cannot be written \(No space left on device\)"):
        write_text(tmp_path / "a.json", "new")
    assert os.listdir(tmp_path) == []


def test_a_link_stays_a_link(tmp_path):
    write_text(tmp_path / "real.txt", "old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_a_new_file_has_the_rights_that_any_new_file_has(tmp_path):
    write_text(tmp_path / "ours.txt", "")
    (tmp_path / "theirs.txt").write_text("")
    assert (tmp_path / "ours.txt").stat().st_mode == (tmp_path / "theirs.txt").stat().st_mode


def test_a_device_is_written_to():
    write_text(os.devnull, "gone")


def test_a_file_where_a_folder_should_be_is_refused(tmp_path):
    write_text(tmp_path / "photos", "a file")
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / "photos" / "a.json", "")
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / "photos" / "deep" / "a.json", "")


def test_a_folder_where_a_file_should_be_is_refused(tmp_path):
    with pytest.raises(InputError, match="is a folder; expected the name of a file"):
        write_text(tmp_path, "")


def test_a_folder_without_permission_is_refused(tmp_path, monkeypatch):
    def forbidden(*_):
        raise PermissionError(
            13, "Permission denied"
        )  # root, as whom tests may run, is never forbidden anything

    monkeypatch.setattr(files.Path, "write_bytes", forbidden)
    with pytest.raises(InputError, match=r"cannot be written \(Permission denied\)"):
        write_text(tmp_path / "a.json", "")


def test_a_file_that_is_missing_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"a\.json does not exist; expected a file"):
        read_bytes(tmp_path / "a.json")


def test_a_folder_cannot_be_read_as_a_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_bytes(tmp_path)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"abc\xff\xfe")
    with pytest.raises(InputError, match=r"is not text \(byte 3 is no UTF-8\)"):
        read_text(tmp_path / "a.txt")


def test_a_folder_that_can_be_made_is_a_folder_to_write(tmp_path):
    check_folder(tmp_path / "new" / "folder")
    assert os.listdir(tmp_path) == []


def test_a_file_is_no_folder_to_write(tmp_path):
    write_text(tmp_path / "out", "a file")
    with pytest.raises(InputError, match="is a file; expected a folder"):
        check_folder(tmp_path / "out" / "deeper")
