# SPDX-License-Identifier: Apache-2.0
"""CSV files: plain or gzipped, headers, line numbers in errors, texts that read back exactly."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from locfuse.io.csv_table import number_texts, read_bytes, read_table, stamp_texts, write_table
from locfuse.types import LogError


def write(folder: Path, data: bytes, name: str = "t.csv") -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def test_plain_and_gzipped_files_read_the_same(tmp_path: Path) -> None:
    text = b"stamp_s,x_m\n0.5,1\n1.5,2\n"
    for path in (write(tmp_path, text), write(tmp_path, gzip.compress(text), "t.csv.gz")):
        stamp, x = read_table(path).columns("sf")
        np.testing.assert_array_equal(stamp, [500_000_000, 1_500_000_000])
        np.testing.assert_array_equal(x, [1.0, 2.0])


def test_a_byte_order_mark_comments_and_spaces_do_not_count(tmp_path: Path) -> None:
    file = read_table(write(tmp_path, b"\xef\xbb\xbf# made by hand\n\n a , b \n1,2\n"))
    assert file.header == ("a", "b")
    assert file.first_line == 4
    assert [column.tolist() for column in file.columns("ff")] == [[1.0], [2.0]]


@pytest.mark.parametrize("data", [b"", b"\n\n", b"# nothing\n"])
def test_a_file_without_a_header_is_refused(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(LogError, match=r"t\.csv: empty file, expected a header"):
        read_table(write(tmp_path, data))


def test_a_column_named_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"t\.csv, line 2: column 'a' is named twice"):
        read_table(write(tmp_path, b"\na,b,a\n"))


def test_an_error_names_the_line_in_the_file_not_the_row(tmp_path: Path) -> None:
    file = read_table(write(tmp_path, b"a\n1\n\n# note\n2\n3\n"))
    assert str(file.error(0, "wrong")).endswith("t.csv, line 2: wrong")
    assert str(file.error(1, "wrong")).endswith("t.csv, line 5: wrong")
    assert str(file.error(2, "wrong")).endswith("t.csv, line 6: wrong")


def test_a_file_that_cannot_be_read_or_unpacked_is_named(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"absent\.csv: no such file"):
        read_bytes(tmp_path / "absent.csv")
    for data in (b"no gzip at all", gzip.compress(b"a,b\n" * 100)[:-20], b""):
        with pytest.raises(LogError, match=r"t\.csv\.gz"):
            read_table(write(tmp_path, data, "t.csv.gz"))
    with pytest.raises(LogError, match="is a folder; expected a file"):
        read_bytes(tmp_path)


def test_stamps_are_written_exactly() -> None:
    stamps = np.array([0, 1, -1, 1_700_000_000_123_456_789, -1_500_000_000], dtype=np.int64)
    assert stamp_texts(stamps) == [
        "0.000000000", "0.000000001", "-0.000000001", "1700000000.123456789", "-1.500000000"
    ]  # fmt: skip


def test_numbers_are_written_so_that_they_read_back_and_nan_is_empty() -> None:
    values = np.array([0.1, 1.0 / 3.0, 1e-320, -1e300, np.nan])
    texts = number_texts(values)
    assert texts[-1] == ""
    assert [float(text) for text in texts[:-1]] == values[:-1].tolist()


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    stamp = rng.integers(0, 2**62, 100)
    x = rng.standard_normal(100)
    write_table(tmp_path / "t.csv", ["stamp_s", "x_m"], [stamp_texts(stamp), number_texts(x)])
    read_stamp, read_x = read_table(tmp_path / "t.csv").columns("sf")
    np.testing.assert_array_equal(read_stamp, stamp)
    np.testing.assert_array_equal(read_x, x)


def test_columns_of_different_length_are_not_cut_in_silence(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="shorter"):
        write_table(tmp_path / "t.csv", ["a", "b"], [["1", "2"], ["3"]])
