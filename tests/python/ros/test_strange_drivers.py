# SPDX-License-Identifier: Apache-2.0
"""What drivers do that no standard allows, through every door: nodes of either ROS, bags, logs."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.core import RayCaster
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.log_yaml import write_log_yaml
from locfuse.io.maps import write_map
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.decode import RangeRow, ScanRow, heading_of
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.increments import poses_of
from locfuse.ros.adapter import Adapter
from locfuse.run.run import load_log, run
from locfuse.types import NANOSECONDS, Log, LogError
from support_bags import T0, write_messages
from support_live import live_of
from support_ros import message

Recorded = tuple[int, Publication]
DOORS = ("ros1", "ros2", "bag", "log", "live")
ANCHORS = {"A": (5.0, 0.0), "B": (0.0, 7.0), "C": (-5.0, -1.0), "D": (-2.0, 9.0)}


@dataclass
class Outcome:
    """Poses (n, 4), [s] and x, y, heading; sentences; health at the end; refused and counted."""

    poses: np.ndarray
    said: list[str]
    states: list[str]
    refused: Mapping[str, int] = field(default_factory=dict)

    def at(self, seconds: float) -> list[float]:
        return [float(np.interp(seconds, self.poses[:, 0], self.poses[:, k])) for k in (1, 2)]

    def rmse(self, truth: np.ndarray, since_s: float = 0.0) -> float:
        """Return the error of position against rows of [s], x, y."""
        rows = self.poses[self.poses[:, 0] >= since_s]
        off = [rows[:, k] - np.interp(rows[:, 0], truth[:, 0], truth[:, k]) for k in (1, 2)]
        return float(np.sqrt(np.mean(np.square(off).sum(axis=0))))


def through(
    door: str, config: Mapping[str, Any], messages: Sequence[Recorded], tmp_path: Path,
    caplog: pytest.LogCaptureFixture, base: Path | None = None,
) -> Outcome:  # fmt: skip
    messages = sorted(messages, key=lambda one: one[0])
    if door in ("ros1", "ros2"):
        return _by_node(door, config, messages, base)
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        path = write_messages(tmp_path / "drive.mcap", messages)
        settings = parse_config({"log": str(path), **config})
        log = load_log(settings, base, 0)
        if door != "bag":
            write_log(log, tmp_path / "folder")
            log = read_log(tmp_path / "folder")
        if door == "live":
            live, poses = live_of(settings, log)
            if (last := live.pose()) is not None:
                poses[last.stamp_ns] = last
            rows = [(stamp, *pose.pose) for stamp, pose in sorted(poses.items())]
            return Outcome(_since_start(rows), caplog.messages, [live.health().state])
        result = run(settings, log)
    track = result.estimate
    assert track.heading is not None
    assert result.health is not None
    rows = list(zip(track.stamp_ns.tolist(), *track.position.T, track.heading, strict=True))
    return Outcome(_since_start(rows), caplog.messages, result.health.state.tolist())


def _since_start(rows: list[tuple[Any, ...]]) -> np.ndarray:
    """Return rows with seconds since the recording began instead of stamps."""
    return np.array([((stamp - T0) / NANOSECONDS, *pose) for stamp, *pose in rows])


def _by_node(
    ros: str, config: Mapping[str, Any], messages: Sequence[Recorded], base: Path | None
) -> Outcome:
    adapter = Adapter(parse_config(dict(config)), base=base)
    of = {one.topic.lstrip("/"): one.source for one in adapter.subscriptions}
    published, said, states, tick = [], list[str](), list[str](), 0
    for now, one in messages:
        topic = one.topic.lstrip("/")
        if topic in of:
            published += adapter.on(of[topic], topic, message(one, ros), now)
        if now >= tick:
            tick = now + NANOSECONDS // 10
            published += adapter.tick(now)
            states.append(adapter.health(now).state)
        said += [s for s in adapter.problems() if not s.startswith("nothing comes on")]
    poses = {}
    for one in published:
        if one.topic == "locfuse/pose":
            at = message(one).pose.pose
            stamp = one.fields["header"]["stamp"]["ns"]
            poses[stamp] = (at.position.x, at.position.y, heading_of(at.orientation))
    rows = [(stamp, *poses[stamp]) for stamp in sorted(poses)]
    return Outcome(_since_start(rows), said, states, dict(adapter.refused))


def odometry(
    seconds: float, pose: Sequence[float], v: float = 0.0, omega: float = 0.0, left: float = 0.0
) -> Recorded:
    stamp = T0 + round(seconds * NANOSECONDS)
    return stamp, encode.odometry("odom", stamp, pose, (v, omega, left), "odom", "base_link")


def fix(seconds: float, latitude: float, longitude: float, frame: str = "gps", sigma: float = 0.1,
        kind: int = 2) -> Recorded:  # fmt: skip
    stamp = T0 + round(seconds * NANOSECONDS)
    covariance = np.diag([sigma**2, sigma**2, 4 * sigma**2]).ravel()
    fields = {"header": encode.header(stamp, frame), "status": {"status": 0, "service": 1},
              "latitude": latitude, "longitude": longitude, "altitude": 0.0,
              "position_covariance": covariance, "position_covariance_type": kind}  # fmt: skip
    return stamp, Publication("fix", "sensor_msgs/NavSatFix", fields)


def mount(frame: str, *at: float) -> Recorded:
    return T0, encode.transforms([encode.transform(T0, "base_link", frame, at)], static=True)


def anchors() -> list[Recorded]:
    at = np.array([[x, y, 0.0] for x, y in ANCHORS.values()])
    return [(T0, encode.named_points("anchors", list(ANCHORS), at, None, "map", T0)),
            mount("tag", 0.0, 0.0, 0.0)]  # fmt: skip


def ranges(seconds: float, at: Sequence[float], behind_s: float = 0.0) -> Recorded:
    now = T0 + round(seconds * NANOSECONDS)
    stamp = now - round(behind_s * NANOSECONDS)
    rows = [RangeRow(stamp, "tag", name, math.dist(place, at), None, "tag")
            for name, place in ANCHORS.items()]  # fmt: skip
    return now, encode.uwb_ranges("uwb", rows)


def degrees_north(metres: float) -> float:
    return 49.0 + metres / 111_200.0


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("first", ["nan", "null island", "none"])
def test_the_map_begins_at_the_first_fix_that_another_agrees_with(
    door: str, first: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bad = {"nan": [fix(0.0, math.nan, math.nan)], "null island": [fix(0.0, 0.0, 0.0)], "none": []}
    drive = [odometry(0.1 * k, (0.1 * k, 0.0, 0.0), v=1.0) for k in range(400)]
    drive += bad[first] + [fix(0.5 * k, degrees_north(0.5 * k), 8.4) for k in range(1, 80)]
    found = through(door, {"start": "auto"}, drive, tmp_path, caplog)
    assert len(found.poses) > 330
    assert found.states[-1] == "ok"
    begin = degrees_north(0.5)
    assert sum("origin" in s and repr(begin) in s for s in found.said) == 1
    assert found.at(39.0) == pytest.approx([0.0, 38.5], abs=0.3)
    if door.startswith("ros"):
        assert found.refused.get("positions", 0) == (first != "none")


SENSED: dict[str, Any] = {
    "room_m": [20, 15], "map": {"generate": "rooms"}, "path": {"shape": "roam"},
    "duration_s": 15, "ranges": None, "poses": None, "laser": {"range_max_m": 3.0},
}  # fmt: skip


def sensed(seed: int = 3, **laser: Any) -> Log:
    world = {**SENSED, "laser": SENSED["laser"] | laser}
    return load_log(parse_config({"simulation": world, "seed": seed}), None, seed)


def start_in(log: Log) -> list[float]:
    first = [float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad")]
    return [*first[:2], math.degrees(first[2])]


def truth_in(log: Log) -> np.ndarray:
    table = log["truth"]
    return np.column_stack([table["stamp_ns"] / NANOSECONDS, table["x_m"], table["y_m"]])


def driven_in(log: Log) -> Iterator[Recorded]:
    table = log["odometry"]
    motion = np.column_stack([table[key] for key in ("dx_m", "dy_m", "dheading_rad")])
    for stamp, pose in zip(table["stamp_ns"].tolist(), poses_of(motion).tolist(), strict=True):
        yield odometry(stamp / NANOSECONDS, pose)


def scans_in(log: Log, **fields: Any) -> Iterator[Recorded]:
    """Yield the scans of a log; what has no return reads as `nothing` says, or infinity."""
    laser, nothing = log.laser, fields.pop("nothing", math.inf)
    assert laser is not None
    sign = fields.pop("sign", 1.0)
    for time, given in zip(log["scans"]["stamp_ns"].tolist(), log["scans"]["ranges_m"],
                           strict=True):  # fmt: skip
        row = ScanRow(T0 + time, "laser", sign * laser["angle_min_rad"],
                      sign * laser["angle_increment_rad"], 0.12, laser["range_max_m"], given,
                      None)  # fmt: skip
        one = encode.laser_scan("scan", row)
        one.fields["ranges"][np.isnan(given)] = nothing
        one.fields.update(fields)
        yield T0 + time, one


def on_map(log: Log, **fields: Any) -> list[Recorded]:
    assert log.grid is not None
    return [*driven_in(log), *scans_in(log, **fields), mount("laser", 0.0, 0.0, 0.0),
            (T0, encode.occupancy_grid("map", log.grid, "map", T0))]  # fmt: skip


NOTHING = {
    "zero": {"nothing": 0.0, "range_min": 0.0},
    "range_min": {"nothing": 0.12},
    "range_max": {"nothing": 3.0},
    "just below": {"nothing": 2.999},
    "negative": {"nothing": -1.0},
    "nan": {"nothing": math.nan},
    "16 bits": {"nothing": 65.535, "range_max": 100.0},
    "no limit": {"range_max": math.inf},
    "largest": {"range_max": 3.4028235e38},
    "16 bits, no limit": {"nothing": 65.535, "range_max": math.inf},
}


@pytest.mark.parametrize("door", ["ros2", "bag", "log"])
@pytest.mark.parametrize("nothing", NOTHING)
def test_no_return_is_none_however_a_driver_writes_it(
    door: str, nothing: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = sensed()
    config = {"mcl": {"max_particles": 2000}, "start": start_in(log), "seed": 1}
    found = through(door, config, on_map(log, **NOTHING[nothing]), tmp_path, caplog)
    assert found.rmse(truth_in(log)) < 0.05
    assert set(found.states) <= {"initializing", "ok"}
    assert any("65.535 m" in s for s in found.said) == ("16 bits" in nothing)


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("gap_s", [0.05, 2.0])
@pytest.mark.parametrize("states_velocity", [True, False])
def test_odometry_that_is_set_anew_is_no_motion(
    door: str, gap_s: float, states_velocity: bool, tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    def on_circle(seconds: float) -> tuple[float, float, float]:
        angle = 0.04 * seconds
        return 3.0 * math.sin(angle), 3.0 - 3.0 * math.cos(angle), angle

    v, omega = (0.12, 0.04) if states_velocity else (0.0, 0.0)
    again = 30.0 + gap_s
    drive = [odometry(0.05 * k, on_circle(0.05 * k), v, omega) for k in range(600)]
    drive += [odometry(again + 0.05 * k, on_circle(0.05 * k), v, omega) for k in range(500)]
    drive += anchors() + [ranges(0.2 * k, on_circle(0.2 * k)[:2]) for k in range(20)]
    found = through(door, {"start": [0, 0, 0]}, drive, tmp_path, caplog)
    end = again + 0.05 * 499
    off = math.dist(found.at(end), on_circle(end)[:2])
    assert off < (0.02 if states_velocity else 0.12 * gap_s * 3.0)
    assert sum("jumps 1 times, first by 3.3" in s for s in found.said) == 1


@pytest.mark.parametrize("door", DOORS)
def test_odometry_in_packets_is_no_jump(
    door: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive = []
    for k in range(400):  # ten at once, 15 us apart, each half a second
        seconds = 0.5 * (k // 10) + 15e-6 * (k % 10)
        drive.append(odometry(seconds, (0.05 * k, 0.0, 0.0), v=1.0))
    found = through(door, {"start": [0, 0, 0]}, [*drive, *anchors()], tmp_path, caplog)
    assert found.poses[-1, 1:3] == pytest.approx([0.05 * 399, 0.0], abs=1e-6)
    assert not any("jump" in s for s in found.said)


def circle_of_an_antenna(ahead: float, placed: float) -> tuple[list[Recorded], np.ndarray]:
    """Drive with RTK fixes of an antenna, which transforms place ahead of the body; and truth."""
    rng = np.random.default_rng(0)
    drive: list[Recorded] = [mount("gps_link", placed, 0.0, 0.5)]
    truth = []
    for k in range(800):
        turn = 0.15 * k / 20
        x, y = 2.0 * math.sin(turn), 2.0 - 2.0 * math.cos(turn)
        drive.append(odometry(k / 20, (x, y, turn), v=0.3, omega=0.15))
        truth.append((k / 20, x, y))
        if k % 4 == 0:
            point = x + ahead * math.cos(turn), y + ahead * math.sin(turn)
            east, north = point + 0.02 * rng.normal(size=2)
            drive.append(fix(k / 20, degrees_north(north), 8.4 + east / 73_170.0, "gps_link", 0.02))
    return drive, np.array(truth)


ORIGIN = {"start": [0, 0, 0], "ros": {"gps_origin": [49.0, 8.4, 0.0]}}


@pytest.mark.parametrize("door", DOORS)
def test_an_antenna_sits_where_transforms_place_it(
    door: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive, truth = circle_of_an_antenna(1.0, 1.0)
    found = through(door, ORIGIN, drive, tmp_path, caplog)
    assert found.rmse(truth, since_s=5.0) < 0.02
    assert found.states[-1] == "ok"
    assert not found.said


@pytest.mark.parametrize("door", ["ros2", "bag"])
@pytest.mark.parametrize("kind", ["pose", "landmark_slam"])
def test_where_the_configuration_places_an_antenna_counts_more(
    door: str, kind: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive, truth = circle_of_an_antenna(1.0, 0.2)
    estimator = {"kind": kind, "position": {"antenna_forward_m": 1.0}}
    found = through(door, {**ORIGIN, "estimator": estimator}, drive, tmp_path, caplog)
    assert found.rmse(truth, since_s=5.0) < 0.02
    assert sum("'gps_link' at (0.2, 0) m" in s for s in found.said) == 1


def test_transforms_that_come_late_do_not_move_the_map(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive = [odometry(0.05 * k, (0.5 * k, 0.0, 0.0), v=10.0) for k in range(200)]
    drive += [fix(0.1 * k, degrees_north(1.0 * k), 8.4, "gps_link", 0.02) for k in range(100)]
    stamp = T0 + 270_000_000
    at = encode.transform(stamp, "base_link", "gps_link", (0.5, 0.0, 0.0))
    drive.append((stamp, encode.transforms([at], static=True)))
    origins = []
    for door in ("ros1", "bag"):
        said = through(door, {"start": "auto"}, drive, tmp_path, caplog).said
        (origin,) = (s for s in said if "the map's origin is" in s)
        origins.append(origin[origin.index("at latitude") :])
    assert origins[0] == origins[1]


@pytest.mark.parametrize("door", ["ros1", "bag"])
def test_an_antenna_that_nothing_places_is_said(
    door: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive = [odometry(0.1 * k, (0.1 * k, 0.0, 0.0), v=1.0) for k in range(100)]
    drive += [fix(0.5 * k, degrees_north(0.5 * k), 8.4) for k in range(20)]
    config = {"start": "auto", "ros": {"gps_origin": [49.0, 8.4, 0.0]}}
    found = through(door, config, drive, tmp_path, caplog)
    assert sum("'gps'" in s and "base_link" in s for s in found.said) == 1


@pytest.mark.parametrize("door", ["ros1", "bag", "log"])
def test_a_laser_hangs_head_down_by_the_words_of_the_world(
    door: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = sensed()
    laser, given = log.laser, log["scans"]["ranges_m"]
    assert laser is not None
    assert log.grid is not None
    beams = given.shape[1]
    assert laser["angle_min_rad"] == pytest.approx(-math.pi)
    mirrored = given[:, (beams - np.arange(beams)) % beams]  # as a laser counts that looks up
    scans = {**log["scans"], "ranges_m": mirrored}
    upturned = replace(log, tables={**log.tables, "scans": scans})
    drive = [one for one in on_map(upturned) if one[1].topic in ("odom", "scan")]
    folder = tmp_path / "world"
    folder.mkdir()
    angles = {key: -laser[key] for key in ("angle_min_rad", "angle_increment_rad")}
    write_log_yaml(folder / "log.yaml", {"laser": {**laser, **angles}, "map": "map.yaml"})
    write_map(log.grid, folder / "map.yaml")
    config = {"mcl": {"max_particles": 2000}, "start": start_in(log), "seed": 1,
              "ros": {"world": str(folder)}}  # fmt: skip
    assert through(door, config, drive, tmp_path, caplog).rmse(truth_in(log)) < 0.05


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("use", ["pose", "twist"])
def test_wheels_that_roll_sideways(
    door: str, use: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive = [odometry(0.05 * k, (0.0, 0.02 * k, 0.0), left=0.4) for k in range(201)]
    config = {"start": [0, 0, 0], "ros": {"odometry_from": use}}
    found = through(door, config, [*drive, *anchors()], tmp_path, caplog)
    assert found.poses[-1, 1:3] == pytest.approx([0.0, 4.0], abs=1e-9)


@pytest.mark.parametrize("door", ["ros2", "bag", "log", "live"])
def test_a_laser_whose_number_of_beams_changes(
    door: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = sensed()
    rng = np.random.default_rng(1)
    drive = [one for one in on_map(log) if one[1].topic != "scan"]
    for time, one in scans_in(log):
        whole = one.fields["ranges"]
        one.fields["ranges"] = whole[: len(whole) - int(rng.integers(4))]
        drive.append((time, one))
    config = {"mcl": {"max_particles": 2000}, "start": start_in(log), "seed": 1}
    found = through(door, config, drive, tmp_path, caplog)
    if door != "live":
        assert found.rmse(truth_in(log)) < 0.05
    bag = read_bag(write_messages(tmp_path / "again.mcap", sorted(drive, key=lambda m: m[0])))
    assert len(bag["scans"]["stamp_ns"]) == len(log["scans"]["stamp_ns"])
    assert not [s for s in found.said if "left out" in s]


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize("what", ["zero covariance", "stamp 0", "rviz"])
def test_a_start_as_nav2_takes_it(ros: str, what: str) -> None:
    adapter = Adapter(parse_config({"start": "auto", "start_sigma": {"xy_m": 0.3}}))
    for k in range(3):
        adapter.on("odometry", "odom", message(odometry(0.1 * k, (0, 0, 0))[1], ros), T0)
    variances = np.zeros(3) if what == "zero covariance" else np.array([0.25, 0.25, 0.07])
    stamp = 0 if what == "stamp 0" else T0
    given = encode.pose_with_covariance("initialpose", stamp, (1.0, 2.0, 0.5), np.diag(variances),
                                        "map")  # fmt: skip
    published = adapter.on("initial_pose", "initialpose", message(given, ros), T0 + 10**9)
    at = next(one for one in published if one.topic == "locfuse/pose").fields
    assert at["pose"]["pose"]["position"]["x"] == 1.0
    found = np.reshape(at["pose"]["covariance"], (6, 6))
    assert found[0, 0] == pytest.approx(0.09 if what == "zero covariance" else 0.25)
    assert sum("start_sigma" in s for s in adapter.problems()) == (what == "zero covariance")


@pytest.mark.parametrize("door", ["ros1", "ros2", "bag", "log"])
def test_fixes_without_covariance_are_said(
    door: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive = [odometry(0.1 * k, (0.1 * k, 0.0, 0.0), v=1.0) for k in range(100)]
    drive += [fix(0.5 * k, degrees_north(0.5 * k), 8.4, kind=0) for k in range(20)]
    found = through(door, {"start": [0, 0, 90]}, drive, tmp_path, caplog)
    assert sum("set estimator.position.sigma_m" in s for s in found.said) == 1


@pytest.mark.parametrize("door", ["ros1", "ros2", "bag"])
@pytest.mark.parametrize("behind_s", [3.0, 3600.0, 1.7e9])
def test_a_clock_that_is_behind_is_named(
    door: str, behind_s: float, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive = [odometry(0.05 * k, (0.0, 0.0, 0.0)) for k in range(400)] + anchors()
    drive += [ranges(0.2 * k, (0.0, 0.0), behind_s) for k in range(2, 90)]
    if (door, behind_s) == ("bag", 1.7e9):
        with pytest.raises(LogError, match="count time from the same origin"):
            through(door, {"start": [0, 0, 0]}, drive, tmp_path, caplog)
        said = caplog.messages
    else:
        said = through(door, {"start": [0, 0, 0]}, drive, tmp_path, caplog).said
    named = [s for s in said if f"{behind_s:.6g} s before" in s]
    assert len(named) == 1
    assert "uwb" in named[0] or "ranges" in named[0]


@pytest.mark.parametrize("door", ["ros2", "bag", "log"])
def test_beams_count_as_of_their_times(
    door: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A laser of 5 turns a second on a robot that turns at 1.5 rad/s sweeps 17 degrees too far."""
    world = {**SENSED, "path": {"shape": "roam", "turn_rate_radps": 1.5, "speed_mps": 0.6},
             "laser": {"range_max_m": 10.0, "rate_hz": 5.0}, "duration_s": 40}  # fmt: skip
    log = load_log(parse_config({"simulation": world, "seed": 1}), None, 1)
    assert log.grid is not None
    truth = log["truth"]
    caster, rng = RayCaster(log.grid.occupancy_grid()), np.random.default_rng(0)
    angles = np.unwrap(truth["heading_rad"])
    beams = log["scans"]["ranges_m"].shape[1]
    each = 0.19 / beams
    drive = [one for one in on_map(log) if one[1].topic != "scan"]
    assert log.laser is not None
    mount_x, mount_y, mount_heading = log.laser["pose_in_body"]
    assert (mount_x, mount_y, mount_heading) == (0.0, 0.0, 0.0)
    for stamp, (time, one) in zip(log["scans"]["stamp_ns"].tolist(), scans_in(log), strict=True):
        when = stamp + each * NANOSECONDS * np.arange(beams)
        x, y, heading = (np.interp(when, truth["stamp_ns"], values)
                         for values in (truth["x_m"], truth["y_m"], angles))  # fmt: skip
        beam = log.laser["angle_min_rad"] + log.laser["angle_increment_rad"] * np.arange(beams)
        seen = caster.cast(np.column_stack([x, y]), heading + beam) + rng.normal(0, 0.01, beams)
        one.fields["ranges"] = np.where((seen > 0.12) & (seen < 10.0), seen, np.inf)
        one.fields["time_increment"] = each
        drive.append((time + round(0.19 * NANOSECONDS), one))  # published when it is done
    config = {"mcl": {"max_particles": 2000}, "start": start_in(log), "seed": 1}
    found = through(door, config, drive, tmp_path, caplog)
    inside = found.poses[found.poses[:, 0] < 39.8]
    expected = np.interp(inside[:, 0] * NANOSECONDS, truth["stamp_ns"], angles)
    off = np.degrees(np.angle(np.exp(1j * (inside[:, 3] - expected))))
    assert np.sqrt(np.mean(off**2)) < 0.5
    assert found.rmse(truth_in(log)) < 0.05
