# SPDX-License-Identifier: Apache-2.0
"""Messages whose stamps are ahead of the clock, which wait until it has come that far."""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

from locfuse.types import NANOSECONDS

FUTURE_NS = NANOSECONDS // 2  # a stamp that much ahead of the clock waits for it
PATIENCE_NS = 5 * NANOSECONDS  # a stamp that much ahead is wrong
MOST = 5_000  # messages that wait
LASTING = 10  # checks in a row with waiting messages, then reported


class EarlyMessage(Exception):  # noqa: N818 - no error: it waits
    """A message came before the clock had reached its stamp."""

    def __init__(self, stamp_ns: int) -> None:
        super().__init__()
        self.due_ns = stamp_ns - FUTURE_NS


class Waiting(NamedTuple):
    """A message that waits, as it was handed to `Adapter.on`."""

    due_ns: int
    source: str
    topic: str
    message: Any


class EarlyMessages:
    """Keeps messages until they are due.

    Simulated time reaches a busy node later than the messages that were stamped by it. A clock of
    another machine that is wrong by more than moments is another problem, and reported.

    Examples
    --------
    >>> early = EarlyMessages()
    >>> early.keep(EarlyMessage(2_000_000_000), "odometry", "odom", "a message")
    True
    >>> early.due(1_000_000_000)
    []
    >>> [one.topic for one in early.due(1_500_000_000)]
    ['odom']
    """

    def __init__(self) -> None:
        self._waiting: list[Waiting] = []
        self._looks = 0

    def keep(self, early: EarlyMessage, source: str, topic: str, message: Any) -> bool:
        """Keep a message; return whether there was room."""
        if len(self._waiting) >= MOST:
            return False
        self._waiting.append(Waiting(early.due_ns, source, topic, message))
        return True

    def due(self, now_ns: int) -> list[Waiting]:
        """Return those whose time has come, as they came, and keep them no longer."""
        if not self._waiting:
            return []
        found = [one for one in self._waiting if one.due_ns <= now_ns]
        if found:
            self._waiting = [one for one in self._waiting if one.due_ns > now_ns]
        return found

    def clear(self) -> Counter[str]:
        """Forget all of them; return how many of which source there were."""
        forgotten = Counter(one.source for one in self._waiting)
        self._waiting = []
        return forgotten

    def last(self) -> str | None:
        """Look whether messages wait all the time; return a topic of theirs if so."""
        self._looks = self._looks + 1 if self._waiting else 0
        return self._waiting[0].topic if self._looks >= LASTING else None
