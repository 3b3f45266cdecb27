# SPDX-License-Identifier: Apache-2.0
"""What a subscriber can know of the publishers of a topic: who they are, and what was lost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

_WRAP = 2**32  # sequence numbers are uint32


@dataclass
class SequenceGap:
    """Messages of one publisher on one topic."""

    received: int = 0
    lost: int = 0
    last: int = -1


@dataclass
class SequenceGaps:
    """Counts messages by topic and publisher; gaps in their sequence numbers are lost messages.

    Either ROS throws away, without a word, what does not fit into a queue of a publisher or
    subscriber. Publishers number their messages, so gaps show. `advice` is what to look at where
    something was lost.

    Examples
    --------
    >>> gaps = SequenceGaps("the network is too slow")
    >>> for number in (1, 2, 6):
    ...     gaps.record("/scan", "/laser", number)
    >>> gaps.new_losses()
    ['3 messages of /scan from /laser were lost on the way (of 6): the network is too slow']
    >>> gaps.new_losses()
    []
    """

    advice: str
    lines: dict[tuple[str, str], SequenceGap] = field(default_factory=dict)
    _reported: dict[tuple[str, str], int] = field(default_factory=dict)

    def record(self, topic: str, publisher: str, number: int | None) -> None:
        """Count a message; its number is None where the type has no header."""
        line = self.lines.setdefault((topic, publisher), SequenceGap())
        line.received += 1
        if number is None:
            return
        missing = (number - line.last - 1) % _WRAP
        # A publisher that was started anew begins again.
        if line.last >= 0 and missing < _WRAP // 2:
            line.lost += missing
        line.last = number

    @property
    def received(self) -> int:
        """Number of messages received."""
        return sum(line.received for line in self.lines.values())

    @property
    def lost(self) -> int:
        """How many were lost."""
        return sum(line.lost for line in self.lines.values())

    def publishers(self, topic: str) -> list[str]:
        """Return the publishers of a topic."""
        return [publisher for name, publisher in self.lines if name == topic]

    def new_losses(
        self, name_of: Callable[[str, str], str] = lambda topic, publisher: publisher
    ) -> list[str]:
        """Return a sentence for each publisher of whom more was lost since it was asked last.

        `name_of` gives, of a topic and a publisher, its name for people.
        """
        sentences = []
        for (topic, publisher), line in self.lines.items():
            if line.lost > self._reported.get((topic, publisher), 0):
                self._reported[topic, publisher] = line.lost
                sentences.append(
                    f"{line.lost} messages of {topic} from {name_of(topic, publisher)} were lost "
                    f"on the way (of {line.lost + line.received}): {self.advice}"
                )
        return sentences
