# SPDX-License-Identifier: Apache-2.0
"""The parser of delimited text: exact numbers, exact stamps, and where a line is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse._core import parse_table


def stamps(*texts: str) -> list[int]:
    (column,) = parse_table("\n".join(texts).encode(), "s", ",", 1, "t")
    return [int(value) for value in column]


def test_stamps_are_exact_to_the_nanosecond() -> None:
    assert stamps("0", "1.5", "-0.000000001", "1700000000.123456789", "2e-3", "1.2e2") == [
        0, 1_500_000_000, -1, 1_700_000_000_123_456_789, 2_000_000, 120_000_000_000
    ]  # fmt: skip


def test_what_is_below_a_nanosecond_is_rounded_half_away_from_zero() -> None:
    assert stamps("0.0000000005", "-0.0000000005", "0.00000000049999") == [1, -1, 0]


def test_the_ends_of_64_bits_are_read_and_what_lies_beyond_is_refused() -> None:
    assert stamps("9223372036.854775807", "-9223372036.854775808") == [2**63 - 1, -(2**63)]
    for beyond in ("9223372036.854775808", "1e300", "-1e11"):
        with pytest.raises(ValueError, match="64-bit nanoseconds"):
            stamps(beyond)


def test_numbers_are_the_nearest_doubles() -> None:
    texts = ["0.1", "1e-310", "123456789.123456789", "-7", "+7.5", ".5", "5.", "1E5"]
    (column,) = parse_table("\n".join(texts).encode(), "f", ",", 1, "t")
    assert column.tolist() == [float(text) for text in texts]


@pytest.mark.parametrize(
    ("line", "what"),
    [
        (b"1,nan", "column 2 ('nan') is not finite"),
        (b"1,inf", "column 2 ('inf') is not finite"),
        (b"1,-Infinity", "is not finite"),
        (b"1,1e999", "is not finite"),
        (b"1,two", "column 2 ('two') is not a number"),
        (b"1,0x10", "is not a number"),
        (b"1,1_0", "is not a number"),
        (b"1,", "column 2 is empty, expected a number"),
        (b"1", "1 field, expected 2"),
        (b"1,2,3", "3 fields, expected 2"),
        (b"1,2 3", "is not a number"),
        (b"1,\xff", "is not a number"),
    ],
)
def test_a_wrong_line_is_named_with_its_column_and_text(line: bytes, what: str) -> None:
    text = b"a,b\n0,0\n# note\n\n" + line + b"\n9,9\n"
    with pytest.raises(ValueError, match=r"^name, line 5: ") as caught:
        parse_table(text, "ff", ",", 2, "name")
    assert what in str(caught.value)


def test_blank_lines_comments_spaces_and_line_ends_do_not_count() -> None:
    text = b"# head\r\n 1 , 2\r\n\r\n#3,3\n\t4,5 \n6,7"
    a, b = parse_table(text, "ff", ",", 1, "t")
    np.testing.assert_array_equal(a, [1, 4, 6])
    np.testing.assert_array_equal(b, [2, 5, 7])


def test_an_empty_field_is_nan_only_where_that_is_allowed() -> None:
    a, b = parse_table(b"1,\n,\n", "gg", ",", 1, "t")
    np.testing.assert_array_equal(a, [1.0, np.nan])
    assert np.isnan(b).all()


def test_text_keeps_its_letters_and_is_bounded() -> None:
    (names,) = parse_table("Łódź\nβ 2\n".encode(), "t", ",", 1, "t")
    assert names.tolist() == ["Łódź", "β 2"]
    with pytest.raises(ValueError, match="longer than 255 bytes"):
        parse_table(b"x" * 256, "t", ",", 1, "t")
    with pytest.raises(ValueError, match="not UTF-8"):
        parse_table(b"\xff\xfe", "t", ",", 1, "t")


def test_one_long_name_does_not_make_a_short_text_a_table_of_gigabytes() -> None:
    rows = 100_000
    text = b"0,a,b\n" * rows
    parse_table(text, "stt", ",", 1, "t")
    long = text + b"0,a," + b"b" * 250 + b"\n"
    with pytest.raises(ValueError, match=r"^t, line 100001: column 3 has a name of 250 characters"):
        parse_table(long, "stt", ",", 1, "t")
    _, _, names = parse_table(long.replace(b"b" * 250, b"b" * 150), "stt", ",", 1, "t")
    assert names[-1] == "b" * 150


def test_nothing_is_an_empty_table() -> None:
    for text in (b"", b"\n\n", b"# only a comment"):
        a, b = parse_table(text, "sf", ",", 1, "t")
        assert a.dtype == np.int64
        assert b.dtype == np.float64
        assert len(a) == len(b) == 0


@pytest.mark.parametrize(("kinds", "delimiter"), [("", ","), ("x", ","), ("f", ""), ("f", "::")])
def test_arguments_that_make_no_sense_are_refused(kinds: str, delimiter: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        parse_table(b"1", kinds, delimiter, 1, "t")


def test_random_tables_survive_writing_and_reading() -> None:
    rng = np.random.default_rng(9)
    for _ in range(50):
        values = rng.standard_normal(20) * 10.0 ** rng.integers(-300, 300, 20)
        stamp = rng.integers(-(2**62), 2**62, 20)
        rows = [
            f"{'-' if s < 0 else ''}{abs(s) // 10**9}.{abs(s) % 10**9:09d},{v!r}"
            for s, v in zip(stamp.tolist(), values.tolist(), strict=True)
        ]
        read_stamp, read_values = parse_table("\n".join(rows).encode(), "sf", ",", 1, "t")
        np.testing.assert_array_equal(read_stamp, stamp)
        np.testing.assert_array_equal(read_values, values)
