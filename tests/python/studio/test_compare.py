# SPDX-License-Identifier: Apache-2.0
"""The table that compares runs has a row for each figure that they have."""

from __future__ import annotations

import re

import pytest

from locfuse.config.load import parse_config
from locfuse.run.run import run
from locfuse.studio.compare import FIGURES, compared, value_of


def test_every_figure_of_a_run_has_its_row() -> None:
    metrics = run(parse_config({"simulation": {"duration_s": 5}})).metrics

    table = compared(["one"], [metrics])

    assert re.findall(r'data-figure="(\w+)"', table) == [figure.key for figure in FIGURES]
    computing = next(figure for figure in FIGURES if figure.key == "computing")
    expected = metrics["messages"] / metrics["messages_per_second"]
    assert value_of(computing, metrics) == pytest.approx(expected)
