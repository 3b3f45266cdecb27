# SPDX-License-Identifier: Apache-2.0
"""What a subscriber can know of a topic's publishers: who they are, and what of theirs was lost."""

from __future__ import annotations

from dataclasses import dataclass, field

_WRAP = 2**32  # sequence numbers are uint32


@dataclass
class Line:
    """Messages of one publisher on one topic."""

    received: int = 0
    lost: int = 0
    last: int = -1


@dataclass
class Lines:
    """Counts messages by topic and publisher; gaps in their sequence numbers are lost messages.

    ROS 1 throws away, without a word, what does not fit into a queue of a publisher or subscriber.
    Publishers number what they publish, so the gaps tell.

    Examples
    --------
    >>> lines = Lines()
    >>> for number in (1, 2, 6):
    ...     lines.heard("/scan", "/laser", number)
    >>> lines.news()
    ['3 messages of /scan from /laser were lost on the way (of 6): the network or this computer is \
too slow for them, or queue_size of their publisher too small']
    >>> lines.news()
    []
    """

    lines: dict[tuple[str, str], Line] = field(default_factory=dict)
    _told: dict[tuple[str, str], int] = field(default_factory=dict)

    def heard(self, topic: str, publisher: str, number: int | None) -> None:
        """Count a message; its number is None where the type has no header."""
        line = self.lines.setdefault((topic, publisher), Line())
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
        """How many messages were heard."""
        return sum(line.received for line in self.lines.values())

    @property
    def lost(self) -> int:
        """How many were lost."""
        return sum(line.lost for line in self.lines.values())

    def publishers(self, topic: str) -> list[str]:
        """Return who was heard on a topic."""
        return [publisher for name, publisher in self.lines if name == topic]

    def news(self) -> list[str]:
        """Return a sentence for each publisher of whom more was lost since it was asked last."""
        sentences = []
        for (topic, publisher), line in self.lines.items():
            if line.lost > self._told.get((topic, publisher), 0):
                self._told[topic, publisher] = line.lost
                sentences.append(
                    f"{line.lost} messages of {topic} from {publisher} were lost on the way (of "
                    f"{line.lost + line.received}): the network or this computer is too slow for "
                    "them, or queue_size of their publisher too small"
                )
        return sentences
