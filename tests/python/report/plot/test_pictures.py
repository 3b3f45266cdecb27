# SPDX-License-Identifier: Apache-2.0
"""What holds for all pictures: short and long runs, speed, equal files."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from locfuse.report import plot
from support_results import make_result

PICTURES = (plot.plot_path, plot.plot_errors, plot.plot_nis, plot.plot_outcomes)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_shortest_runs_are_drawn(n: int, tmp_path: Path) -> None:
    result = make_result(n=n, every_source=True)
    for draw in PICTURES:
        figure = draw(result)
        assert figure is not None
        plot.save(figure, tmp_path / "x.png")


def test_a_hundred_thousand_messages_are_drawn_in_seconds(tmp_path: Path) -> None:
    result = make_result(n=25_000, rejected={"A3": (100.0, 1500.0)})
    assert len(result.outcomes) == 100_000
    begin = time.perf_counter()
    for draw in PICTURES:
        figure = draw(result)
        assert figure is not None
        plot.save(figure, tmp_path / f"{draw.__name__}.png")
        assert (tmp_path / f"{draw.__name__}.png").stat().st_size < 500_000
    # About one second on a slow core; ten leaves room for a loaded machine, not for 100 000 marks.
    assert time.perf_counter() - begin < 10.0


def test_equal_runs_give_equal_files(tmp_path: Path) -> None:
    for draw in PICTURES:
        for name in ("a.png", "b.png"):
            figure = draw(make_result(rejected={"A1": (1.0, 9.0), "A2": (3.0, 12.0)}))
            assert figure is not None
            plot.save(figure, tmp_path / name)
        first = (tmp_path / "a.png").read_bytes()
        assert first == (tmp_path / "b.png").read_bytes()
        assert b"atplotlib" not in first  # nor does it change with the version of the plotter
