"""Numbers as people read them."""

from __future__ import annotations

import numpy as np
import pytest

from orthoscope.geometry.numbers import (
    ABSENT,
    degrees,
    percent,
    pixels,
    probability,
    rough_pixels,
    setting,
    six_digits,
    value_with_deviation,
    with_error,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.18634, "0.186"),
        (0.0, "0.000"),
        (1.514, "1.51"),
        (0.000123, "0.000123"),
        (25.44, "25.4"),
        (1234.5, "1234"),
        (np.nan, ABSENT),
    ],
)
def test_pixels_have_about_three_digits(value, text):
    assert pixels(value) == text


@pytest.mark.parametrize(
    ("value", "deviation", "texts"),
    [
        (535.91573, 0.1134, ("535.92", "0.11")),
        (-0.0003, 0.016, ("0.000", "0.016")),  # never -0.000
        (2000.4, 150.0, ("2000", "150")),
        (1 / 3, np.nan, ("0.333333", ABSENT)),
        (1 / 3, 0.0, ("0.333333", ABSENT)),
    ],
)
def test_a_value_ends_where_its_deviation_has_its_second_digit(value, deviation, texts):
    assert value_with_deviation(value, deviation) == texts


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.0881, 0.0152, "0.088 ± 0.015"),
        (0.0012, 0.0004, "0.00120 ± 0.00040"),
        (9.1, 0.8, "9.10 ± 0.80"),
        (0.2, np.nan, "0.200"),
        (0.2, 0.0, "0.200"),
        (np.nan, 0.1, ABSENT),
    ],
)
def test_a_number_ends_where_its_error_has_its_second_digit(value, error, text):
    assert with_error(value, error) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(123.4, "123"), (9.87, "9.9"), (0.0951, "0.095"), (0.0949, "0.09"), (0.002, "0.01")],
)
def test_a_sentence_says_pixels_with_two_digits_and_no_less_than_a_hundredth(value, text):
    assert rough_pixels(value) == text


def test_a_parameter_whose_error_nobody_knows_has_six_digits():
    assert with_error(535.915731, np.nan, alone=six_digits) == "535.916"


def test_angles_and_shares_that_do_not_exist_are_dashes():
    assert (degrees(np.pi), degrees(np.nan), percent(0.875), percent(np.nan)) == (
        "180.0°",
        ABSENT,
        "88 %",
        ABSENT,
    )


def test_a_probability_that_is_next_to_nothing_is_only_said_to_be_small():
    assert [probability(p) for p in (0.2345, 0.001, 1e-200, 0.0, np.nan)] == [
        "0.23",
        "0.001",
        "< 0.001",
        "< 0.001",
        ABSENT,
    ]


def test_settings_of_any_kind_are_text_without_addresses():
    class Odd:
        pass

    values = [
        True,
        0.5,
        np.float64(0.25),
        np.int64(3),
        "brown",
        (1, "a"),
        {"k": [1.5]},
        {"b", "a"},
        np.eye(2),
        len,
        Odd(),
        (),
        None,
    ]
    texts = [setting(value) for value in values]
    assert texts == [
        "True",
        "0.5",
        "0.25",
        "3",
        "brown",
        "1, a",
        "k=1.5",
        "a, b",
        "1, 0, 0, 1",
        "len",
        "Odd",
        "none",
        "None",
    ]
