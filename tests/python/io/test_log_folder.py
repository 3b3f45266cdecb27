# SPDX-License-Identifier: Apache-2.0
"""Log folders: what is written is read back, and what a reader must not accept is named."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse.config.scenario import (
    Latency,
    OdometrySensor,
    PositionSensor,
    RangeSensor,
    Scenario,
)
from locfuse.io.log_folder import MESSAGES, SCHEMA, read_log, write_log
from locfuse.sim.scenario import simulate
from locfuse.types import GridMap, Log, LogError
from support_runs import GOOD, write_folder

TAGS = "\ntags: {tag: [0, 0, 1]}"
SCANNER = (
    "laser: {{pose_in_body: [0, 0, 0], angle_min_rad: 0, angle_increment_rad: {step}, "
    "range_min_m: {least}, range_max_m: 9.0}}"
)
LASER = {
    "pose_in_body": [0.1, 0.0, 0.0],
    "angle_min_rad": -1.0,
    "angle_increment_rad": 1.0,
    "range_min_m": 0.1,
    "range_max_m": 10.0,
}


def full_log() -> Log:
    """Return a log that has every table of the schema."""
    scenario = Scenario(
        duration_s=3.0,
        positions=PositionSensor(),
        ranges=RangeSensor(sigma_m=0.1),
        faults=[Latency(source="poses", delay_s=0.3, jitter_s=0.2)],
    )
    log = simulate(scenario, np.random.default_rng(8))
    stamp = np.array([100_000_001, 200_000_000], dtype=np.int64)
    extra = {
        "landmark_sightings": {
            "stamp_ns": stamp,
            "landmark": np.array(["", "tree"]),
            "range_m": np.array([1.0, 2.0]),
            "bearing_rad": np.array([0.5, -0.5]),
        },
        "scans": {"stamp_ns": stamp, "ranges_m": np.array([[1.0, np.nan, 2.0], [0.1, 0.2, 0.3]])},
        "relations": {
            "begin_ns": np.array([200_000_000, 5]),
            "end_ns": np.array([100_000_001, 5]),
            "dx_m": np.array([-1.0, 300.0]),
            "dy_m": np.array([0.5, 0.0]),
            "dheading_rad": np.array([3.0, -0.1]),
        },
        "landmarks": {"landmark": np.array(["tree"]), "x_m": np.ones(1), "y_m": np.ones(1)},
    }
    tags = {"tag": (0.1, 0.2, 1.1)}
    return replace(log, tables={**log.tables, **extra}, tags=tags, laser=LASER, licence="none")


def assert_same(found: Log, expected: Log) -> None:
    assert set(found.tables) == set(expected.tables)
    for stem in expected.tables:
        assert set(found[stem]) == set(expected[stem])
        for name, values in expected[stem].items():
            np.testing.assert_array_equal(found[stem][name], values, err_msg=f"{stem}.{name}")
    assert (found.tags, found.laser, found.map) == (expected.tags, expected.laser, expected.map)
    assert (found.description, found.licence) == (expected.description, expected.licence)


def test_a_log_with_every_table_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    log = full_log()
    assert set(log.tables) == set(SCHEMA)
    write_log(log, tmp_path / "log")
    assert_same(read_log(tmp_path / "log"), log)


def test_gzipped_files_read_the_same(tmp_path: Path) -> None:
    log = full_log()
    write_log(log, tmp_path)
    for path in tmp_path.glob("*.csv"):
        path.with_name(path.name + ".gz").write_bytes(gzip.compress(path.read_bytes()))
        path.unlink()
    assert_same(read_log(tmp_path), log)


def test_velocities_are_the_other_form_of_odometry(tmp_path: Path) -> None:
    sensor = OdometrySensor(output="velocities")
    log = simulate(Scenario(duration_s=1.0, odometry=sensor), np.random.default_rng(0))
    write_log(log, tmp_path)
    assert (tmp_path / "odometry.csv").read_text().startswith("stamp_s,v_mps,omega_radps\n")
    assert_same(read_log(tmp_path), log)


def test_columns_may_stand_in_any_order(tmp_path: Path) -> None:
    text = "range_m,anchor,stamp_s,tag\n5.0,south,0.0,tag\n"
    log = read_log(write_folder(tmp_path, {"ranges.csv": text}))
    assert log["ranges"]["range_m"].tolist() == [5.0]
    assert log["ranges"]["anchor"].tolist() == ["south"]


def test_messages_out_of_order_are_sorted_by_stamp_unless_they_say_when_they_arrived(
    tmp_path: Path,
) -> None:
    header, rows = "stamp_s,tag,anchor,range_m", ["2.0,tag,a,2", "1.0,tag,a,1", "2.0,tag,a,3"]
    log = read_log(write_folder(tmp_path / "a", {"ranges.csv": "\n".join([header, *rows])}))
    assert log["ranges"]["range_m"].tolist() == [1.0, 2.0, 3.0]

    late = [f"{row},{arrival}" for row, arrival in zip(rows, ("2.0", "2.5", "3.0"), strict=True)]
    text = "\n".join([header + ",arrival_s", *late])
    log = read_log(write_folder(tmp_path / "b", {"ranges.csv": text}))
    assert log["ranges"]["range_m"].tolist() == [2.0, 1.0, 3.0]
    assert log["ranges"]["arrival_ns"].tolist() == [2_000_000_000, 2_500_000_000, 3_000_000_000]


def test_names_that_look_like_numbers_stay_text(tmp_path: Path) -> None:
    files = {
        "ranges.csv": "stamp_s,tag,anchor,range_m\n0,2,007,5.0\n",
        "anchors.csv": "anchor,x_m,y_m,z_m\n007,0,0,0\n",
        "log.yaml": "tags: {2: [0, 0, 0]}\n",
    }
    log = read_log(write_folder(tmp_path, files))
    assert list(log.tags) == ["2"]
    assert log["anchors"]["anchor"].tolist() == ["007"]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("tags: {tag: [0, 0]}", "tags.tag"),
        ("tags: {tag: [0, 0, .nan]}", "tags.tag"),
        ("tags: {tag: [0, 0, up]}", "tags.tag"),
        ("tags: {tag: [0, 0, 1], tag: [0, 0, 2]}", "'tag' is given twice"),
        ("tag: {tag: [0, 0, 1]}", "unknown key 'tag'; did you mean 'tags'?"),
        ("laser: {angle_min_rad: 0}", "laser: pose_in_body is missing"),
        (SCANNER.format(step=0.0, least=0.1), "angle_increment_rad is 0, expected another"),
        (SCANNER.format(step=".nan", least=0.1), "angle_increment_rad is nan, expected a finite"),
        (SCANNER.format(step=0.1, least=-0.1), "-0.1 and 9, expected 0 <= min < max"),
        (SCANNER.format(step=0.1, least=9.0), "9 and 9, expected 0 <= min < max"),
        ("map: 3", "map"),
        ("map: nowhere.yaml", "map 'nowhere.yaml' is not in the folder"),
        ("tags: [", "log.yaml"),
        ("- tags", "expected keys"),
    ],
)
def test_a_log_yaml_that_is_wrong_is_refused_with_its_key(
    tmp_path: Path, text: str, what: str
) -> None:
    with pytest.raises(LogError, match=r"log\.yaml") as caught:
        read_log(write_folder(tmp_path, {"log.yaml": text}))
    assert what in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_csv_file_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, {"range.csv": GOOD["ranges.csv"]})
    with pytest.raises(LogError, match=r"range\.csv: unknown file; did you mean 'ranges'\?"):
        read_log(folder)


def test_a_file_that_is_there_plain_and_gzipped_is_refused(tmp_path: Path) -> None:
    folder = write_folder(tmp_path)
    (folder / "ranges.csv.gz").write_bytes(gzip.compress(GOOD["ranges.csv"].encode()))
    with pytest.raises(LogError, match="expected one of them"):
        read_log(folder)


def test_the_beams_of_a_scan_may_run_clockwise_and_its_empty_fields_are_no_return(
    tmp_path: Path,
) -> None:
    scans = "stamp_s,r0,r1,r2\n0,1.5,,2.5\n"
    text = SCANNER.format(step=-0.1, least=0.1)
    log = read_log(write_folder(tmp_path, {"scans.csv": scans, "log.yaml": text + TAGS}))
    assert log.laser is not None
    assert log.laser["angle_increment_rad"] == -0.1
    np.testing.assert_array_equal(log["scans"]["ranges_m"], [[1.5, np.nan, 2.5]])


@pytest.mark.parametrize("field", ["nan", "inf", "-1", "near"])
def test_a_beam_that_is_no_distance_is_refused_with_its_line(tmp_path: Path, field: str) -> None:
    scans = f"stamp_s,r0,r1\n0,1.5,2\n0.1,1.5,{field}\n"
    text = SCANNER.format(step=0.1, least=0.1)
    with pytest.raises(LogError, match=r"scans\.csv, line 3: "):
        read_log(write_folder(tmp_path, {"scans.csv": scans, "log.yaml": text + TAGS}))


def test_scans_without_a_laser_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"laser in log\.yaml"):
        read_log(write_folder(tmp_path, {"scans.csv": "stamp_s,r0,r1\n0,1,\n"}))


def test_a_folder_without_a_message_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no message"):
        read_log(write_folder(tmp_path / "a", {"odometry.csv": None, "ranges.csv": None}))
    with pytest.raises(LogError, match="no such folder"):
        read_log(tmp_path / "absent")


def test_a_log_is_not_mixed_with_another_that_is_there(tmp_path: Path) -> None:
    log = full_log()
    write_log(log, tmp_path)
    smaller = replace(log, tables={k: v for k, v in log.tables.items() if k != "poses"})
    with pytest.raises(LogError, match=r"poses\.csv: not part of the log"):
        write_log(smaller, tmp_path)
    assert_same(read_log(tmp_path), log)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_what_a_reader_would_refuse_is_not_written(tmp_path: Path, value: float) -> None:
    log = full_log()
    broken = {**log["ranges"], "range_m": np.full_like(log["ranges"]["range_m"], value)}
    with pytest.raises(LogError, match="row 0"):
        write_log(replace(log, tables={**log.tables, "ranges": broken}), tmp_path / "log")
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize("name", ["a,b", 'a"b', "#a", " a", "a\nb", "", "x" * 256])
def test_a_name_that_would_not_read_back_is_not_written(tmp_path: Path, name: str) -> None:
    log = full_log()
    anchors = dict(log["ranges"])
    anchors["anchor"] = np.full(len(anchors["anchor"]), name)
    with pytest.raises(LogError):
        write_log(replace(log, tables={**log.tables, "ranges": anchors}), tmp_path / "log")
    assert not (tmp_path / "log").exists()


def test_the_schema_lists_every_message() -> None:
    assert set(MESSAGES) <= set(SCHEMA)
    for stem in MESSAGES:
        assert all(form[0] == "stamp_s" for form in SCHEMA[stem])


# Maps -----------------------------------------------------------------------------------------


def with_grid(name: str | None) -> Log:
    cells = np.array([[100, 0, -1], [0, 100, 100]], np.int8)
    table = {"stamp_ns": np.array([0, 1]), "v_mps": np.zeros(2), "omega_radps": np.zeros(2)}
    return Log(tables={"odometry": table}, map=name, grid=GridMap(cells, 0.05, (1.0, -2.0, 0.5)))


@pytest.mark.parametrize("name", [None, "floor.yaml"])
def test_a_grid_is_written_and_read_with_its_log(name: str | None, tmp_path: Path) -> None:
    log = with_grid(name)
    write_log(log, tmp_path)
    again = read_log(tmp_path)

    assert again.map == (name or "map.yaml")
    assert log.grid is not None
    assert again.grid is not None
    np.testing.assert_array_equal(again.grid.cells, log.grid.cells)
    assert (again.grid.resolution_m, again.grid.origin) == (0.05, (1.0, -2.0, 0.5))


@pytest.mark.parametrize("name", ["../map.yaml", "map.pgm", "log.yaml"])
def test_a_grid_under_a_name_that_cannot_be_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(LogError, match="log: map is"):
        write_log(with_grid(name), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_log_without_a_map_has_no_grid(tmp_path: Path) -> None:
    write_log(replace(with_grid(None), grid=None), tmp_path)
    assert read_log(tmp_path).grid is None


def test_a_damaged_map_is_an_error_of_its_log(tmp_path: Path) -> None:
    write_log(with_grid(None), tmp_path)
    (tmp_path / "map.pgm").write_bytes(b"P5 3 2 255 \0")
    with pytest.raises(LogError, match=r"map\.pgm: 1 pixels, its header says 3 x 2"):
        read_log(tmp_path)
