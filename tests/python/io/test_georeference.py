# SPDX-License-Identifier: Apache-2.0
"""Latitudes and longitudes in log folders: the metres of a bag, and nothing lost in silence."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.config.ros import Ros
from locfuse.io.geodesy import to_degrees, to_plane
from locfuse.io.log_folder import read_log, read_log_file, read_world, write_log
from locfuse.io.recording import read_recording
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.bag_writer import write_bag
from locfuse.run.run import load_log, run
from locfuse.types import Log, LogError

HERE = (48.137, 11.575, 0.0)
FIXES = "stamp_s,latitude_deg,longitude_deg,altitude_m,sigma_m\n"


def folder(path: Path, positions: str, **others: str) -> Path:
    path.mkdir()
    (path / "positions.csv").write_text(positions)
    for name, text in others.items():
        (path / name.replace("_", ".")).write_text(text)
    return path


def rows(*places: tuple[float, float], sigma: str = "0.5") -> str:
    return "".join(f"{row},{x!r},{y!r},520,{sigma}\n" for row, (x, y) in enumerate(places))


def test_metres_are_those_of_the_plane_at_the_fix(tmp_path: Path) -> None:
    there = (48.1375, 11.576)
    path = folder(tmp_path / "log", FIXES + rows(HERE[:2], there),
                  log_yaml="gps_origin: [48.137, 11.575, 30]\n")  # fmt: skip
    log = read_log(path)
    assert log.gps_origin == (48.137, 11.575, 30.0)
    x, y = to_plane(*there, 520.0, (48.137, 11.575, 30.0))
    assert (log["positions"]["x_m"][1], log["positions"]["y_m"][1]) == (x, y)
    assert list(log["positions"]) == ["stamp_ns", "x_m", "y_m", "sigma_m"]
    write_log(log, tmp_path / "again")
    again = read_log(tmp_path / "again")
    assert again.gps_origin == log.gps_origin
    np.testing.assert_array_equal(again["positions"]["x_m"], log["positions"]["x_m"])


def test_the_configuration_may_say_where_the_map_begins_but_nothing_else(tmp_path: Path) -> None:
    log = read_recording(folder(tmp_path / "a", FIXES + rows(HERE[:2])), Ros(gps_origin=HERE))
    assert log.gps_origin == HERE
    assert (log["positions"]["x_m"][0], log["positions"]["y_m"][0]) == pytest.approx((0, 0))
    write_log(log, tmp_path / "b")
    assert read_recording(tmp_path / "b", Ros(gps_origin=HERE)).gps_origin == HERE
    with pytest.raises(LogError, match=r"log\.yaml: gps_origin is \[48\.137, .* expected the same"):
        read_recording(tmp_path / "b", Ros(gps_origin=(48.0, 11.0, 0.0)))


def test_a_bag_of_it_keeps_the_origin(tmp_path: Path) -> None:
    log = read_log(folder(tmp_path / "a", FIXES + rows(HERE[:2], (48.1371, 11.575))), HERE)
    write_bag(log, tmp_path / "drive.mcap")
    back = read_bag(tmp_path / "drive.mcap")
    assert back.gps_origin == HERE
    np.testing.assert_array_equal(back["positions"]["y_m"], log["positions"]["y_m"])


def test_a_receiver_without_a_fix_and_one_that_leaps_lose_only_their_rows(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    none = "stamp_s,latitude_deg,longitude_deg,quality\n0,0,0,0\n"
    odometry = "stamp_s,v_mps,omega_radps\n0,0,0\n1,0,0\n"
    indoors = read_log(folder(tmp_path / "a", none, odometry_csv=odometry))
    assert (len(indoors["positions"]["x_m"]), indoors.gps_origin) == (0, None)
    with pytest.raises(LogError, match="no message"):
        read_log(folder(tmp_path / "b", none))
    leap = FIXES + rows(HERE[:2], HERE[:2], (10.0, 11.575), HERE[:2])
    assert len(read_log(folder(tmp_path / "c", leap))["positions"]["x_m"]) == 3
    assert "1 of 4 positions are without a fix or far away" in caplog.text


def test_longitudes_from_0_to_360_are_written_too(tmp_path: Path) -> None:
    log = read_log(folder(tmp_path / "a", FIXES + rows((48.0, 350.0), (48.0, 350.0001))))
    assert log.gps_origin == (48.0, -10.0, 0.0)
    write_log(log, tmp_path / "b")
    assert log["positions"]["x_m"][1] == pytest.approx(7.47, abs=0.01)


def test_one_file_alone_has_no_place_for_degrees(tmp_path: Path) -> None:
    path = tmp_path / "anchors.csv"
    path.write_text("anchor,latitude_deg,longitude_deg,z_m\nA,48,11,2\n")
    with pytest.raises(LogError, match="latitudes need a log folder"):
        read_log_file(path, "anchors")


def test_the_first_fix_that_another_confirms_is_the_origin(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    far = (49.0, 9.0)  # where the receiver was last on
    text = FIXES + rows(far, (0.0, 0.0), HERE[:2], (48.13701, 11.575))
    with caplog.at_level(logging.WARNING, "locfuse"):
        log = read_log(folder(tmp_path / "log", text))
    assert log.gps_origin == HERE
    assert "1 of 4 positions are without a fix or far away, and left out" in caplog.text
    assert "the map's origin is the first fix, at latitude 48.137 and longitude 11.575" in (
        caplog.text
    )
    at = np.hypot(log["positions"]["x_m"], log["positions"]["y_m"])
    assert at[1:] == pytest.approx([0.0, 1.112], abs=0.01)


def test_qualities_choose_sigmas_and_rows_without_a_fix_go(tmp_path: Path) -> None:
    text = "stamp_s,latitude_deg,longitude_deg,quality\n" + "".join(
        f"{row},48.137,11.575,{quality}\n" for row, quality in enumerate([0, 1, 4, 5, 6, 2])
    )
    table = read_log(folder(tmp_path / "log", text), HERE)["positions"]
    np.testing.assert_array_equal(table["sigma_m"], [3.0, 0.02, 0.3, 1.0])
    assert "quality" not in table
    both = text.replace("quality", "quality,sigma_m").replace(",4\n", ",4,0.05\n")
    both = "\n".join(line if line.count(",") == 4 else line + ",-1" for line in both.splitlines())
    table = read_log(folder(tmp_path / "both", both + "\n"), HERE)["positions"]
    np.testing.assert_array_equal(table["sigma_m"], [3.0, 0.05, 0.3, 1.0])


def test_anchors_and_the_reference_may_be_on_earth_too(tmp_path: Path) -> None:
    path = folder(
        tmp_path / "log",
        FIXES + rows(HERE[:2], HERE[:2]),
        log_yaml="gps_origin: [48.137, 11.575, 0]\n",
        anchors_csv="anchor,latitude_deg,longitude_deg,z_m\nA,48.138,11.575,2\n",
        truth_csv="stamp_s,latitude_deg,longitude_deg\n0,48.137,11.575\n1,48.137,11.5751\n",
    )  # fmt: skip
    log = read_log(path)
    assert log["anchors"]["y_m"][0] == pytest.approx(111.2, abs=0.1)
    assert log["truth"]["x_m"][1] == pytest.approx(7.45, abs=0.01)
    assert read_world(path)["anchors"]["y_m"][0] == log["anchors"]["y_m"][0]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (FIXES + "0,4808.22,11.5,520,1\n", "line 2: latitude_deg is 4808.22, expected at most 90; "
         "NMEA's ddmm.mm"),
        (FIXES + rows((12.0, 11.0)), "positions: latitude 12, longitude 11 is .* km from the "
         "map's origin at 48.137, 11.575; gps_origin has to be near"),
        ("stamp_s,latitude_deg,longitude_deg,quality\n0,48,11,1.5\n", "line 2: a quality is none"),
        ("stamp_s,latitude_deg,longitude_deg\n0,48,11\n", "column 'sigma_m' is missing"),
        ("stamp_s,latitude_deg,x_m,sigma_m\n0,48,11,1\n", "does not go with"),
    ],
)  # fmt: skip
def test_one_sentence_for_what_is_wrong(text: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(LogError, match=why):
        read_log(folder(tmp_path / "log", text), HERE)


@pytest.mark.parametrize("origin", ["[91, 0, 0]", "[48, 11]", "[48, 11, .nan]"])
def test_an_origin_that_is_none(origin: str, tmp_path: Path) -> None:
    path = folder(tmp_path / "log", FIXES + rows(HERE[:2]), log_yaml=f"gps_origin: {origin}\n")
    with pytest.raises(LogError, match=r"log\.yaml: gps_origin"):
        read_log(path)


def test_anchors_without_any_origin_say_which_key(tmp_path: Path) -> None:
    path = tmp_path / "world"
    path.mkdir()
    (path / "anchors.csv").write_text("anchor,latitude_deg,longitude_deg,z_m\nA,48,11,2\n")
    with pytest.raises(LogError, match=r"anchors have latitudes .* expected gps_origin"):
        read_world(path)
    assert read_world(path, (48.0, 11.0, 0.0))["anchors"]["x_m"][0] == 0.0


def test_a_run_on_degrees_is_that_on_metres(tmp_path: Path) -> None:
    config = parse_config({
        "simulation": {"duration_s": 20, "anchors": {}, "ranges": None, "poses": None,
                       "positions": {"rate_hz": 2, "sigma_xy_m": 0.5}},
        "use": ["odometry", "positions"], "start": "truth",
    })  # fmt: skip
    log = load_log(config, None, 3)
    fixes = log["positions"]
    degrees = np.array([to_degrees(x, y, HERE)
                        for x, y in zip(fixes["x_m"], fixes["y_m"], strict=True)])  # fmt: skip
    table = {"stamp_ns": fixes["stamp_ns"], "latitude_deg": degrees[:, 0],
             "longitude_deg": degrees[:, 1], "sigma_m": fixes["sigma_m"]}  # fmt: skip
    write_log(replace(log, tables={**log.tables, "positions": table}, gps_origin=HERE),
              tmp_path / "log")  # fmt: skip
    found, expected = run(config, read_log(tmp_path / "log")), run(config, log)
    np.testing.assert_allclose(found.estimate.position, expected.estimate.position, atol=1e-5)
    assert isinstance(found.log, Log)
    assert found.log.gps_origin == HERE
