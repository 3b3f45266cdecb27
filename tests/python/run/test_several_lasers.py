# SPDX-License-Identifier: Apache-2.0
"""Robots with several lasers, simulated, from a log folder and by particles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.config.load import parse_config
from locfuse.io.log_folder import read_log, write_log
from locfuse.report.player.packing import pack
from locfuse.run.run import load_log, run
from locfuse.types import ConfigError, Log, LogError, RunResult

HALF = {"field_of_view_deg": 180, "beams": 180, "range_max_m": 8.0}
LASERS = {
    "front": {**HALF, "pose_in_body": [0, 0, 0]},
    "rear": {**HALF, "pose_in_body": [0, 0, 180]},
}
FLOOR: dict[str, Any] = {
    "path": {"shape": "roam", "speed_mps": 0.5},
    "map": {"generate": "rooms", "seed": 2},
    "anchors": {},
    "poses": None,
    "ranges": None,
}


def driven(seed: int, duration_s: float = 20.0, **sensors: Any) -> RunResult:
    """Return a run by particles from where the robot stands."""
    simulation = {**FLOOR, "duration_s": duration_s, **sensors}
    config = parse_config({"simulation": simulation, "seed": seed, "mcl": {}, "start": "truth"})
    return run(config, load_log(config, None, seed))


def test_scans_of_both_are_fused() -> None:
    result = driven(1, lasers=LASERS)
    scans = result.outcomes.source == "scans"
    verdict, name = result.outcomes.verdict[scans], result.log["scans"]["laser"]
    shares = {laser: float(np.mean(verdict[name == laser] == "fused")) for laser in LASERS}
    assert min(shares.values()) > 0.4
    assert abs(shares["front"] - shares["rear"]) < 0.1


def test_two_half_blind_lasers_are_as_good_as_a_whole_one() -> None:
    whole, halves = (
        np.sqrt(np.mean([driven(seed, **sensors).metrics["position_rmse_m"] ** 2
                         for seed in range(12)]))
        for sensors in ({"laser": {"beams": 360, "range_max_m": 8.0}}, {"lasers": LASERS})
    )  # fmt: skip
    print(f"whole {100.0 * whole:.2f} cm, two halves {100.0 * halves:.2f} cm")
    assert halves < 1.05 * whole


def test_lasers_of_a_simulation_take_turns_and_see_the_same_people() -> None:
    faults = [{"kind": "people", "count": 4}]
    config = parse_config({"simulation": {**FLOOR, "lasers": LASERS, "faults": faults}, "seed": 4})
    log = load_log(config, None, 4)
    stamp, name = log["scans"]["stamp_ns"], log["scans"]["laser"]
    assert np.all(np.diff(stamp) > 0)
    assert (stamp[name == "rear"][0] - stamp[name == "front"][0]) == 100_000_000
    again = load_log(config, None, 4)
    assert np.array_equal(again["scans"]["ranges_m"], log["scans"]["ranges_m"], equal_nan=True)


def test_a_log_folder_keeps_several_lasers(tmp_path: Path) -> None:
    uneven = {**LASERS, "rear": {**LASERS["rear"], "beams": 90}}
    config = parse_config({"simulation": {**FLOOR, "lasers": uneven, "duration_s": 5}, "seed": 4})
    log = load_log(config, None, 4)
    write_log(log, tmp_path / "log")
    again = read_log(tmp_path / "log")
    assert again.lasers == log.lasers
    assert again.laser is None
    for key, column in log["scans"].items():
        np.testing.assert_array_equal(again["scans"][key], column, key)
    assert again.scan_geometry(1)[1] == 90


def test_the_player_has_the_last_scan_of_each() -> None:
    result = driven(2, 5.0, lasers=LASERS)
    scans = pack(result)["scans"]
    assert [laser["mount"][2] for laser in scans["lasers"]] == pytest.approx([0.0, np.pi])
    assert scans["laser"]["shape"] == scans["t"]["shape"] == [scans["of"]]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            lambda settings: settings["lasers"].pop("rear"),
            "has the laser 'rear', of which log.yaml",
        ),
        (
            lambda settings: settings.update(laser=settings["lasers"]["rear"]),
            "both laser and lasers",
        ),
        (lambda settings: settings.update(lasers=[1]), r"lasers is \[1\], expected NAME"),
        (
            lambda settings: settings["lasers"]["rear"].pop("range_max_m"),
            "lasers.rear: range_max_m",
        ),
    ],
)
def test_a_wrong_log_yaml_is_one_sentence(change: Any, sentence: str, tmp_path: Path) -> None:
    config = parse_config({"simulation": {**FLOOR, "lasers": LASERS, "duration_s": 2}, "seed": 4})
    write_log(load_log(config, None, 4), tmp_path / "log")
    path = tmp_path / "log" / "log.yaml"
    settings = yaml.safe_load(path.read_text())
    change(settings)
    path.write_text(yaml.safe_dump(settings))
    with pytest.raises(LogError, match=sentence):
        read_log(tmp_path / "log")


def test_a_simulation_has_one_or_several() -> None:
    with pytest.raises(ConfigError, match="both laser and lasers are given"):
        parse_config({"simulation": {**FLOOR, "laser": {}, "lasers": LASERS}})
    with pytest.raises(ConfigError, match="a laser needs something to see"):
        parse_config({"simulation": {**FLOOR, "map": None, "lasers": LASERS}})


def test_rows_of_a_run_name_their_laser() -> None:
    log = Log(tables={"scans": {"stamp_ns": np.zeros(1, np.int64), "laser": np.array(["left"]),
                                "ranges_m": np.ones((1, 3))}})  # fmt: skip
    with pytest.raises(LogError, match="nothing is known of the laser 'left'"):
        log.scan_geometry(0)
