"""docs/formats.md says what the records say."""

from __future__ import annotations

from pathlib import Path

from orthoscope.formats.described import table_of_tools
from orthoscope.formats.table import FORMATS

PAGE = Path(__file__).parents[2] / "docs/formats.md"


def test_the_table_in_the_documentation_is_the_one_that_the_records_make():
    """`python -m orthoscope.formats.described` prints it."""
    assert table_of_tools() in PAGE.read_text()


def test_every_tool_has_a_row_with_its_suffixes_and_remarks():
    rows = {line.split("|")[1].strip(" `"): line for line in table_of_tools().splitlines()[2:]}
    assert set(rows) == set(FORMATS)
    for name, record in FORMATS.items():
        assert all(f"`{suffix}`" in rows[name] for suffix in record.suffixes)
        assert record.remarks in rows[name]
