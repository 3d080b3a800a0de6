"""What files are called does nothing to a terminal."""

from __future__ import annotations

from orthoscope.cli.terminal import printable


def test_escapes_are_shown_and_words_stay():
    assert printable("größe \x1b[31mred\x07\u202e.png") == "größe \\x1b[31mred\\x07\\u202e.png"
    assert printable("two\nlines") == "two\nlines"


def test_an_error_about_a_file_with_an_escape_in_its_name_shows_it(run, tmp_path):
    told = run("convert", tmp_path / "\x1b[2Jcamera.yaml", tmp_path / "a.yaml", "--to", "ros")
    assert told.code == 2
    assert "\x1b" not in told.err
    assert "\\x1b[2Jcamera.yaml does not exist" in told.err


def test_a_place_that_cannot_be_is_one_sentence(run, tmp_path):
    for place in ("x" * 300, "a\0b"):
        told = run("simulate", "-o", tmp_path / place)
        assert told.code == 2
        assert len(told.err.strip().splitlines()) <= 4
