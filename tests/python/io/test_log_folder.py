# SPDX-License-Identifier: Apache-2.0
"""Log folders: what is written is read back, and what a reader must not accept is named."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse.config.scenario import Latency, OdometrySensor, PositionSensor, RangeSensor, Scenario
from locfuse.io.log_folder import FORCES, MESSAGES, RATES, SCHEMA, read_log, write_log
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

SENSOR = {"pose_in_body": [0.2, -0.1, 0.5]}
SIGHTINGS = "stamp_s,landmark,range_m,bearing_rad"


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
            "sigma_range_m": np.array([0.1, 0.2]),
            "sigma_bearing_rad": np.array([0.01, 0.02]),
            "elevation_rad": np.array([0.3, -1.5]),
            "sigma_elevation_rad": np.array([0.01, 0.03]),
        },
        "altitudes": {
            "stamp_ns": stamp,
            "height_m": np.array([-0.5, 2.0]),
            "sigma_m": np.array([0.1, 0.3]),
        },
        "headings": {
            "stamp_ns": stamp,
            "heading_rad": np.array([-0.5, 40.0]),
            "sigma_rad": np.array([0.1, 0.3]),
            "is_course": np.array([0.0, 1.0]),
        },
        "scans": {
            "stamp_ns": stamp,
            "ranges_m": np.array([[1.0, np.nan, 2.0], [0.1, 0.2, 0.3]]),
            "intensities": np.array([[0.0, 3.5, np.nan], [1.0, 0.0, 0.0]]),
        },
        "relations": {
            "begin_ns": np.array([200_000_000, 5]),
            "end_ns": np.array([100_000_001, 5]),
            "dx_m": np.array([-1.0, 300.0]),
            "dy_m": np.array([0.5, 0.0]),
            "dheading_rad": np.array([3.0, -0.1]),
        },
        "imu": {name: np.array([0.5, -1.0]) for name in (*RATES, *FORCES)}
        | {"stamp_ns": np.array([0, 10])},
        "landmarks": {"landmark": np.array(["tree"]), "x_m": np.ones(1), "y_m": np.ones(1)},
    }
    tags = {"tag": (0.1, 0.2, 1.1)}
    return replace(
        log, tables={**log.tables, **extra}, tags=tags, laser=LASER, landmark_sensor=SENSOR,
        licence="none",
    )  # fmt: skip


def assert_same(found: Log, expected: Log) -> None:
    assert set(found.tables) == set(expected.tables)
    for stem in expected.tables:
        assert set(found[stem]) == set(expected[stem])
        for name, values in expected[stem].items():
            np.testing.assert_array_equal(found[stem][name], values, err_msg=f"{stem}.{name}")
    assert (found.tags, found.laser, found.map) == (expected.tags, expected.laser, expected.map)
    assert found.landmark_sensor == expected.landmark_sensor
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


@pytest.mark.parametrize(
    ("stem", "absent"),
    [
        ("landmark_sightings", ("sigma_range_m", "sigma_bearing_rad", "sigma_elevation_rad")),
        ("landmark_sightings", ("elevation_rad", "sigma_elevation_rad")),
        ("altitudes", ("sigma_m",)),
        ("headings", ("sigma_rad",)),
        ("headings", ("is_course",)),
        ("scans", ("intensities",)),
        ("truth", ("heading_rad",)),
    ],
)
def test_what_a_table_may_leave_out_is_left_out(
    stem: str, absent: tuple[str, ...], tmp_path: Path
) -> None:
    log = full_log()
    shorter = {name: values for name, values in log[stem].items() if name not in absent}
    assert len(shorter) == len(log[stem]) - len(absent)
    log = replace(log, tables={**log.tables, stem: shorter}, landmark_sensor=None)
    write_log(log, tmp_path)
    assert_same(read_log(tmp_path), log)


@pytest.mark.parametrize("heading", [True, False])
@pytest.mark.parametrize("radius", [True, False])
def test_truth_and_landmarks_may_have_heights(heading: bool, radius: bool, tmp_path: Path) -> None:
    log = full_log()
    truth = {**log["truth"], "z_m": np.linspace(-1.0, 2.0, len(log["truth"]["x_m"]))}
    landmarks = {**log["landmarks"], "z_m": np.array([-0.5]), "radius_m": np.array([0.1])}
    if not heading:
        del truth["heading_rad"]
    if not radius:
        del landmarks["radius_m"]
    log = replace(log, tables={**log.tables, "truth": truth, "landmarks": landmarks})
    write_log(log, tmp_path)
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
        ("landmark_sensor: {}", "landmark_sensor: pose_in_body is missing"),
        ("landmark_sensor: [0, 0, 0]", "landmark_sensor: [0, 0, 0], expected keys pose_in_body"),
        ("landmark_sensor: {pose_in_body: [0, 0]}", "pose_in_body is [0, 0], expected three"),
        ("landmark_sensor: {pose_in_body: [0, 0, .inf]}", "pose_in_body is inf, expected a finite"),
        ("landmark_sensor: {pose: [0, 0, 0]}", "unknown key 'pose'; did you mean 'pose_in_body'?"),
        ("landmark_sensors: {}", "'landmark_sensors'; did you mean 'landmark_sensor'?"),
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


def test_a_table_without_rows_is_written_and_read_back(tmp_path: Path) -> None:
    # It was refused: nothing was reshaped into nothing.
    names = {"tag": np.zeros(0, np.str_), "anchor": np.zeros(0, np.str_)}
    table = {"stamp_ns": np.zeros(0, np.int64), **names, "range_m": np.zeros(0)}
    position = {"stamp_ns": np.zeros(1, np.int64), **{k: np.ones(1) for k in ("x_m", "y_m")}}
    log = Log(tables={"ranges": table, "positions": {**position, "sigma_m": np.ones(1)}})
    write_log(log, tmp_path / "log")
    again = read_log(tmp_path / "log")
    assert list(again["ranges"]) == ["stamp_ns", "tag", "anchor", "range_m"]
    assert len(again["ranges"]["range_m"]) == 0


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


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("stamp_s,r0,r1,i0\n0,1,2,3\n", "line 1: column 'i1' is missing"),
        ("stamp_s,r0,i0,i1\n0,1,2,3\n", "line 1: column 'r1' is missing"),
        ("stamp_s,r0,r1,i0,i2\n0,1,2,3,4\n", "line 1: column 'i1' is missing"),
        ("stamp_s,i0,i1\n0,1,2\n", "line 1: column 'r0' is missing"),
        ("stamp_s,ranges_m\n0,1\n", "line 1: unknown column 'ranges_m'"),
        ("stamp_s,r0,intensities\n0,1,2\n", "line 1: unknown column 'intensities'"),
        ("stamp_s,r0,i0\n0,1,2\n1,1,-2\n", "line 3: an intensity is negative: -2"),
        ("stamp_s,r0,i0\n0,1,bright\n", "line 2: column 3 ('bright') is not a number"),
    ],
)
def test_intensities_that_are_not_one_for_every_beam_are_refused(
    text: str, what: str, tmp_path: Path
) -> None:
    laser = SCANNER.format(step=0.1, least=0.1)
    with pytest.raises(LogError, match=r"scans\.csv, line") as caught:
        read_log(write_folder(tmp_path, {"scans.csv": text, "log.yaml": laser + TAGS}))
    assert what in str(caught.value)


def test_intensities_follow_the_ranges_in_any_order_and_may_be_unknown(tmp_path: Path) -> None:
    text = "i1,r1,stamp_s,r0,i0\n,2.5,0.5,1.5,4\n"
    laser = SCANNER.format(step=0.1, least=0.1)
    log = read_log(write_folder(tmp_path, {"scans.csv": text, "log.yaml": laser + TAGS}))
    np.testing.assert_array_equal(log["scans"]["ranges_m"], [[1.5, 2.5]])
    np.testing.assert_array_equal(log["scans"]["intensities"], [[4.0, np.nan]])


@pytest.mark.parametrize("shape", [(2, 2), (2, 0), (2,), (1, 3)])
def test_intensities_of_another_shape_are_not_written(
    shape: tuple[int, ...], tmp_path: Path
) -> None:
    log = full_log()
    scans = {**log["scans"], "intensities": np.zeros(shape)}
    with pytest.raises(LogError, match="scans"):
        write_log(replace(log, tables={**log.tables, "scans": scans}), tmp_path / "log")
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (f"{SIGHTINGS},sigma_range_m\n0,,1,0,0.1\n", "column 'sigma_bearing_rad' is missing"),
        (f"{SIGHTINGS},sigma_bearing_rad\n0,,1,0,0.1\n", "column 'sigma_range_m' is missing"),
        (f"{SIGHTINGS},sigma_range_m,sigma_bearing_rad\n0,,1,0,0.1,0\n",
         "line 2: sigma_bearing_rad is not positive: 0"),
        (f"{SIGHTINGS},sigma_range_m,sigma_bearing_rad\n0,,1,0,-0.1,1\n",
         "line 2: sigma_range_m is not positive: -0.1"),
        (f"{SIGHTINGS},sigma_m\n0,,1,0,0.1\n", "unknown column 'sigma_m'"),
    ],
)  # fmt: skip
def test_sigmas_of_sightings_come_in_pairs_and_are_positive(
    text: str, what: str, tmp_path: Path
) -> None:
    with pytest.raises(LogError, match=r"landmark_sightings\.csv, line") as caught:
        read_log(write_folder(tmp_path, {"landmark_sightings.csv": text}))
    assert what in str(caught.value)


@pytest.mark.parametrize(
    ("file", "text", "what"),
    [
        ("truth.csv", "stamp_s,x_m,y_m,z_m\n0,1,2,inf\n", "line 2: .*inf"),
        ("truth.csv", "stamp_s,x_m,z_m\n0,1,2\n", "column 'y_m' is missing"),
        ("landmarks.csv", "landmark,x_m,y_m,z_m\ntree,1,2,\n", "line 2: "),
        ("landmarks.csv", "landmark,x_m,y_m,z_m,radius_m\ntree,1,2,3,0\n", "radius_m is not pos"),
        ("positions.csv", "stamp_s,x_m,y_m,z_m,sigma_m\n0,1,2,3,1\n", "unknown column 'z_m'"),
    ],
)
def test_heights_that_are_none_or_have_no_place_are_refused(
    file: str, text: str, what: str, tmp_path: Path
) -> None:
    with pytest.raises(LogError, match=what):
        read_log(write_folder(tmp_path, {file: text}))


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


def test_positions_may_be_of_tags_and_of_the_antenna(tmp_path: Path) -> None:
    text = "stamp_s,tag,x_m,y_m,sigma_m\n0,front,1,2,0.1\n0,,3,4,0.5\n"
    log = read_log(write_folder(tmp_path / "in", {"positions.csv": text}))
    assert log["positions"]["tag"].tolist() == ["front", ""]

    write_log(log, tmp_path / "out")

    assert (tmp_path / "out" / "positions.csv").read_text().splitlines()[1:] == [
        "0.000000000,front,1.0,2.0,0.1",
        "0.000000000,,3.0,4.0,0.5",
    ]
