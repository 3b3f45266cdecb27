# SPDX-License-Identifier: Apache-2.0
"""Who was rejected when: messages by origin, and unbroken series of rejections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse.eval.verdicts import MessageRow, Stretch, message_rows, rejected_stretches
from support_results import EPOCH_NS, make_result


def _row(verdict: list[str]) -> MessageRow:
    return MessageRow("ranges", "A", np.arange(len(verdict)) * 10, np.array(verdict))


def test_rows_come_by_source_and_anchors_in_natural_order() -> None:
    rows = message_rows(make_result(every_source=True).outcomes)
    assert [row.label for row in rows] == [
        "odometry",
        "anchor A1",
        "anchor A2",
        "anchor A3",
        "anchor A10",
        "positions",
        "poses",
    ]
    assert [len(row.stamp_ns) for row in rows] == [200] * 7


def test_an_anchor_that_is_called_anchor_is_not_called_so_twice() -> None:
    assert replace(_row(["fused"]), anchor="Anchor 7").label == "Anchor 7"
    seen = replace(_row(["fused"]), source="landmark_sightings", anchor="NE")
    assert seen.label == "landmark NE"
    assert replace(seen, anchor="landmark 3").label == "landmark 3"


def test_rows_are_in_order_of_time_when_messages_came_late() -> None:
    outcomes = make_result(n=5, anchors=("A",), rejected={"A": (0.1, 0.3)}).outcomes
    turned = np.array([0, 2, 1, 4, 3])
    late = replace(outcomes, **{k: v[turned] for k, v in vars(outcomes).items()})

    (row,) = message_rows(late)

    assert np.array_equal(row.stamp_ns, outcomes.stamp_ns)
    assert list(row.verdict) == ["fused", "gated", "gated", "fused", "fused"]


def test_no_message_makes_no_row() -> None:
    assert message_rows(make_result(anchors=()).outcomes) == []


def test_stretches_are_unbroken_and_in_order_of_time() -> None:
    row = _row(["gated", "gated", "fused", "gated", "gated", "gated", "stale", "gated"])

    assert rejected_stretches(row) == [Stretch(2, 0, 10), Stretch(3, 30, 50), Stretch(1, 70, 70)]
    assert row.rejected == 6
    assert row.rejected_share == 0.75


def test_stretches_of_an_anchor_are_when_it_was_rejected() -> None:
    rows = message_rows(make_result(rejected={"A2": (3.0, 12.0)}).outcomes)
    (row,) = [row for row in rows if row.anchor == "A2"]
    second = 1_000_000_000
    assert rejected_stretches(row) == [
        Stretch(90, EPOCH_NS + 3 * second, EPOCH_NS + 119 * second // 10)
    ]


def test_a_row_without_rejections_has_no_stretch() -> None:
    assert rejected_stretches(_row(["fused", "fused", "stale"])) == []


def test_an_anchor_is_suspect_from_a_tenth_of_its_messages_on() -> None:
    assert _row(["gated"] + ["fused"] * 9).suspect
    assert not _row(["gated"] + ["fused"] * 10).suspect
