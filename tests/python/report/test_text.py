# SPDX-License-Identifier: Apache-2.0
"""Numbers as people read them."""

from __future__ import annotations

import pytest

from locfuse.report.text import count, percent, short, start_ns
from support_results import EPOCH_NS, make_result


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.0, "0.0 %"), (0.0004, "<0.1 %"), (0.45, "45.0 %"), (0.9996, ">99.9 %"), (1.0, "100.0 %")],
)
def test_a_share_is_never_rounded_to_nothing_or_all(share: float, text: str) -> None:
    assert percent(share) == text


def test_thousands_stand_apart() -> None:
    assert [count(n) for n in (7, 1234, 1234567)] == ["7", "1\u202f234", "1\u202f234\u202f567"]


def test_long_names_are_cut() -> None:
    assert short("a" * 24) == "a" * 24
    assert short("a" * 25) == "a" * 23 + "…"


def test_a_run_begins_with_its_first_message_or_estimate() -> None:
    assert start_ns(make_result(n=3)) == EPOCH_NS


def test_a_run_of_nothing_has_no_beginning() -> None:
    with pytest.raises(ValueError, match="no estimate and no message"):
        start_ns(make_result(n=0))
