"""The layout of our files: numbers as Python writes them, however many they are."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orthoscope.formats.own.json_layout import lay_out

tables = st.lists(
    st.lists(st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**53), 2**53), min_size=1),
    min_size=1,
)


@given(tables)
def test_a_table_of_numbers_is_the_text_that_python_writes(table: list[list[float]]):
    assert lay_out(table).replace("\n", "").replace("  ", "").replace("],[", "], [") == json.dumps(table)


@pytest.mark.parametrize("exponent", range(-12, 23))
def test_small_and_large_numbers_in_a_table_are_written_as_by_themselves(exponent: int):
    number = float(f"1.2345e{exponent}")
    assert lay_out([[number], [-number]]) == f"[\n  [{number!r}],\n  [{-number!r}]\n]"


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_what_json_has_no_word_for_is_refused_in_a_table_too(number: float):
    with pytest.raises(ValueError, match="not JSON compliant"):
        lay_out([[1.0, 2.0], [3.0, number]])
