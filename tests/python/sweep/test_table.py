# SPDX-License-Identifier: Apache-2.0
"""The folder of a sweep: whole batches or none, one sweep and no other."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from locfuse.sweep.table import ABOUT, PARTS, TABLE, Folder, difference, trials_of
from locfuse.sweep.trial import INSTANTS, Row, Trial, empty_row
from locfuse.sweep.vary import Axis
from locfuse.types import ConfigError

AXES = (Axis("a.number", (1, 2)), Axis("a.word", ("x", "y")), Axis("a.draw", (), 0.0, 1.0))
ABOUT_IT: dict[str, Any] = {"trials": 3, "config": {"a": {"b": 1}}}


def row(index: int) -> Row:
    made = empty_row(AXES, Trial(index, 10 + index, (1 + index % 2, "xy"[index % 2], 0.5)))
    return {**made, "position_rmse_m": 0.25 * index, "nees_at": [1.0] * INSTANTS}


def test_rows_become_columns_in_order_of_the_trials() -> None:
    failed = {**row(2), "error": "ValueError: no", "nees_at": None, "position_rmse_m": None}
    found = trials_of([failed, row(0), row(1)], AXES)
    assert found["trial"].tolist() == [0, 1, 2]
    assert found["a.number"].dtype == np.int64
    assert found["a.word"].tolist() == ["x", "y", "x"]
    assert found["a.draw"].tolist() == [0.5] * 3
    assert found["position_rmse_m"][:2].tolist() == [0.0, 0.25]
    assert np.isnan(found["position_rmse_m"][2])
    assert found["nees_at"].shape == (3, INSTANTS)
    assert found.failed.tolist() == [False, False, True]
    assert len(found.some(found.failed)) == 1


def test_what_was_added_is_there_again(tmp_path: Path) -> None:
    folder = Folder(tmp_path, ABOUT_IT, AXES)
    folder.add([row(1)])
    folder.add([row(0)])
    again = Folder(tmp_path, ABOUT_IT, AXES)
    assert sorted(again.rows, key=lambda r: int(r["trial"])) == [row(0), row(1)]
    again.put_together()
    assert list((tmp_path / PARTS).iterdir()) == []
    assert Folder(tmp_path, ABOUT_IT, AXES).rows == [row(0), row(1)]
    assert pq.read_table(tmp_path / TABLE).column("trial").to_pylist() == [0, 1]


def test_a_batch_that_was_being_written_is_not_there(tmp_path: Path) -> None:
    Folder(tmp_path, ABOUT_IT, AXES).add([row(0)])
    (tmp_path / PARTS / ".part-1a2b3c4d.parquet").write_bytes(b"PAR1")
    assert Folder(tmp_path, ABOUT_IT, AXES).rows == [row(0)]
    assert [file.name for file in (tmp_path / PARTS).iterdir()] == ["000000000.parquet"]


def test_a_table_that_was_written_before_its_parts_were_removed_counts_once(tmp_path: Path) -> None:
    folder = Folder(tmp_path, ABOUT_IT, AXES)
    folder.add([row(0)])
    part = next((tmp_path / PARTS).iterdir())
    kept = part.read_bytes()
    folder.put_together()
    part.write_bytes(kept)
    assert Folder(tmp_path, ABOUT_IT, AXES).rows == [row(0)]


def test_many_parts_are_put_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("locfuse.sweep.table.MAX_PARTS", 2)
    folder = Folder(tmp_path, ABOUT_IT, AXES)
    for k in range(4):
        folder.add([row(k)])
    assert len(list((tmp_path / PARTS).iterdir())) == 1
    assert len(Folder(tmp_path, ABOUT_IT, AXES).rows) == 4


def test_the_folder_of_another_sweep_is_refused_with_the_place(tmp_path: Path) -> None:
    Folder(tmp_path, ABOUT_IT, AXES)
    other = {"trials": 3, "config": {"a": {"b": 2}}}
    with pytest.raises(ConfigError, match=r"its config\.a\.b is 1 instead of 2; choose another"):
        Folder(tmp_path, other, AXES)
    assert json.loads((tmp_path / ABOUT).read_text()) == ABOUT_IT


def test_a_sweep_may_grow_and_not_shrink(tmp_path: Path) -> None:
    Folder(tmp_path, ABOUT_IT, AXES)
    Folder(tmp_path, {**ABOUT_IT, "trials": 5}, AXES)
    with pytest.raises(ConfigError, match="with 5 trials; ask for at least as many"):
        Folder(tmp_path, ABOUT_IT, AXES)


def test_a_damaged_part_is_named(tmp_path: Path) -> None:
    Folder(tmp_path, ABOUT_IT, AXES).add([row(0)])
    part = next((tmp_path / PARTS).iterdir())
    part.write_bytes(part.read_bytes()[:100])
    with pytest.raises(ConfigError, match=rf"{part}: cannot be read .*remove it"):
        Folder(tmp_path, ABOUT_IT, AXES)


def test_a_part_with_other_columns_is_named(tmp_path: Path) -> None:
    Folder(tmp_path, ABOUT_IT, AXES).add([row(0)])
    with pytest.raises(ConfigError, match="other columns"):
        Folder(tmp_path, ABOUT_IT, AXES[:1])


def test_a_folder_about_nothing_is_refused(tmp_path: Path) -> None:
    (tmp_path / ABOUT).write_text("{")
    with pytest.raises(ConfigError, match="no JSON"):
        Folder(tmp_path, ABOUT_IT, AXES)


def test_without_pyarrow_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ConfigError, match=r"pip install 'locfuse\[sweep\]'"):
        Folder(tmp_path, ABOUT_IT, AXES)


def test_the_first_difference_is_reported() -> None:
    assert difference({"a": [1]}, {"a": [1]}) is None
    assert difference({"a": 1}, {"a": 1, "b": 2}) == "b is null instead of 2"
    assert difference(1, 2) == "content is 1 instead of 2"
