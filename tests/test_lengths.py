"""Lengths in words: no exponents, and metres where they are long."""

import pytest

from truearm.lengths import distance_mm, length_mm


@pytest.mark.parametrize(
    ("value", "digits", "words"),
    [
        (0.067891, 4, "0.06789 mm"),
        (1.77, 3, "1.77 mm"),
        (1020.4, 3, "1020 mm"),
        (4012.0, 2, "4000 mm"),
        (131_200.0, 4, "131.2 m"),
        (20_890.0, 4, "20.89 m"),
        (2.4e9, 2, "2400000 m"),
        (0.0, 3, "0 mm"),
    ],
)
def test_a_length_has_its_digits_and_no_exponent(value, digits, words):
    assert length_mm(value, digits) == words


def test_a_distance_of_a_row_has_two_decimals_unless_it_is_far():
    assert distance_mm(24.981) == "24.98 mm"
    assert distance_mm(2_417_585.93) == "2418 m"
