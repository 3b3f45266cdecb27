# SPDX-License-Identifier: Apache-2.0
"""A log that speaks again: its messages on topics, in the order in which they arrived."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from locfuse.config.load import load_config
from locfuse.config.schema import RunConfig
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.ros.parameters import LARGEST, Parameter, folder_of
from locfuse.run.run import load_log
from locfuse.types import NANOSECONDS, ConfigError

PARAMETERS = (
    Parameter("config", "text", "", None, None, "path of a run's YAML: its log, topics and frames"),
    Parameter("log", "text", "", None, None, "log folder or bag instead of what the YAML names"),
    Parameter("speed", "float", 1.0, 0.0, LARGEST, "times as fast as recorded; 0: as all can"),
    Parameter("clock", "bool", True, None, None, "stamps as recorded, and /clock; else of today"),
    Parameter("loop", "bool", False, None, None, "begin anew at the end: the clock goes back"),
    Parameter("wait_s", "float", 10.0, 0.0, LARGEST, "at most, for somebody who listens [s]"),
)
QUIET_S = 1.0  # without another listener, after which it begins
SETTLE_S = 0.3  # the world is known before the first message comes
TICK_NS = 5_000_000  # /clock ticks so often in the log's time,
TICK_S = 0.002  # or in real time where that is longer
FIRST_NS = 1000 * NANOSECONDS  # where a log begins that begins at 0: to ROS, 0 is no time


class Step(NamedTuple):
    """What to publish next: `due_s` seconds after the begin, by a clock that shows `clock_ns`.

    Without a publication it is the clock itself.
    """

    due_s: float
    clock_ns: int
    publication: Publication | None


class LogPlayer:
    """Says what is to be published when: the node without its ROS.

    `given` are values of the `PARAMETERS`; `warn` is called with a sentence where stamps are not
    those of the log. `world` is known from the start, latched; `topics` has one of each topic.
    Raises ConfigError or LogError if neither configuration nor log is named, or one cannot be read.
    """

    def __init__(self, given: Mapping[str, Any], warn: Callable[[str], object]) -> None:
        if not (given["config"] or given["log"]):
            raise ConfigError("nothing to play; set log to a log folder, or config to a YAML that "
                              "names one")  # fmt: skip
        config = load_config(given["config"]) if given["config"] else RunConfig()
        if given["log"]:
            config = config.model_copy(update={"log": given["log"], "simulation": None})
        log = load_log(config, folder_of(given["config"]), config.seed)
        self._speed, self._loop = given["speed"], given["loop"]
        first = next(in_order_of_arrival(log, config.ros), None)
        if first is None:
            raise ConfigError("the log has no message that ros.topics has a topic for")
        shift_ns = _shift(first.arrival_ns, given["clock"], warn)
        self._arrivals = list(in_order_of_arrival(log, config.ros, shift_ns))
        self.world = world_of(log, config.ros)
        by_topic = {p.topic: p for _, p in self._arrivals} | {p.topic: p for p in self.world}
        self.topics = list(by_topic.values())

    def steps(self) -> Iterator[Step]:
        """Yield what to publish: the clock up to a message, then it; once, or for ever."""
        tick_ns = max(TICK_NS, round(self._speed * TICK_S * NANOSECONDS))
        before_s = 0.0
        while True:
            first_ns = now_ns = self._arrivals[0].arrival_ns
            due_s = before_s
            for arrival_ns, publication in self._arrivals:
                while now_ns < arrival_ns:  # silence: the clock goes on
                    now_ns = min(now_ns + tick_ns, arrival_ns)
                    if self._speed > 0.0:
                        due_s = before_s + (now_ns - first_ns) / NANOSECONDS / self._speed
                    yield Step(due_s, now_ns, None)
                yield Step(due_s, now_ns, publication)
            if not self._loop:
                return
            before_s = due_s


class Patience:
    """Waits until somebody listens, and for a second nobody more does; but not for ever.

    Examples
    --------
    >>> patience = Patience(10.0, now_s=0.0)
    >>> [patience.is_over(2, now_s=s) for s in (0.1, 0.9, 1.2)]
    [False, False, True]
    """

    def __init__(self, most_s: float, now_s: float) -> None:
        self._end_s = now_s + most_s
        self._listeners, self._since_s = 0, now_s

    def is_over(self, listeners: int, now_s: float) -> bool:
        """Return whether to begin, with as many listeners now."""
        if listeners != self._listeners:
            self._listeners, self._since_s = listeners, now_s
        return now_s >= self._end_s or (listeners > 0 and now_s - self._since_s >= QUIET_S)


def _shift(first_ns: int, clock: bool, warn: Callable[[str], object]) -> int:
    """Return how much later stamps are published than they are in a log that begins then."""
    if not clock:
        return time.time_ns() - first_ns
    if first_ns >= NANOSECONDS:
        return 0
    warn(f"the log begins at {first_ns / NANOSECONDS:g} s, which is no time to ROS; all stamps "
         f"are {FIRST_NS // NANOSECONDS} s later")  # fmt: skip
    return FIRST_NS
