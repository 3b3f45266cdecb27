# SPDX-License-Identifier: Apache-2.0
"""Every message of the C++ variant has all its pieces in Python, and simulator and model agree."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import locfuse
import locfuse.core as lf
from locfuse.config.build import build_anchors
from locfuse.config.load import parse_config
from locfuse.config.scenario import (
    AltitudeSensor,
    Circle,
    Flight,
    HeadingSensor,
    OdometrySensor,
    PoseSensor,
    PositionSensor,
    RangeSensor,
    Scenario,
    SightingSensor,
    Waypoints,
)
from locfuse.config.schema import SOURCES
from locfuse.io.log_folder import MESSAGES, SCHEMA
from locfuse.run.messages import to_messages
from locfuse.run.run import run
from locfuse.sim.scenario import simulate
from locfuse.types import FloatArray, Log, LogError
from support_runs import ROOT


@dataclass(frozen=True)
class Wiring:
    """Where the pieces of a message are: its log file, one of its columns, its bulk entry."""

    source: str
    column: str
    add: str
    output: str = ""  # of the simulated odometry


WIRING = {
    "Velocity": Wiring("odometry", "v_mps", "add_velocities", "velocities"),
    "Increment": Wiring("odometry", "dx_m", "add_increments", "increments"),
    "Range": Wiring("ranges", "range_m", "add_ranges"),
    "PositionFix": Wiring("positions", "x_m", "add_positions"),
    "PoseObservation": Wiring("poses", "heading_rad", "add_poses"),
    "RangeBearing": Wiring("landmark_sightings", "bearing_rad", "add_sightings"),
    "Altitude": Wiring("altitudes", "height_m", "add_altitudes"),
    "Heading": Wiring("headings", "heading_rad", "add_headings"),
}


# Of which there is no model of one pose: particles and front ends take them.
OF_FRONT_ENDS = {"LaserScan", "Imu"}


def variant() -> list[str]:
    """Return the messages of the C++ variant, the one register of sensors, but `OF_FRONT_ENDS`."""
    header = ROOT / "cpp" / "include" / "locfuse" / "messages" / "message.hpp"
    found = re.search(
        r"using Message =\s+std::variant<([^>]*)>", header.read_text(encoding="utf-8")
    )
    assert found is not None
    names = [name.strip() for name in found[1].split(",")]
    assert set(names) >= OF_FRONT_ENDS
    return [name for name in names if name not in OF_FRONT_ENDS]


def fused_by_the_estimator() -> set[str]:
    """Return the messages that PoseEkf.on is bound for, but `OF_FRONT_ENDS`."""
    signature = re.search(r"message: ([^)]*)\)", lf.PoseEkf.on.__doc__ or "")
    assert signature is not None
    return set(re.findall(r"locfuse\._core\.(\w+)", signature[1])) - OF_FRONT_ENDS


def in_space() -> Scenario:
    """Return a flight without noise, with elevations."""
    whole = scenario()
    seen = SightingSensor(sigma_range_m=0.0, sigma_bearing_deg=0.0, sigma_elevation_deg=0.0,
                          pose_in_body=(0.3, -0.1, 20.0), up_m=0.15)  # fmt: skip
    changed = {"flight": Flight(period_s=7.0), "landmark_sightings": seen, "landmark_height_m": 4.0}
    return whole.model_copy(update=changed)


def scenario(output: str = "increments") -> Scenario:
    """Return a drive without noise, with heights and lever arms, on which every sensor is on.

    Velocities are those of one arc from row to row, so their path is one; a row on which the path
    stops driving and begins to turn would be none.
    """
    turning = Waypoints(speed_mps=0.7, turn_rate_radps=0.9)
    return Scenario(
        path=Circle(speed_mps=0.7) if output == "velocities" else turning,
        duration_s=20.0,
        anchors={"a": (0.0, 0.0, 2.5), "b": (10.0, 1.0, 0.2), "c": (4.0, 10.0, 1.7)},
        tags={"front": (0.3, 0.1, 1.1), "rear": (-0.2, -0.15, 0.4)},
        landmarks={"p": (0.5, 0.5), "q": (9.0, 1.0), "r": (4.0, 9.5)},
        odometry=OdometrySensor(
            output="velocities" if output == "velocities" else "increments",
            sigma_longitudinal_per_sqrt_m=0.0,
            sigma_heading_per_sqrt_m=0.0,
            sigma_heading_per_sqrt_rad=0.0,
        ),
        ranges=RangeSensor(sigma_m=0.0, sigma_relative=0.0),
        poses=PoseSensor(sigma_xy_m=0.0, sigma_heading_deg=0.0),
        positions=PositionSensor(sigma_xy_m=0.0, antenna_forward_m=0.4, antenna_left_m=-0.1),
        landmark_sightings=SightingSensor(
            sigma_range_m=0.0, sigma_bearing_deg=0.0, pose_in_body=(0.3, -0.1, 20.0)
        ),
        altitudes=AltitudeSensor(sigma_m=0.0, altimeter_up_m=0.25),
        headings=HeadingSensor(sigma_deg=0.0, offset_deg=30.0),
    )


def missing_pieces(name: str, wiring: Wiring | None) -> list[str]:
    """Return what a message of the variant still lacks, in words."""
    missing = []
    if name not in locfuse.__all__:
        missing.append("its class in bind_messages.cpp and locfuse.__all__")
    if name not in fused_by_the_estimator():
        missing.append("an on() of an estimator in bind_estimators.cpp")
    if wiring is None:
        return [*missing, "a row in WIRING of this test"]
    if not hasattr(lf.MessageLog, wiring.add):
        missing.append(f"MessageLog.{wiring.add} in bind_replay.cpp")
    if wiring.source not in SOURCES:
        missing.append(f"{wiring.source!r} in SOURCES of config/schema.py")
    if wiring.source not in SCHEMA or wiring.source not in MESSAGES:
        missing.append(f"{wiring.source!r} in SCHEMA and MESSAGES of io/log_folder.py")
    elif not any(wiring.column in form for form in SCHEMA[wiring.source]):
        missing.append(f"the column {wiring.column!r} in SCHEMA of io/log_folder.py")
    if wiring.source not in Scenario.model_fields:
        missing.append(f"the sensor {wiring.source!r} in config/scenario.py")
        return missing
    log = simulate(scenario(wiring.output), np.random.default_rng(0))
    if wiring.source not in log or wiring.column not in log[wiring.source]:
        missing.append(f"a simulator of {wiring.source!r} with the column {wiring.column!r}")
    elif wiring.source in SOURCES:
        messages = to_messages(noisy(log), parse_config(using(wiring.source)))
        if len(messages.log) != len(log[wiring.source]["stamp_ns"]):
            missing.append(f"messages from the table {wiring.source!r} in messages.to_messages")
    return missing


def using(source: str) -> dict[str, Any]:
    """Return a configuration that fuses one source alone."""
    if source == "altitudes":
        return {"use": [source], "start": "truth", "estimator": {"kind": "air"}}
    if source == "headings":
        return {"use": [source], "start": "truth"}
    antenna = {"antenna_forward_m": 0.4, "antenna_left_m": -0.1}
    return {"use": [source], "estimator": {"position": antenna}}


def noisy(log: Log) -> Log:
    """Return the log with sigmas that a message may have; the simulated ones are zero."""
    tables = {
        stem: {k: np.full_like(v, 0.05) if k.startswith("sigma_") else v for k, v in table.items()}
        for stem, table in log.tables.items()
    }
    return replace(log, tables=tables)


@pytest.mark.parametrize("name", variant())
def test_nothing_is_missing_for(name: str) -> None:
    missing = missing_pieces(name, WIRING.get(name))
    assert not missing, f"{name} lacks " + "; ".join(missing)


def test_there_is_nothing_beside_the_variant() -> None:
    assert fused_by_the_estimator() == set(variant()) == set(WIRING)
    assert {wiring.source for wiring in WIRING.values()} == set(SOURCES)


def test_a_sensor_that_nobody_wired_is_named_piece_by_piece() -> None:
    missing = missing_pieces("SonarEcho", Wiring("sonar", "echo_m", "add_echoes"))
    assert [piece.split(" ")[-1] for piece in missing] == [
        "locfuse.__all__", "bind_estimators.cpp", "bind_replay.cpp", "config/schema.py",
        "io/log_folder.py", "config/scenario.py",
    ]  # fmt: skip
    assert "WIRING" in missing_pieces("SonarEcho", None)[-1]


@pytest.mark.parametrize("name", WIRING)
def test_every_message_is_fused_in_a_run_of_that_source_alone(name: str) -> None:
    wiring = WIRING[name]
    log = noisy(simulate(scenario(wiring.output), np.random.default_rng(3)))
    config = parse_config(using(wiring.source))
    counts = run(config, log).metrics["counts"]
    assert list(counts) == [wiring.source]
    assert counts[wiring.source].get("fused", 0) > 0.5 * len(log[wiring.source]["stamp_ns"])


# Two derivations ------------------------------------------------------------------------------


def poses_at(log: Log, stem: str) -> list[lf.Pose2]:
    """Return the true pose at every row of a table."""
    truth = log["truth"]
    rows = np.searchsorted(truth["stamp_ns"], log[stem]["stamp_ns"])
    np.testing.assert_array_equal(truth["stamp_ns"][rows], log[stem]["stamp_ns"])
    columns = zip(truth["x_m"][rows], truth["y_m"][rows], truth["heading_rad"][rows], strict=True)
    return [lf.Pose2(*pose) for pose in columns]


def velocity_residuals(log: Log) -> FloatArray:
    table = log["odometry"]
    start = lf.PoseEstimate(0, poses_at(log, "odometry")[0], 0.01 * np.eye(3))
    ekf = lf.PoseEkf(lf.PoseEkfConfig(), lf.World(), start)
    residuals = []
    for row, true_pose in enumerate(poses_at(log, "odometry")):
        stamp = int(table["stamp_ns"][row])
        residuals.append(lf.local(ekf.estimate(stamp).pose, true_pose))
        ekf.on(lf.Velocity(stamp, table["v_mps"][row], table["omega_radps"][row]))
    return np.array(residuals)


def increment_residuals(log: Log) -> FloatArray:
    table = log["odometry"]
    motion = lf.OdometryMotion(lf.OdometryConfig())
    poses = poses_at(log, "odometry")
    moved = [
        motion.propagate(pose, lf.Pose2(dx, dy, turn), 0.1).moved
        for pose, dx, dy, turn in zip(
            poses[:-1], table["dx_m"][1:], table["dy_m"][1:], table["dheading_rad"][1:], strict=True
        )
    ]
    return np.array([lf.local(a, b) for a, b in zip(moved, poses[1:], strict=True)])


def range_residuals(log: Log) -> FloatArray:
    table = log["ranges"]
    names = [str(name) for name in log["anchors"]["anchor"]]
    tags = list(log.tags)
    model = lf.RangeModel(
        lf.RangeConfig(),
        build_anchors(log["anchors"], names, {}),
        [lf.Tag(i, list(log.tags[name])) for i, name in enumerate(tags)],
    )
    residuals = []
    for row, pose in enumerate(poses_at(log, "ranges")):
        tag, anchor = tags.index(table["tag"][row]), names.index(table["anchor"][row])
        lin = model.linearize(pose, lf.Range(0, tag, anchor, table["range_m"][row]))
        assert lin is not None
        residuals.append(lin.residual)
    return np.array(residuals)


def position_residuals(log: Log) -> FloatArray:
    table, config = log["positions"], lf.PositionConfig()
    config.antenna_forward_m, config.antenna_left_m = 0.4, -0.1
    names = list(log.tags)
    model = lf.PositionModel(config, [lf.Tag(i, list(log.tags[n])) for i, n in enumerate(names)])
    tags = (
        [names.index(tag) for tag in table["tag"]] if "tag" in table else [None] * len(table["x_m"])
    )
    residuals = []
    for pose, x, y, tag in zip(poses_at(log, "positions"), table["x_m"], table["y_m"], tags,
                               strict=True):  # fmt: skip
        lin = model.linearize(pose, lf.PositionFix(0, [x, y], np.eye(2), tag))
        assert lin is not None
        residuals.append(lin.residual)
    return np.array(residuals)


def pose_residuals(log: Log) -> FloatArray:
    table, model = log["poses"], lf.PoseModel()
    seen = zip(table["x_m"], table["y_m"], table["heading_rad"], strict=True)
    residuals = []
    for pose, other in zip(poses_at(log, "poses"), seen, strict=True):
        lin = model.linearize(pose, lf.PoseObservation(0, lf.Pose2(*other), np.eye(3)))
        assert lin is not None
        residuals.append(lin.residual)
    return np.array(residuals)


def sighting_residuals(log: Log) -> FloatArray:
    table, known = log["landmark_sightings"], log["landmarks"]
    assert log.landmark_sensor is not None
    mount = lf.Pose2(*log.landmark_sensor["pose_in_body"])
    model = lf.RangeBearingModel(lf.RangeBearingConfig(), mount)
    at = {name: (x, y) for name, x, y in zip(known["landmark"], known["x_m"], known["y_m"],
                                             strict=True)}  # fmt: skip
    rows = zip(poses_at(log, "landmark_sightings"), table["landmark"], table["range_m"],
               table["bearing_rad"], strict=True)  # fmt: skip
    residuals = []
    for pose, name, distance, bearing in rows:
        lin = model.linearize(pose, at[name], lf.RangeBearing(0, None, distance, bearing))
        assert lin is not None
        residuals.append(lin.residual)
    return np.array(residuals)


def altitude_residuals(log: Log) -> FloatArray:
    config = lf.AltitudeConfig()
    config.altimeter_up_m = 0.25
    model, height = lf.AltitudeModel(config), true_heights(log, "altitudes")
    rows = zip(height, log["altitudes"]["height_m"], strict=True)
    return np.array([model.linearize(true, lf.Altitude(0, seen)).residual for true, seen in rows])


def true_heights(log: Log, stem: str) -> FloatArray:
    """Return the true height at every row of a table; of a drive 0."""
    rows = np.searchsorted(log["truth"]["stamp_ns"], log[stem]["stamp_ns"])
    return np.asarray(log["truth"].get("z_m", np.zeros(rows.max() + 1))[rows])


def heading_residuals(log: Log) -> FloatArray:
    config = lf.HeadingConfig()
    config.offset_rad = np.deg2rad(30.0)
    model, seen = lf.HeadingModel(config), log["headings"]["heading_rad"]
    found = [model.linearize(pose, lf.Heading(0, heading))
             for pose, heading in zip(poses_at(log, "headings"), seen, strict=True)]  # fmt: skip
    return np.array([lin.residual for lin in found if lin is not None])


RESIDUALS: dict[str, Callable[[Log], FloatArray]] = {
    "Velocity": velocity_residuals,
    "Increment": increment_residuals,
    "Range": range_residuals,
    "PositionFix": position_residuals,
    "PoseObservation": pose_residuals,
    "RangeBearing": sighting_residuals,
    "Altitude": altitude_residuals,
    "Heading": heading_residuals,
}


@pytest.mark.parametrize("name", variant())
def test_simulator_and_model_agree_without_noise(name: str) -> None:
    assert name in RESIDUALS, f"{name} lacks a comparison of its simulator with its model"
    wiring = WIRING[name]
    log = simulate(scenario(wiring.output), np.random.default_rng(6))

    residuals = RESIDUALS[name](log)

    assert len(residuals) >= 20
    assert np.abs(residuals).max() < 1e-9
    moving = np.array([(p.x, p.y, p.heading) for p in poses_at(log, wiring.source)])
    assert np.ptp(moving, axis=0).min() > 1.0, "a robot that stands still compares little"


def test_simulator_and_models_agree_without_noise_in_space() -> None:
    """Ranges and sightings with elevations of a body that rises and sinks."""
    log = simulate(in_space(), np.random.default_rng(6))
    assert np.ptp(log["truth"]["z_m"]) > 0.9
    assert np.abs(altitude_residuals(log)).max() < 1e-9
    table, config = log["landmark_sightings"], lf.AirEkfConfig()
    config.landmark_in_space.sensor_up_m = 0.15
    known = log["landmarks"]
    at = {name: i for i, name in enumerate(known["landmark"].tolist())}
    landmarks = lf.LandmarkMap(
        [lf.Landmark(i, [known["x_m"][i], known["y_m"][i]], 0.0, known["z_m"][i])
         for i in range(len(known["x_m"]))]
    )  # fmt: skip
    assert log.landmark_sensor is not None
    sensor = lf.LandmarkSensor(landmarks, lf.Pose2(*log.landmark_sensor["pose_in_body"]))
    names = [str(name) for name in log["anchors"]["anchor"]]
    tags = list(log.tags)
    anchors = build_anchors(log["anchors"], names, {})
    placed = [lf.Tag(i, list(log.tags[name])) for i, name in enumerate(tags)]

    def residual(pose: lf.Pose2, height: float, message: lf.Range | lf.RangeBearing) -> float:
        start = lf.AirEstimate(0, pose, height, 1e-6 * np.eye(4))
        return lf.AirEkf(config, lf.World(anchors, placed, sensor), start).on(message).nis

    seen = zip(poses_at(log, "landmark_sightings"), true_heights(log, "landmark_sightings"),
               *(table[c] for c in ("landmark", "range_m", "bearing_rad", "elevation_rad")),
               strict=True)  # fmt: skip
    nis = [residual(pose, height, lf.RangeBearing(0, at[name], distance, bearing,
                                                  elevation=elevation))
           for pose, height, name, distance, bearing, elevation in seen]  # fmt: skip
    ranges = log["ranges"]
    measured = zip(poses_at(log, "ranges"), true_heights(log, "ranges"), ranges["tag"],
                   ranges["anchor"], ranges["range_m"], strict=True)  # fmt: skip
    nis += [residual(pose, height, lf.Range(0, tags.index(tag), names.index(anchor), distance))
            for pose, height, tag, anchor, distance in measured]  # fmt: skip
    assert len(nis) > 300
    assert max(nis) < 1e-12


def of_tags() -> Log:
    """Return a drive on which an RTLS locates both tags."""
    whole = scenario()
    sensor = PositionSensor(sigma_xy_m=0.0, tags=["rear", "front"])
    return simulate(whole.model_copy(update={"positions": sensor}), np.random.default_rng(6))


def test_simulator_and_model_agree_without_noise_on_positions_of_tags() -> None:
    log = of_tags()
    assert set(log["positions"]["tag"].tolist()) == {"front", "rear"}

    assert np.abs(position_residuals(log)).max() < 1e-9


def test_positions_of_tags_are_fused_in_a_run_and_tell_the_heading() -> None:
    log = noisy(of_tags())
    config = parse_config({"use": ["odometry", "positions"]})

    result = run(config, log)

    assert result.metrics["counts"]["positions"] == {"fused": len(log["positions"]["stamp_ns"])}
    assert result.metrics["heading_rmse_deg"] < 1.0


def test_a_position_of_a_tag_without_a_place_is_counted_and_named() -> None:
    log = noisy(of_tags())
    log = replace(log, tags={"front": log.tags["front"]})
    truth = {"start": "truth", "use": ["odometry", "positions"]}

    result = run(parse_config(truth), log)

    unknown = result.outcomes.reason[result.outcomes.tag == "rear"]
    assert set(unknown.tolist()) == {"unknown tag rear"}
    with pytest.raises(LogError, match=r"positions name tags \['front', 'rear'\]"):
        run(parse_config(truth), replace(log, tags={"other": (0.0, 0.0, 0.0)}))
