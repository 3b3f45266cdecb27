# SPDX-License-Identifier: Apache-2.0
"""What a notebook shows of a run, and the tables that it gives to pandas."""

from __future__ import annotations

import base64
import csv
import io
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from locfuse.config.load import parse_config
from locfuse.report import notebook
from locfuse.report.results import write_results
from locfuse.run.run import run
from locfuse.types import NANOSECONDS, RunResult, Table


@pytest.fixture(scope="module")
def result() -> RunResult:
    config = {"simulation": {"duration_s": 5}, "watch_poses": True, "name": "<b>&"}
    return run(parse_config(config), seed=1)


def test_repr_is_a_line_and_no_table(result: RunResult) -> None:
    assert result.health is not None
    for value in (result, result.estimate, result.outcomes, result.health, result.log):
        assert len(repr(value)) < 400
        assert "\n" not in repr(value)
    figures = f"position_rmse_m={result.metrics['position_rmse_m']:.4g}"
    assert figures in repr(result)
    n = len(result.estimate)
    assert repr(result.estimate).startswith(
        f"Trajectory(stamp_ns=int64({n},), position=float64({n}, 2)"
    )
    assert f"source=str({len(result.outcomes)},)" in repr(result.outcomes)


def test_a_run_is_its_figures_and_its_path(result: RunResult) -> None:
    html = result._repr_html_()
    assert f"{result.metrics['position_rmse_m']:.3f} m</b>" in html
    for value in (result, result.estimate, result.outcomes):
        [data] = re.findall(r'src="data:image/png;base64,([^"]+)"', value._repr_html_())
        picture = Image.open(io.BytesIO(base64.b64decode(data)))
        assert picture.size[0] == 800
        assert len(picture.getcolors(1 << 20) or ()) > 20  # not a white sheet


def test_names_are_escaped(result: RunResult) -> None:
    odd = replace(result.outcomes, reason=result.outcomes.reason[:0])
    assert "<script>" not in notebook.html("<script>")
    assert "<b>&" not in notebook.html(odd)


def test_without_rows_there_are_words(result: RunResult) -> None:
    none = np.zeros(len(result.estimate), np.bool_)
    empty = replace(
        result.estimate, **{f: getattr(result.estimate, f)[none] for f in ("stamp_ns", "position")},
        heading=None, covariance=None,
    )  # fmt: skip
    assert "<img" not in empty._repr_html_()
    assert "Trajectory(" in empty._repr_html_()


def test_what_cannot_be_drawn_is_words(result: RunResult) -> None:
    assert result.estimate.covariance is not None
    unknown = replace(result.estimate, covariance=np.full_like(result.estimate.covariance, np.nan))
    nowhere = replace(result.estimate, position=np.full_like(result.estimate.position, np.inf))
    for odd in (unknown, nowhere):
        assert "<img" not in odd._repr_html_()
        assert "<img" not in replace(result, estimate=odd)._repr_html_()


def test_counts_and_zeros_are_shown_as_they_are(result: RunResult) -> None:
    metrics = {**result.metrics, "messages": 123_456_789, "position_rmse_m": 0.0}
    assert "messages=123456789" in repr(replace(result, metrics=metrics))
    assert "position_rmse_m=0" in repr(replace(result, metrics=metrics))


def test_without_matplotlib_it_says_what_to_install(
    result: RunResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notebook, "has_matplotlib", lambda: False)
    assert "locfuse[plots]" in result._repr_html_()


def test_pandas_has_the_columns_of_the_files(result: RunResult, tmp_path: Path) -> None:
    write_results(result, tmp_path)
    tables: dict[str, Table | None] = {"estimate": result.estimate, "outcomes": result.outcomes}
    tables.update(health=result.health, watched=result.watched)
    for stem, table in tables.items():
        assert table is not None
        frame = table.to_pandas()
        with (tmp_path / f"{stem}.csv").open(newline="") as file:
            header, *rows = csv.reader(file)
        named = [name for name in header if not (stem == "estimate" and name == "state")]
        assert [frame.index.name, *frame.columns] == named
        assert len(frame) == len(rows)
        last = dict(zip(header, rows[-1], strict=True))
        assert frame.index[-1] == float(last["stamp_s"])
        for name, value in frame.iloc[-1].items():
            text = last[str(name)]
            assert (
                value == text if isinstance(value, str) else np.isnan(value) or float(text) == value
            )


def test_stamps_of_pandas_are_seconds(result: RunResult) -> None:
    frame = result.estimate.to_pandas()
    assert frame.index[1] * NANOSECONDS == pytest.approx(result.estimate.stamp_ns[1])
    assert frame["x_m"].to_numpy() == pytest.approx(result.estimate.position[:, 0])


def test_without_pandas_it_says_what_to_install(
    result: RunResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        result.estimate.to_pandas()
