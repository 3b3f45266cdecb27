# SPDX-License-Identifier: Apache-2.0
"""A configuration of robot_localization as one of ours, with what has no counterpart."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import yaml

from locfuse.check.proposal import written
from locfuse.config.load import parse_config
from locfuse.config.ros import BOTH, SUBSCRIBED, Topics, plain
from locfuse.types import ConfigError

_SENSOR = re.compile(r"(odom|pose|twist|imu)\d+")
_SWITCHES = 15
_X, _Y, _YAW, _VX, _VY, _VYAW, _AX = 0, 1, 5, 6, 7, 11, 12  # among them
_NAVSAT = ("magnetic_declination_radians", "yaw_offset", "wait_for_datum", "datum")
_OF_GPS = re.compile(r"gps|navsat|gnss|utm", re.IGNORECASE)
_WILD = "/**"  # of all nodes, in ROS 2
# Keys that have a counterpart of another shape, or none, and what to know of it.
_KNOWN = {
    "frequency": "an estimate is published with each odometry message",
    "sensor_timeout": "the odometry timeout is estimator.hold_s",
    "process_noise_covariance": "noise grows with distance and turn: estimator.odometry",
    "dynamic_process_noise_covariance": "noise grows with distance and turn: estimator.odometry",
    "initial_estimate_covariance": "start_sigma, where start is [x, y, heading_deg]",
    "use_control": "commands are not fused",
    "reset_on_time_jump": "set clock_jump: reset",
    "zero_altitude": "", "wait_for_datum": "", "two_d_mode": "", "map_frame": "", "odom_frame": "",
    "base_link_frame": "", "world_frame": "", "publish_tf": "", "transform_time_offset": "",
    "smooth_lagged_data": "", "history_length": "", "initial_state": "", "datum": "",
    "magnetic_declination_radians": "", "yaw_offset": "", "print_diagnostics": "", "debug": "",
    "debug_out_file": "", "use_sim_time": "",
}  # fmt: skip
_OF_SENSOR = {  # after its name
    "config": "", "queue_size": "", "nodelay": "",
    "differential": "errors of poses that stay are learnt: estimator.correlation_s",
    "relative": "what headings read more is learnt: estimator.calibration",
    "remove_gravitational_acceleration": "accelerations are not fused",
}  # fmt: skip
_TOPICS = "ros.topics."
_GATE = "gates are probabilities, such as estimator.position.gate"


@dataclass
class _Made:
    """What is known of the configuration so far: values by dotted key, each with its reason."""

    values: dict[str, tuple[Any, str]] = field(default_factory=dict)
    uses: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    def set(self, key: str, value: Any, why: str) -> None:
        self.values.setdefault(key, (value, why))

    def use(self, source: str) -> None:
        if source not in self.uses:
            self.uses.append(source)

    @property
    def topics(self) -> dict[str, str]:
        """The topics so far, by source."""
        return {key.removeprefix(_TOPICS): value for key, (value, _) in self.values.items()
                if key.startswith(_TOPICS)}  # fmt: skip

    def number(self, name: str, value: Any) -> float | None:
        """Return a finite number, or say of which key the value is none."""
        try:
            found = math.nan if isinstance(value, bool) else float(value)
        except (TypeError, ValueError, OverflowError):
            found = math.nan
        if not abs(found) <= 1e9:
            self.missing.append(f"{name}: {_shown(value)} is no number that can be used")
            return None
        return found


def from_robot_localization(text: str) -> str:
    """Return the text of a configuration that does what one of robot_localization asks for.

    Every key has its origin beside it; what has no counterpart follows as comments.

    Parameters
    ----------
    text : str
        YAML of ``ekf_node`` or ``ukf_node``, with or without ``navsat_transform_node``, of ROS 1 or
        ROS 2. Of two filters the one of the map counts.

    Returns
    -------
    str

    Raises
    ------
    ConfigError
        If `text` is no YAML, no node in it has a sensor of robot_localization, or nothing of what
        these measure can be fused.

    Examples
    --------
    >>> print(from_robot_localization(
    ...     "ekf: {pose0: amcl_pose, pose0_config: "
    ...     f"{[True] * 2 + [False] * 13}, map_frame: floor}}"), end="")
    use: [poses]  # ekf
    start: auto  # found without a prior
    ros:
      frames:
        map: floor  # map_frame
      topics:
        poses: amcl_pose  # pose0
    """
    try:
        nodes = _named(_parsed(text))
    except RecursionError as error:
        raise ConfigError("it is nested too deeply for parameters of nodes") from error
    filters = {name: given for name, given in nodes.items() if _is_filter(given)}
    if not filters:
        raise ConfigError("no odom0, pose0, twist0 or imu0 in it; expected the parameters of an "
                          "ekf_node of robot_localization")  # fmt: skip
    name, chosen = max(filters.items(), key=lambda item: _is_of_map(item[1]))
    made = _Made()
    wheels = f"odom -> {_shown(chosen.get('base_link_frame', 'base_link'))}"
    made.missing += [f"{other}: locfuse is one filter; {wheels} stays with the driver of the wheels"
                     for other in filters if other != name]  # fmt: skip
    _frames(chosen, made)
    for sensor in sorted(filter(_SENSOR.fullmatch, chosen)):
        _sensor(sensor, chosen, made)
    for other, given in nodes.items():
        if other != name and other in filters:
            continue
        if _is_navsat(given):
            _navsat(other, given, made)
        _rest(other, given, made)
    if not made.uses:
        raise ConfigError(f"{_shown(name)} fuses nothing that locfuse can: "
                          f"{'; '.join(made.missing)}")  # fmt: skip
    _free_topics(made)
    made_text = _text(name, made)
    try:
        parse_config(yaml.safe_load(made_text))
    except ConfigError as error:
        raise ConfigError(f"what it asks for makes no configuration: {error}") from error
    return made_text


def _parsed(text: str) -> Mapping[str, Any]:
    try:
        given = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigError(f"no YAML: {_shown(str(error))}") from error
    if not isinstance(given, dict):
        raise ConfigError("expected the parameters of nodes, a mapping")
    return given


def _named(given: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the parameters of every node by its name, with those of all nodes in each."""
    nodes: dict[str, dict[str, Any]] = {}
    for path, parameters in _nodes(given, ()):
        name = "/".join(path) or "parameters"
        nodes[name] = {str(key): value for key, value in parameters.items()}
    wild = nodes.get(_WILD, {})
    named = {name: {**wild, **own} for name, own in nodes.items() if name != _WILD}
    return (
        named
        if named and not _is_filter(wild) and not _is_navsat(wild)
        else {**({_WILD: wild} if wild else {}), **named}
    )


def _nodes(
    given: Mapping[str, Any], path: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], Mapping[str, Any]]]:
    """Yield every node with its parameters: under its name, with or without ros__parameters."""
    below = {str(key): value for key, value in given.items() if isinstance(value, dict)}
    if "ros__parameters" in below:
        yield path, below["ros__parameters"]
    elif _is_filter(given) or _is_navsat(given):
        yield path, given
    else:
        for key, value in below.items():
            yield from _nodes(value, (*path, key))


def _is_filter(given: Mapping[str, Any]) -> bool:
    return any(_SENSOR.fullmatch(str(key)) for key in given)


def _is_navsat(given: Mapping[str, Any]) -> bool:
    return any(key in given for key in _NAVSAT)


def _is_of_map(given: Mapping[str, Any]) -> bool:
    return bool(given.get("world_frame", "odom") == given.get("map_frame", "map"))


def _frames(given: Mapping[str, Any], made: _Made) -> None:
    usual = {"map_frame": "map", "odom_frame": "odom", "base_link_frame": "base"}
    for key, ours in usual.items():
        frame = given.get(key)
        if frame is not None and frame != ("base_link" if ours == "base" else ours):
            if isinstance(frame, str) and plain(frame):
                made.set(f"ros.frames.{ours}", frame, key)
            else:
                made.missing.append(f"{key}: {_shown(frame)} is no name of a frame")
    if _flag("publish_tf", given.get("publish_tf", True), made) is False:
        made.set("ros.publish_transform", False, "publish_tf")
    if given.get("transform_time_offset"):
        ahead = made.number("transform_time_offset", given["transform_time_offset"])
        if ahead is not None:
            made.set("ros.transform_ahead_s", min(max(ahead, 0.0), 10.0), "transform_time_offset")
    if _flag("smooth_lagged_data", given.get("smooth_lagged_data", False), made):
        length = made.number("history_length", given.get("history_length", 0.0))
        if length is not None and length > 0.0:
            made.set("history_s", length, "history_length")
    start = given.get("initial_state")
    if start is not None:
        known = isinstance(start, list) and len(start) > _YAW
        numbers = [made.number("initial_state", start[i]) for i in (_X, _Y, _YAW)] if known else []
        if not known or None in numbers:
            made.missing.append("initial_state: expected a list of 15 numbers")
        elif any(numbers):
            x, y, yaw = (float(n or 0.0) for n in numbers)
            made.set("start", [x, y, math.degrees(yaw)], "initial_state")
    if _flag("two_d_mode", given.get("two_d_mode", True), made) is False:
        made.missing.append("two_d_mode false: this is a filter in the plane; a body that flies "
                            "has estimator.kind: air, without headings and an IMU")  # fmt: skip


def _flag(key: str, value: Any, made: _Made) -> bool | None:
    """Return a switch, which launch files may write as text; None of anything else."""
    if isinstance(value, bool):
        return value
    if isinstance(value, str) and value.lower() in ("true", "false"):
        return value.lower() == "true"
    made.missing.append(f"{key}: {_shown(value)} is neither true nor false")
    return None


def _switches(sensor: str, given: Mapping[str, Any], made: _Made) -> list[bool]:
    switches = given.get(f"{sensor}_config")
    if not isinstance(switches, list) or len(switches) != _SWITCHES:
        raise ConfigError(f"{sensor}_config is {_shown(switches)}; expected a list of {_SWITCHES} "
                          "switches")  # fmt: skip
    return [bool(_flag(f"{sensor}_config", one, made)) for one in switches]


def _sensor(sensor: str, given: Mapping[str, Any], made: _Made) -> None:
    """Find the source that fuses what a sensor of theirs does."""
    topic, kind = given[sensor], sensor.rstrip("0123456789")
    for key, value in given.items():
        if key.startswith(f"{sensor}_"):
            why = _GATE if key.endswith("rejection_threshold") else _OF_SENSOR.get(
                key.removeprefix(f"{sensor}_"), "no counterpart")  # fmt: skip
            if why and value not in (None, False, "false"):
                made.missing.append(f"{key}: {why}")
    if not isinstance(topic, str) or not plain(topic) or "$(" in topic:
        made.missing.append(f"{sensor}: {_shown(topic)} is no name of a topic")
        return
    on = _switches(sensor, given, made)
    if any(on[_AX:]):
        made.missing.append(f"{sensor}_config: accelerations are not fused")
    if kind == "imu":
        _imu(sensor, topic, on, made)
    elif kind == "twist":
        made.missing.append(f"{sensor} ({topic}): wheels come as nav_msgs/Odometry")
    elif kind == "odom" and on[_X] and _OF_GPS.search(plain(topic).rsplit("/", 1)[-1]):
        made.use("positions")
        made.missing.append(f"{sensor} ({topic}): made by navsat_transform; fixes are fused as "
                            "they come: ros.topics.positions")  # fmt: skip
        made.set("ros.topics.positions", "gps/fix", "a guess: where the fixes are published")
    elif kind == "pose":
        if on[_X] or on[_Y]:
            _topic("poses", topic, sensor, made)
        else:
            made.missing.append(f"{sensor} ({topic}): a pose is fused with its position")
    else:
        _odometry(sensor, topic, on, made)


def _odometry(sensor: str, topic: str, on: list[bool], made: _Made) -> None:
    if not any(on[:_AX]):
        made.missing.append(f"{sensor} ({topic}): nothing of it is switched on")
    elif _topic("odometry", topic, sensor, made):
        is_pose = on[_X] or on[_Y] or not (on[_VX] or on[_VY] or on[_VYAW])
        why = "fuses positions; their increments count" if is_pose else "fuses no position"
        made.set("ros.odometry_from", "pose" if is_pose else "twist", f"{sensor}_config {why}")


def _imu(sensor: str, topic: str, on: list[bool], made: _Made) -> None:
    if on[_VYAW]:
        _topic("imu", topic, sensor, made)
    if on[_YAW]:
        _topic("headings", topic, f"{sensor}, its orientation", made)
    if not on[_VYAW] and not on[_YAW]:
        made.missing.append(f"{sensor} ({topic}): neither its yaw nor its yaw rate is switched on")


def _topic(source: str, topic: str, why: str, made: _Made) -> bool:
    """Take a topic for a source, unless one of the two is taken; return whether it was."""
    taken = made.topics
    others = [key for key, name in taken.items() if plain(name) == plain(topic)
              and {key, source} != BOTH]  # fmt: skip
    if source in taken:
        made.missing.append(f"{why} ({topic}): {source} come from one topic, here {taken[source]}")
        return False
    if others:
        made.missing.append(f"{why} ({topic}): that topic is taken for {others[0]}")
        return False
    made.use(source)
    made.set(f"{_TOPICS}{source}", topic, why)
    return True


def _free_topics(made: _Made) -> None:
    """Switch off what is not used and would have a topic that is."""
    taken = set(map(plain, made.topics.values()))
    for key in SUBSCRIBED:
        if key not in made.topics and taken & set(Topics().of(key)):
            made.set(f"{_TOPICS}{key}", None, "not used, and its usual topic is another's")


def _navsat(name: str, given: Mapping[str, Any], made: _Made) -> None:
    made.use("positions")
    made.set("ros.topics.positions", "gps/fix", f"a guess: what {_shown(name)} is remapped to")
    datum = given.get("datum")
    if datum is not None:
        at = [made.number("datum", one) for one in datum[:3]] if isinstance(datum, list) else []
        if len(at) < 3 or None in at or not abs(at[0] or 0.0) <= 90.0:
            made.missing.append(f"datum: {_shown(datum)}; expected latitude, longitude, heading")
        else:
            latitude, longitude, heading = (float(one or 0.0) for one in at)
            longitude = (longitude + 180.0) % 360.0 - 180.0
            at_deg = [latitude, longitude, math.degrees(heading)]
            made.set("ros.gps_origin", at_deg, f"datum of {_shown(name)}")
    turned = sum(made.number(key, given[key]) or 0.0 for key in _NAVSAT[:2] if given.get(key))
    if turned and "headings" in made.uses:
        why = "less magnetic_declination_radians and yaw_offset; the rest is learnt"
        made.set("estimator.heading.offset_rad", -turned, why)


def _rest(name: str, given: Mapping[str, Any], made: _Made) -> None:
    """Say of every other key what it is here, or that it has no counterpart."""
    others = []
    for key in given:
        if _SENSOR.match(key):
            continue
        if key not in _KNOWN:
            others.append(_shown(key))
        elif _KNOWN[key]:
            made.missing.append(f"{key}: {_KNOWN[key]}")
    if others:
        made.missing.append(f"{_shown(name)}: {', '.join(others)}")


def _text(name: str, made: _Made) -> str:
    start, why = made.values.pop("start", ("auto", "found without a prior"))
    if not {"positions", "poses"} & set(made.uses) and start == "auto":
        made.missing.append("start: nothing of this says where the robot is; add ranges, "
                            "positions, poses or a map, or set start")  # fmt: skip
    lines = [("use", made.uses, _shown(name)), ("start", start, why),
             *((key, value, _shown(why)) for key, (value, why) in made.values.items())
             ]  # fmt: skip
    missing = "".join(f"# {_shown(one)}\n" for one in made.missing)
    return "".join(written(lines)) + (f"\n# Without counterpart:\n{missing}" if missing else "")


def _shown(value: Any) -> str:
    """Return a value in one line, for a comment or a sentence."""
    return " ".join(str(value).split())[:300]
