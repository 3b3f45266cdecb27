# SPDX-License-Identifier: Apache-2.0
"""CSV files with a header, plain or gzipped, read and written column by column."""

from __future__ import annotations

import gzip
import io
import itertools
import os
import re
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from locfuse._core import parse_table
from locfuse.io.whole import write_whole
from locfuse.types import NANOSECONDS, FloatArray, LogError, StampArray, shown

MAX_UNPACKED = 1 << 30  # bytes that a packed file of anyone becomes: tables, capsules, bags
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_NEEDS_QUOTES = re.compile(r'[,"\r\n]')


@dataclass(frozen=True)
class CsvTable:
    """A file whose header is read and whose rows are not yet.

    `path` is for error messages; `data` is the whole file, unpacked. `first_line` is the line of
    the first row, counting from 1.
    """

    path: Path
    data: bytes
    header: tuple[str, ...]
    first_line: int

    def columns(self, kinds: str) -> list[NDArray[Any]]:
        """Parse the rows; `kinds` has one letter of `parse_table` per header name."""
        return parse(self.data, kinds, ",", self.first_line, self.path)

    def error(self, row: int, text: str) -> LogError:
        """Return the error that names the line of a row, counting rows from 0."""
        return LogError(f"{self.path}, line {line_of_row(self.data, self.first_line, row)}: {text}")


def parse(data: bytes, kinds: str, delimiter: str, first_line: int, path: Path) -> list[Any]:
    """Call `parse_table`; what it refuses is a LogError."""
    try:
        return list(parse_table(data, kinds, delimiter, first_line, str(path)))
    except ValueError as error:
        raise LogError(str(error)) from error


def read_bytes(path: Path) -> bytes:
    """Return a file, unpacked if its name ends in ``.gz``, without a byte order mark.

    Raises LogError if it is missing, no file, or cannot be read or unpacked.
    """
    refuse_device(path)
    try:
        data = path.read_bytes()
        data = unpacked(data) if path.suffix == ".gz" else data
    except FileNotFoundError as error:
        raise LogError(f"{path}: no such file") from error
    except IsADirectoryError as error:
        raise LogError(f"{path}: is a folder; expected a file") from error
    except (OSError, EOFError, ValueError, zlib.error) as error:  # a name may be none
        raise LogError(f"{path}: cannot be read: {error}") from error
    return data.removeprefix(BYTE_ORDER_MARK)


def refuse_device(path: Path) -> None:
    """Raise LogError for what is there and neither file nor folder: reading it may never end."""
    if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):
        raise LogError(f"{path}: is a device or a pipe; expected a file")


def unpacked(data: bytes) -> bytes:
    """Return what gzip packed; raise ValueError if that is more than `MAX_UNPACKED`."""
    found = io.BytesIO()
    with gzip.open(io.BytesIO(data)) as packed:
        while block := packed.read(1 << 20):  # asked for all, it takes the memory at once
            if found.tell() + len(block) > MAX_UNPACKED:
                raise ValueError(f"it unpacks to more than {MAX_UNPACKED} bytes; unpack it "
                                 "beforehand")  # fmt: skip
            found.write(block)
    return found.getvalue()


def read_table(path: Path) -> CsvTable:
    """Read a file and its header.

    Raises LogError if the file cannot be read, has no header, or names a column twice.
    """
    data = read_bytes(path)
    line, text = next(_rows(data), (0, b""))
    if line == 0:
        raise LogError(f"{path}: empty file, expected a header")
    names = tuple(part.strip() for part in text.decode("utf-8", "replace").split(","))
    given: set[str] = set()
    for name in names:
        if name in given:
            raise LogError(f"{path}, line {line}: column {shown(name)} is named twice")
        given.add(name)
    return CsvTable(path, data, names, line + 1)


def line_of_row(data: bytes, first_line: int, row: int) -> int:
    """Return the line (from 1) of a row (from 0) of a table whose rows begin at `first_line`."""
    lines = (line for line, _ in _rows(data) if line >= first_line)
    return next(itertools.islice(lines, row, None))


def stamp_texts(stamp_ns: StampArray) -> list[str]:
    """Write nanoseconds as seconds with 9 decimals, exactly."""
    return [
        f"{'-' * (stamp < 0)}{abs(stamp) // NANOSECONDS}.{abs(stamp) % NANOSECONDS:09d}"
        for stamp in stamp_ns.tolist()
    ]


def number_texts(values: FloatArray) -> list[str]:
    """Write float64 with the fewest digits that read back as the same number; NaN is empty."""
    return ["" if value != value else repr(value) for value in values.tolist()]


def column_texts(name: str, values: NDArray[Any]) -> list[str]:
    """Write a column: stamps, whose name ends in ``_ns``, as seconds, numbers or names."""
    if name.endswith("_ns"):
        return stamp_texts(values)
    return number_texts(values) if values.dtype.kind == "f" else [*map(str, values.tolist())]


def write_table(path: Path, header: Sequence[str], columns: Iterable[Sequence[str]]) -> None:
    """Write columns of text as CSV, whole or not at all; texts are quoted where RFC 4180 says."""
    rows = map(",".join, zip(*map(_quoted, columns), strict=True))
    text = "\n".join([",".join(_quoted(header)), *rows, ""])
    write_whole(path, text)


def _quoted(texts: Sequence[str]) -> Sequence[str]:
    if not _NEEDS_QUOTES.search("\0".join(texts)):
        return texts
    return [
        '"' + text.replace('"', '""') + '"' if _NEEDS_QUOTES.search(text) else text
        for text in texts
    ]


def _rows(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield number (from 1) and text of the lines that `parse_table` does not skip."""
    begin, line = 0, 1
    while begin < len(data):
        end = data.find(b"\n", begin)
        text = data[begin : end if end >= 0 else len(data)]
        if text.strip() and not text.startswith(b"#"):
            yield line, text
        begin, line = begin + len(text) + 1, line + 1
