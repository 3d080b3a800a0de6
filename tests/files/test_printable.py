"""What a file's name may hold, and what of it reaches a terminal."""

from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from orthoscope.files.printable import printable, printable_json

ANY_TEXT = st.text(
    st.characters(exclude_categories=())
)  # surrogates too, as undecodable file names have them


@given(ANY_TEXT)
def test_everything_in_a_printable_line_can_be_seen(text):
    shown = printable(text)
    assert not set(shown) & set(map(chr, [*range(32), *range(127, 160), 0x2028, 0x202E, 0xDC80]))
    shown.encode()  # a terminal takes it


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_a_printable_document_says_the_same(text):
    assert json.loads(printable_json(json.dumps({"name": text}, ensure_ascii=False, indent=1))) == {
        "name": text
    }


def test_names_in_any_language_stay_as_they_are():
    for name in ("left 2.jpg", "größe Ä.png", "相机 校准.tif", "1\u00a0000.png"):
        assert printable(name) == name


def test_commands_to_a_terminal_and_line_ends_are_told_by_their_number():
    assert printable("a\x1b[2J\n\x9bm\u202e.png") == r"a\x1b[2J\n\x9bm\u202e.png"
