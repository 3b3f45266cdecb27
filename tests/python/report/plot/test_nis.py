# SPDX-License-Identifier: Apache-2.0
"""The picture of the NIS: the band of the right freedom, and every rejected message in it."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse.report import plot
from locfuse.report.plot.style import MEAN, REJECTED
from support_figures import legend_of, line_of
from support_results import make_result


def test_nis_has_a_panel_per_compared_source_with_the_band_of_its_freedom() -> None:
    figure = plot.plot_nis(make_result(every_source=True))

    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert [t.split(":")[0] for t in titles] == [
        "ranges, 1 degree of freedom",
        "positions, 2 degrees of freedom",
        "poses, 3 degrees of freedom",
    ]
    # Of the chi-square tables: 2.5 % and 97.5 %.
    tables = [(0.000982, 5.024), (0.0506, 7.378), (0.2158, 9.348)]
    for expected, axes in zip(tables, figure.axes, strict=True):
        extent = axes.patches[0].get_path().get_extents(axes.patches[0].get_patch_transform())
        assert (extent.y0, extent.y1) == pytest.approx(expected, rel=1e-3)
        assert axes.get_yscale() == "log"


def test_nis_draws_every_rejected_message_in_the_warning_colour() -> None:
    result = make_result(rejected={"A2": (3.0, 12.0)})
    figure = plot.plot_nis(result)

    gated = result.outcomes.verdict == "gated"
    assert line_of(figure, 0, REJECTED)[1] == pytest.approx(result.outcomes.nis[gated])
    (axes,) = figure.axes
    assert axes.get_ylim()[1] > result.outcomes.nis.max()
    assert "11.2 % rejected" in axes.get_title(loc="left")
    assert "rejected by the gate" in legend_of(figure)
    assert "rejected by the gate" not in legend_of(plot.plot_nis(make_result()))


def test_mean_of_nis_is_that_of_the_fused_messages_only() -> None:
    result = make_result(n=600, rejected={"A2": (0.0, 60.0)})
    _, mean = line_of(plot.plot_nis(result), 0, MEAN)

    fused = result.outcomes.nis[result.outcomes.verdict == "fused"]
    assert mean.mean() == pytest.approx(fused.mean(), rel=0.01)
    assert len(mean) == 60


def test_nis_that_was_never_computed_is_said_in_a_sentence() -> None:
    result = make_result(anchors=())
    (text,) = plot.plot_nis(result).texts
    assert "no NIS" in text.get_text()


def test_share_inside_the_band_is_that_of_the_messages() -> None:
    result = make_result()
    nis = result.outcomes.nis
    share = 100 * float(np.mean((nis > 0.000982) & (nis < 5.0239)))
    assert f"{share:.1f} % of 800 inside" in plot.plot_nis(result).axes[0].get_title(loc="left")
