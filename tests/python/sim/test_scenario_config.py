# SPDX-License-Identifier: Apache-2.0
"""A scenario says what it means, and nonsense is refused in words."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from pydantic import ValidationError

from locfuse.config.scenario import Circle, Nlos, Scenario, Star


def test_a_scenario_survives_the_way_through_json() -> None:
    scenario = Scenario.model_validate(
        {
            "path": {"shape": "star", "points": 7},
            "positions": {"sigma_xy_m": 1.0},
            "poses": None,
            "faults": [
                {"kind": "nlos", "walls": [[1, 2, 3, 4]], "extra_m": 0.3},
                {"kind": "dropouts", "source": "odometry", "from_s": 1.0, "to_s": 2.0},
            ],
        }
    )

    again = Scenario.model_validate(json.loads(json.dumps(scenario.model_dump(mode="json"))))

    assert again == scenario
    assert isinstance(again.path, Star)
    assert isinstance(again.faults[0], Nlos)


def test_defaults_are_those_of_the_paper() -> None:
    scenario = Scenario()

    assert scenario.room_m == (10.0, 10.0)
    assert len(scenario.anchors) == 5
    assert scenario.odometry is not None
    assert scenario.odometry.rate_hz == 30.0
    assert scenario.ranges is not None
    assert (scenario.ranges.rate_hz, scenario.ranges.sigma_relative) == (5.0, 0.015)
    assert scenario.poses is not None
    assert scenario.poses.rate_hz == 2.0
    assert math.sqrt(2.0) * scenario.poses.sigma_xy_m == pytest.approx(0.06)


def test_a_scenario_does_not_change() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        Scenario().duration_s = 3.0
    with pytest.raises(ValidationError, match="frozen"):
        Circle().radius_m = 3.0


NLOS = {"kind": "nlos", "walls": [[0.0, 0.0, 1.0, 1.0]], "extra_m": 0.3}
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": ({"duration": 3}, "unknown key .duration.; did you mean .duration_s."),
    "unknown path": ({"path": {"shape": "spiral"}}, "'circle', 'eight', 'square', 'star'"),
    "key of another path": ({"path": {"shape": "circle", "side_m": 2.0}}, "unknown key .side_m."),
    "unknown fault": ({"faults": [{"kind": "gremlin"}]}, "'nlos', 'bias', 'wander', 'outliers'"),
    "not a number": ({"duration_s": math.nan}, "finite number"),
    "infinite": ({"tags": {"t": [0, 0, math.inf]}}, "finite number"),
    "no time": ({"duration_s": 0.0}, "greater than 0"),
    "negative sigma": ({"ranges": {"sigma_m": -0.1}}, "greater than or equal to 0"),
    "no rate": ({"ranges": {"rate_hz": 0}}, "greater than 0"),
    "even star": ({"path": {"shape": "star", "points": 6}}, "star of 6 points.*odd"),
    "two corners": ({"path": {"shape": "polygon", "corners": 2}}, "greater than or equal to 3"),
    "polygon outside": (
        {"path": {"shape": "polygon", "radius_m": 5.5}},
        "polygon around .* reaches 5.5 m in x",
    ),
    "path outside": (
        {"path": {"shape": "eight", "radius_m": 3.0}},
        r"eight around \(5.0, 5.0\) reaches 6.0 m in x.*leaves the room of 10.0 m x 10.0 m",
    ),
    "path off centre": (
        {"path": {"shape": "circle", "center_m": [5.0, 8.0]}},
        r"circle around \(5.0, 8.0\).*leaves the room",
    ),
    "square outside": ({"path": {"shape": "square", "side_m": 10.5}}, "reaches 5.25 m in x"),
    "margin": (
        {"path": {"shape": "waypoints", "margin_m": 5.0}},
        "margin_m is 5.0.*leaves nothing",
    ),
    "one point": ({"path": {"shape": "points", "points_m": [[1, 1]]}}, "at least 2 items"),
    "a leg of no length": (
        {"path": {"shape": "points", "points_m": [[1, 1], [2, 2], [2, 2]]}},
        r"points_m.1 and the point after it are both \(2.0, 2.0\)",
    ),
    "a closed path that ends where it begins": (
        {"path": {"shape": "points", "points_m": [[1, 1], [2, 2], [1, 1]], "closed": True}},
        r"points_m.2 and the point after it are both \(1.0, 1.0\)",
    ),
    "points outside": (
        {"path": {"shape": "points", "points_m": [[1, 1], [2, 12]]}},
        r"path.points_m.1 is \(2.0, 12.0\), outside of the room of 10.0 m x 10.0 m",
    ),
    "roaming nowhere": ({"path": {"shape": "roam"}}, "a robot that roams needs a map"),
    "seed of nothing": ({"map": {"seed": 3}}, "seed is 3, but nothing is made from it"),
    "unknown world": ({"map": {"generate": "maze"}}, "'warehouse', 'zhang' or 'floor'"),
    "cells of no size": ({"map": {"resolution_m": 0}}, "greater than or equal to 0.000001"),
    "cells of less": ({"map": {"resolution_m": -0.05}}, "greater than or equal to 0.000001"),
    "cells too large": ({"map": {"resolution_m": 2e6}}, "less than or equal to 1000000"),
    "drive of ages": ({"duration_s": 1.1e9}, "less than or equal to 1000000000"),
    "too many tips": ({"path": {"shape": "star", "points": 1001}}, "less than or equal to 1000"),
    "too many corners": (
        {"path": {"shape": "polygon", "corners": 1001}},
        "less than or equal to 1000",
    ),
    "seed too large": (
        {"map": {"generate": "rooms", "seed": 2**64}},
        "less than 18446744073709551616",
    ),
    "world and file": (
        {"map": {"file": "a.yaml", "generate": "rooms"}},
        "which leaves nothing for generate",
    ),
    "all off": ({"odometry": None, "ranges": None, "poses": None}, "at least one"),
    "ranges to nobody": ({"anchors": {}}, "anchors is empty"),
    "ranges from nobody": ({"tags": {}}, "tags is empty"),
    "nameless anchor": ({"anchors": {"": [0, 0, 0]}}, "at least 1 character"),
    "too fast to see": (
        {"odometry": {"rate_hz": 0.5}, "path": {"shape": "square", "turn_rate_radps": 2.0}},
        "turns 4 rad; expected less than half a turn",
    ),
    "lateral velocities": (
        {"odometry": {"output": "velocities", "sigma_lateral_per_sqrt_m": 0.01}},
        "no lateral motion",
    ),
    "no wall": ({"faults": [{**NLOS, "walls": []}]}, "at least 1 item"),
    "wall of no length": (
        {"faults": [{**NLOS, "walls": [[0, 0, 1, 1], [2, 3, 2, 3]]}]},
        r"wall 1 begins and ends at \(2.0, 3.0\)",
    ),
    "wall of three numbers": ({"faults": [{**NLOS, "walls": [[0, 0, 1]]}]}, r"walls\.0\.3"),
    "bias of an unknown anchor": (
        {"faults": [{"kind": "bias", "anchor": "A9", "offset_m": 1.0}]},
        r"faults.0 \(bias\) names anchor 'A9'; expected one of A1, A2, A3, A4, A5",
    ),
    "dropouts of an unknown anchor": (
        {"faults": [NLOS, {"kind": "dropouts", "anchor": "B", "probability": 0.1}]},
        r"faults.1 \(dropouts\) names anchor 'B'",
    ),
    "bias of nothing": ({"faults": [{"kind": "bias", "anchor": "A1"}]}, "changes nothing"),
    "probability": (
        {"faults": [{"kind": "outliers", "probability": 1.1, "magnitude_m": 1.0}]},
        "less than or equal to 1",
    ),
    "dropouts never": (
        {"faults": [{"kind": "dropouts"}]},
        "need a probability, or from_s and to_s",
    ),
    "dropouts half said": (
        {"faults": [{"kind": "dropouts", "probability": 0.1, "from_s": 2.0}]},
        "belong together",
    ),
    "dropouts backwards": (
        {"faults": [{"kind": "dropouts", "from_s": 2.0, "to_s": 2.0}]},
        "from_s is 2.0 and to_s is 2.0; expected from_s < to_s",
    ),
    "anchor of a pose": (
        {"faults": [{"kind": "dropouts", "source": "poses", "probability": 1, "anchor": "A1"}]},
        "poses have no anchor",
    ),
    "fault of a sensor that is off": (
        {"faults": [{"kind": "latency", "source": "positions", "delay_s": 0.1}]},
        r"faults.0 \(latency\) acts on positions, which is switched off",
    ),
    "slip without odometry": (
        {
            "odometry": None,
            "faults": [{"kind": "wheel_slip", "from_s": 1, "to_s": 2, "translation_factor": 1.5}],
        },
        "acts on odometry, which is switched off",
    ),
    "slip of nothing": (
        {"faults": [{"kind": "wheel_slip", "from_s": 1, "to_s": 2}]},
        "changes nothing",
    ),
    "slips of nothing": (
        {"faults": [{"kind": "slip_episodes", "every_s": 5, "lasting_s": 1}]},
        "translation_factor 1 and turn_radps 0 change nothing",
    ),
    "slips without end": (
        {"faults": [{"kind": "slip_episodes", "every_s": 1e-9, "lasting_s": 1, "turn_radps": 1}]},
        "greater than or equal to 0.1",
    ),
    "glass of nothing": (
        {"laser": {}, "map": {}, "faults": [{"kind": "glass", "probability": 0.5}]},
        "no panes and a share of 0 changes nothing",
    ),
    "glass without a laser": (
        {"faults": [{"kind": "glass", "share": 0.1, "probability": 0.5}]},
        r"faults.0 \(glass\) acts on laser, which is switched off",
    ),
    "nobody": ({"laser": {}, "map": {}, "faults": [{"kind": "people", "count": 0}]}, "equal to 1"),
    "slip backwards": (
        {"faults": [{"kind": "wheel_slip", "from_s": 3, "to_s": 2, "rotation_factor": 0.5}]},
        "from_s < to_s",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_nonsense_is_refused_in_words(name: str) -> None:
    scenario, text = REFUSED[name]

    with pytest.raises(ValueError, match=f"(?s){text}"):
        Scenario.model_validate(scenario)
