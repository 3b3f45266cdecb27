# SPDX-License-Identifier: Apache-2.0
"""Monte Carlo localization as messages and scans arrive."""

from __future__ import annotations

import heapq
from collections import deque

from locfuse import _core
from locfuse.config.schema import RunConfig
from locfuse.live.rows import Message, effective_ns
from locfuse.run.mcl import mcl_on
from locfuse.run.start import grid_of
from locfuse.types import NANOSECONDS, ConfigError, Log

PATIENCE_NS = 250_000_000
LATEST = 20  # scans by which the lateness of the next is known

Radios = tuple[_core.AnchorMap, list[_core.Tag]]


class OnMap:
    """An `Mcl`, or a `SwitchingMcl`, fed in order of effective stamps.

    What arrives waits until odometry has come that far, or for a quarter of a second: then a scan
    finds the motion up to it, as `localize` sees to on a log. Scans come when their turn is over,
    which odometry does not wait for: so all wait as long as the latest of the last scans, up to
    ``history_s``. `found` says whether one place was left at some time, or the start was given.
    """

    def __init__(
        self,
        config: RunConfig,
        world: Log,
        radios: Radios,
        landmarks: _core.LandmarkSensor | None,
        begin_ns: int,
        start: _core.PoseEstimate | None,
    ) -> None:
        grid = grid_of(world)
        if grid is None:
            raise ConfigError("mcl needs a map, but the world has none; add 'map: FILE.yaml' to "
                              "its log.yaml, or remove mcl")  # fmt: skip
        self.found = start is not None
        self._mcl = mcl_on(config, grid, begin_ns, radios, landmarks, start)
        self._waiting: list[tuple[int, bool, int, Message | _core.LaserScan]] = []
        self._arrivals = 0
        self._newest_ns = begin_ns
        self._odometry_ns: int | None = None  # end of the newest motion
        self._driven_ns: int | None = None  # where it begins
        self._max_lateness_ns = round(config.history_s * NANOSECONDS)
        self._late_ns: deque[int] = deque(maxlen=LATEST)  # of scans behind that

    def on(self, item: Message | _core.LaserScan) -> list[_core.PoseEstimate]:
        """Take a message or a scan; return the estimates after scans whose turn it is now."""
        is_scan = isinstance(item, _core.LaserScan)
        stamp = item.stamp if isinstance(item, _core.LaserScan) else effective_ns(item)
        if isinstance(item, _core.Increment | _core.Velocity):
            self._odometry_ns = max(item.stamp, self._odometry_ns or item.stamp)
            self._driven_ns = max(stamp, self._driven_ns or stamp)
        elif is_scan:
            late_ns = 0 if self._driven_ns is None else max(0, self._driven_ns - stamp)
            if late_ns <= self._max_lateness_ns:
                self._late_ns.append(late_ns)
        self._newest_ns = max(self._newest_ns, stamp)
        heapq.heappush(self._waiting, (stamp, is_scan, self._arrivals, item))
        self._arrivals += 1
        late_ns = max(self._late_ns, default=0)
        due = self._newest_ns - max(PATIENCE_NS, late_ns) - 1
        if self._odometry_ns is not None and self._driven_ns is not None and self._late_ns:
            due = max(due, self._driven_ns - late_ns if late_ns else self._odometry_ns)
        estimates = []
        while self._waiting and self._waiting[0][0] <= due:
            now = heapq.heappop(self._waiting)[3]
            outcome = self._mcl.on(now)
            if isinstance(now, _core.LaserScan) and outcome.verdict is not _core.Verdict.STALE:
                self.found = self.found or self._mcl.ready
                estimates.append(self._mcl.estimate())
        return estimates

    def go_on_from(self, before: OnMap) -> None:
        """Take what still waits for its turn in the one before."""
        for _, _, _, item in sorted(before._waiting, key=lambda one: one[2]):
            self.on(item)
        self._late_ns.extend(before._late_ns)

    @property
    def ready(self) -> bool:
        """Whether one place is left, known well enough."""
        return self._mcl.ready

    @property
    def places(self) -> int:
        """How many places fit, each with a hundredth of the probability or more."""
        return sum(h.probability >= 0.01 for h in self._mcl.hypotheses)

    def health(self) -> _core.HealthReport:
        """Return how far the estimate may be trusted."""
        return self._mcl.health()

    @property
    def sources(self) -> list[_core.SourceStatus]:
        """What became of each source that weighs particles."""
        return list(self._mcl.sources)
