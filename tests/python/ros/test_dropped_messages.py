# SPDX-License-Identifier: Apache-2.0
"""Numbers of publishers, and what they say of messages that were lost."""

from __future__ import annotations

from locfuse.ros.dropped_messages import SequenceGaps


def received(*numbers: int | None) -> SequenceGaps:
    lines = SequenceGaps("hurry")
    for number in numbers:
        lines.record("scan", "laser", number)
    return lines


def test_gaps_are_what_was_lost() -> None:
    lines = received(3, 4, 7, 8, 10)
    assert (lines.received, lines.lost) == (5, 3)


def test_what_came_before_the_first_was_not_lost() -> None:
    assert received(1_000, 1_001).lost == 0


def test_numbers_that_begin_again_are_of_a_publisher_started_anew() -> None:
    assert received(500, 501, 1, 2).lost == 0


def test_numbers_go_on_after_the_largest() -> None:
    assert received(2**32 - 2, 2**32 - 1, 0, 2).lost == 1


def test_without_numbers_nothing_is_known_to_be_lost() -> None:
    lines = received(None, None)
    assert (lines.received, lines.lost) == (2, 0)


def test_publishers_count_by_themselves() -> None:
    lines = SequenceGaps("hurry")
    for publisher, number in (("a", 1), ("b", 50), ("a", 2), ("b", 52)):
        lines.record("scan", publisher, number)
    assert lines.publishers("scan") == ["a", "b"]
    assert lines.new_losses(lambda topic, publisher: publisher.upper()) == [
        "1 messages of scan from B were lost on the way (of 3): hurry"
    ]


def test_gaps_are_reported_once() -> None:
    lines = received(1, 3)
    assert len(lines.new_losses()) == 1
    assert lines.new_losses() == []
    lines.record("scan", "laser", 5)
    assert lines.new_losses() == [
        "2 messages of scan from laser were lost on the way (of 5): hurry"
    ]
