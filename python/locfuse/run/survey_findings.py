# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a survey, and which further drive would help."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from locfuse import _core
from locfuse.run.messages import Messages
from locfuse.run.survey_frame import Framed
from locfuse.run.survey_result import SurveyedAnchor, SurveyResult
from locfuse.types import NANOSECONDS, Log

# Without odometry, of one tag.
OPEN_SIDE = ("without odometry one tag does not show whether all is mirrored: compare the side of "
             "one anchor")  # fmt: skip
_TOO_MANY = 0.3  # of all ranges rejected: the drive is in doubt


def moved(
    found: _core.Survey, messages: Messages, log: Log, framed: Framed, names: list[str]
) -> dict[str, str]:
    """Return a sentence for each anchor whose ranges are wrong from one time on, or until then."""
    least, share = 20, 0.8
    verdict = np.asarray(found.smoothed.verdict)
    wrong = verdict == int(_core.Verdict.GATED)
    poses = np.asarray(found.smoothed.poses)
    stamps = np.asarray(found.smoothed.stamp_ns)
    sentences = {}
    for name in framed.names:
        mine = np.flatnonzero((messages.source == "ranges") & (messages.anchor == name)
                              & (messages.stamp_ns >= stamps[0]))  # fmt: skip
        bad = wrong[mine]
        if bad.sum() < least:
            continue
        cuts = np.cumsum(bad) / np.maximum(bad.sum(), 1) - np.cumsum(~bad) / max((~bad).sum(), 1)
        at = int(np.argmax(np.abs(cuts)))
        if abs(cuts[at]) < share:
            continue  # here and there
        rows = mine[bad]
        arms = np.array([log.tags.get(tag, (0.0, 0.0, 0.0)) for tag in messages.tag[rows]])
        heading = np.interp(messages.stamp_ns[rows], stamps, np.unwrap(poses[:, 2]))
        x, y = (np.interp(messages.stamp_ns[rows], stamps, poses[:, k]) for k in (0, 1))
        c, s = np.cos(heading), np.sin(heading)
        tags = np.column_stack([x + c * arms[:, 0] - s * arms[:, 1],
                                y + s * arms[:, 0] + c * arms[:, 1], arms[:, 2]])  # fmt: skip
        some = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), 60)).astype(int))
        radio = next(a.anchor for a in found.anchors if names[a.anchor.id] == name)
        ranges = (log["ranges"]["range_m"][messages.row[rows]] - radio.offset) / radio.scale
        z = float(framed.position[framed.names.index(name), 2])
        there = _core.locate(tags[some], ranges[some], 0.3, height=z, loss="cauchy")
        when = (messages.stamp_ns[mine[at]] - stamps[0]) / NANOSECONDS
        text = f"ranges of {name} are wrong "
        text += (f"from {when:.0f} s on: was it moved?" if cuts[at] < 0.0
                 else f"until {when:.0f} s: was it moved then?")  # fmt: skip
        spots = [np.append(one.position, z) for one in there.hypotheses[:2]]
        if spots:
            at_xy = (f"({x:.1f}, {y:.1f})" for x, y, _ in framed.moved(np.array(spots)).tolist())
            text += f" They fit a place near {' or '.join(at_xy)}"
        sentences[name] = text
    return sentences


def apart(found: _core.Survey, messages: Messages, wrong: dict[str, str]) -> tuple[str, ...]:
    """Say why the parts of a drive may not fit together, if they may not.

    `wrong` has the anchors whose ranges are wrong in a part of it.
    """
    longest_s = 1.0
    begin = int(np.asarray(found.smoothed.stamp_ns)[0])
    stamps = messages.stamp_ns[(messages.source == "odometry") & (messages.stamp_ns >= begin)]
    if len(stamps) > 1:
        gaps = np.diff(np.sort(stamps)) / NANOSECONDS
        at = int(np.argmax(gaps))
        if gaps[at] > max(longest_s, 20.0 * float(np.median(gaps))):
            when = (np.sort(stamps)[at] - begin) / NANOSECONDS
            return (f"odometry is missing for {gaps[at]:.1f} s from {when:.0f} s on: what is found "
                    "before and after may not fit together; cut the log there",)  # fmt: skip
    count = sum(one.ranges for one in found.anchors)
    share = sum(one.rejected for one in found.anchors) / max(count, 1)
    if share > _TOO_MANY:
        return (f"{share:.0%} of all ranges are rejected: they do not fit the odometry; is that in "
                "metres and radians?",)  # fmt: skip
    if len(wrong) > 1:
        return (f"ranges of {', '.join(wrong)} are wrong in one part of the drive: its parts do "
                "not fit together; is odometry right all the time?",)  # fmt: skip
    return ()


def rejected(anchors: tuple[SurveyedAnchor, ...]) -> Iterator[str]:
    """Name anchors most of whose ranges fit no place."""
    if bad := [a.name for a in anchors if 2 * a.rejected > a.ranges > 0]:
        yield f"most ranges of {', '.join(bad)} fit no place"


def long_ranges(
    anchors: tuple[SurveyedAnchor, ...], settings: _core.PoseEkfConfig
) -> Iterator[str]:
    """Name anchors whose ranges are off by far more than any radio's."""
    most = 4.0 * settings.calibration.sigma_anchor_offset_m
    for a in anchors:
        if abs(a.offset_m) > max(most, 3.0 * a.sigma_offset_m):
            way = "long" if a.offset_m > 0.0 else "short"
            yield (f"ranges of {a.name} read {abs(a.offset_m):.2f} m too {way}: is its height, or "
                   "that of the tag, right?")  # fmt: skip


def advised(result: SurveyResult, sigma_range: float, *, is_side_known: bool) -> SurveyResult:
    """Return the result with the stop that would make the worst anchors surest.

    No stop shows a side that only a second tag can.
    """
    words = ("weak", "two places") if is_side_known else ("weak",)
    unsure = [a for a in result.anchors if a.word in words]
    missing = [a.name for a in result.anchors
               if a.word == "not placed" and 2 * a.rejected <= a.ranges]  # fmt: skip
    way = result.estimate.position
    if len(way) and float(np.ptp(way, axis=0).max()) < 0.5 and (unsure or missing):
        return replace(result, advice="the robot hardly moved: drive some metres, with turns")
    advice = ""
    if missing:
        advice = (f"{', '.join(missing)}: too few ranges, or all from one spot; drive where they "
                  "are received. ")  # fmt: skip
    if not unsure:
        return replace(result, advice=advice.strip())
    points = np.vstack([way, [a.position[:2] for a in unsure]])
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (np.linspace(low[k], high[k], 25) for k in (0, 1))
    grid = np.column_stack([v.ravel() for v in np.meshgrid(x, y)])
    sigma = max(sigma_range, 0.05)
    left = np.zeros(len(grid))
    for anchor in unsure:
        ways = anchor.position[:2] - grid
        far = np.maximum(np.hypot(*ways.T), 1e-6)
        u = ways / far[:, None]
        P = anchor.covariance[:2, :2] + 1e-9 * np.eye(2)
        gain = 10.0 / sigma**2 * u[:, :, None] * u[:, None, :]
        then = np.linalg.inv(np.linalg.inv(P) + gain)
        left += np.sqrt(np.linalg.eigvalsh(then)[:, -1])
        if anchor.other is not None:
            differs = np.abs(far - np.hypot(*(anchor.other[:2] - grid).T))
            left += np.where(differs < 5.0 * sigma, 100.0 / (1.0 + differs), 0.0)
    best = grid[int(np.argmin(left))]
    names = ", ".join(a.name for a in unsure)
    advice += (f"drive by ({best[0]:.1f}, {best[1]:.1f}) for {names}: ranges from there tell most "
               "of where they are")  # fmt: skip
    return replace(result, advice=advice, stop=best)
