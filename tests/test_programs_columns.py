"""Columns of a program: numbers found by lines, and arrays that are not copied where they need not be."""

import numpy as np
import pytest

from truearm._core import CoreError, find_bytes, read_numbers
from truearm.programs.scanning import Scan
from truearm.programs.tables import all_ones, placed

TEXT = b"def main():\n  f([1.5, -2], 3)\n  f([2.5, -3], 4)\n  g(7)\n  f([-3.25, +4], 5)\nend\n"


def test_numbers_of_lines_of_one_kind_come_as_columns():
    scan = Scan(TEXT)
    lines = np.flatnonzero(scan.kind == scan.kind[1])
    assert lines.tolist() == [1, 2, 4]
    for chosen in (lines, lines[:2]):
        found = scan.columns(chosen, [0, 1])
        assert found.values.tolist() == [[1.5, -2.0], [2.5, -3.0], [-3.25, 4.0]][: len(chosen)]
        assert found.decimals.tolist() == [[1, 0], [1, 0], [2, 0]][: len(chosen)]
        spans = zip(found.starts.ravel(), found.ends.ravel(), strict=True)
        texts = [TEXT[start:end] for start, end in spans]
        assert texts == [b"1.5", b"-2", b"2.5", b"-3", b"-3.25", b"+4"][: 2 * len(chosen)]
    assert scan.columns(lines, [2, 0]).values.tolist() == [[3.0, 1.5], [4.0, 2.5], [5.0, -3.25]]
    assert scan.numbers(3).values.tolist() == [[7.0]]
    assert scan.numbers(0).values.shape == (1, 0)


def test_a_place_where_no_number_begins_is_refused():
    with pytest.raises(CoreError, match="no number begins at byte 0"):
        read_numbers(TEXT, np.zeros((1, 1), dtype=np.int32))


def test_bytes_are_found_where_they_first_stand():
    assert find_bytes(TEXT, b"f([") == TEXT.find(b"f([")
    assert find_bytes(TEXT, b"nothing") is None


def test_values_for_all_rows_are_taken_over_and_others_put_into_a_copy():
    fixed, values = np.broadcast_to(np.nan, 3), np.array([1.0, 2.0, 3.0])
    assert placed(fixed, slice(0, 3), values) is values
    partly = placed(fixed, slice(1, 3), values[1:])
    assert np.isnan(fixed).all()
    assert partly[1:].tolist() == [2.0, 3.0]
    again = placed(partly, np.array([0]), np.array([9.0]))
    assert again is partly
    assert partly.tolist() == [9.0, 2.0, 3.0]


def test_factors_are_ones_or_not():
    assert all_ones(np.broadcast_to(1.0, (4, 6)))
    assert not all_ones(np.broadcast_to(0.5, (4, 6)))
    assert all_ones(np.ones(3))
    assert not all_ones(np.array([1.0, 2.0]))
    assert all_ones(np.ones((0, 6)))
