# SPDX-License-Identifier: Apache-2.0
"""Small files that once took all memory or time, led out of their folder, or were nowhere."""

from __future__ import annotations

import gzip
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from threading import Timer
from time import process_time
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import load_config, parse_config, read_yaml
from locfuse.io import csv_table
from locfuse.io.log_folder import read_log, read_log_file, write_log
from locfuse.io.log_yaml import read_log_yaml
from locfuse.io.maps import read_map
from locfuse.io.rosbag.bag_settings import settings_of
from locfuse.io.rosbag.decode import MessageError
from locfuse.types import ConfigError, GridMap, Log, LogError, shown
from papers.datasets.rawlog import Reader
from support_pictures import MAP, png_of

# Measure ---------------------------------------------------------------------------------------

WIDE = "[&a0 [1]" + "".join(f", &a{i + 1} [{','.join([f'*a{i}'] * 9)}]" for i in range(9)) + "]"
KEYS = "&many {" + ", ".join(f"k{i}: 1" for i in range(500)) + "}"


def text_file(folder: Path, text: str) -> Path:
    (folder / "file.yaml").write_text(text)
    return folder / "file.yaml"


@pytest.mark.parametrize(
    "text",
    [
        f"description: {WIDE}",  # 400 million numbers in a message
        "description: " + "1:" * 100_000 + "1",  # so many powers of 60
        # 2^40 keys, and 2.5 million, unless PyYAML leaves out what it has merged already
        "a: &a0 {k: v}\n" + "".join(f"b{i}: &a{i + 1} {{<<: [*a{i}, *a{i}]}}\n" for i in range(40)),
        f"a: {KEYS}\nb: {{<<: [{', '.join(['*many'] * 5000)}]}}",
    ],
    ids=["aliases", "sexagesimal", "merges of merges", "merges of the same"],
)
@pytest.mark.parametrize(("read", "error"), [(load_config, ConfigError), (read_log_yaml, LogError)])
def test_yaml_that_grows_when_read_is_refused_at_once(
    read: Callable[[Path], Any], error: type[ValueError], text: str, tmp_path: Path
) -> None:
    path = text_file(tmp_path, text)
    before = process_time()
    with pytest.raises(error, match=r"file\.yaml") as caught:
        read(path)
    assert process_time() - before < 2.0
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize("header", ["x" * 200_000, "stamp_s," + ",".join(["y" * 50_000] * 2)])
def test_of_a_column_of_kilobytes_only_a_part_is_shown(header: str, tmp_path: Path) -> None:
    (tmp_path / "anchors.csv").write_text(header + "\n1\n")
    with pytest.raises(LogError, match=r"anchors\.csv, line 1: ") as error:
        read_log_file(tmp_path / "anchors.csv", "anchors")
    assert len(str(error.value)) < 1000


def test_yaml_of_megabytes_is_refused_at_once(tmp_path: Path) -> None:
    text = "tags:\n" + "".join(f"  t{i}: [0, 0, 1]\n" for i in range(150_000))
    for name, read, kind in (("log.yaml", read_log_yaml, LogError),
                             ("config.yaml", load_config, ConfigError),
                             ("map.yaml", read_map, LogError)):  # fmt: skip
        (tmp_path / name).write_text(text)
        with pytest.raises(kind, match=rf"{name}.*characters of YAML, expected at most 2000000"):
            read(tmp_path / name)


def test_keys_may_be_merged_up_to_a_measure() -> None:
    both = f"a: {KEYS}\nb: {{<<: [*many, *many], own: 2}}"
    assert len(read_yaml(both)["b"]) == 501
    with pytest.raises(ConfigError, match=r"line 2: .*more than 1000 keys are merged"):
        read_yaml(both.replace("*many]", "*many, {one: 1}]"))
    with pytest.raises(ConfigError, match="not valid YAML"):
        read_yaml("a: &a {<<: *a}")


def test_a_mapping_that_others_merge_before_it_is_made_gives_no_key_twice() -> None:
    text = (
        "estimator: {landmark: &sight {<<: {sigma_range_m: 0.1}, sigma_range_m: 0.2}}\n"
        "cylinders: {<<: *sight}\n"
    )
    config = parse_config(read_yaml(text))
    assert config.cylinders is not None
    assert config.cylinders.sigma_range_m == config.estimator.landmark.sigma_range_m == 0.2


def test_settings_in_a_bag_are_read_as_carefully() -> None:
    with pytest.raises(MessageError, match="number of 4002 characters"):
        settings_of(f"format: 0x{'f' * 4000}")


def test_names_by_the_thousand_take_no_longer_than_they_must(tmp_path: Path) -> None:
    names = [f"r{i}" for i in range(20_000)]  # seconds, when each was counted among all
    (tmp_path / "scans.csv").write_text("stamp_s," + ",".join(names))
    before = process_time()
    read_log_file(tmp_path / "scans.csv", "scans")
    parse_config({"ros": {"range_topics": dict.fromkeys(names, "anchor")}})
    assert process_time() - before < 1.0


def test_a_config_of_a_thousand_errors_tells_some_of_them_and_how_many_more() -> None:
    walls = {"simulation": {"map": {"walls": [[0.0, 0.0, 1.0, "x" * 10_000]] * 1000}}}
    with pytest.raises(ConfigError, match=r"walls\.0.* and 980 more$") as caught:
        parse_config(walls)
    assert len(str(caught.value)) < 10_000


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("a" * 1000, "'" + "a" * 47 + "..." + "a" * 48 + "'"),
        ([1.5, "two", [3, [4]]], "[1.5, 'two', [3, [...]]]"),
        (list(range(1000)), "[0, 1, 2, 3, 4, 5, ...]"),
        (10**5000, "an integer of too many digits"),
    ],
    ids=["long", "deep", "wide", "huge"],
)
def test_messages_show_a_part_of_what_is_large(value: object, text: str) -> None:
    assert shown(value) == text


# Pictures --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "image",
    [
        png_of(13_000, 13_000, 1, bytes(13_000 * 1626)),  # 20 kB that took 6.8 GB, and a warning
        b"P5" + b" " * 100_000 + b"1 1 255 \0",  # 115 bytes of memory for each
    ],
    ids=["png", "pgm"],
)
def test_a_picture_that_grows_when_read_is_refused_without_a_warning(
    image: bytes, tmp_path: Path
) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    (tmp_path / "map.pgm").write_bytes(image)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(LogError, match=r"map\.pgm"):
            read_map(tmp_path / "map.yaml")


def test_a_picture_that_is_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    os.mkfifo(tmp_path / "map.pgm")
    writer = os.open(tmp_path / "map.pgm", os.O_RDWR)
    end = Timer(0.5, os.close, (writer,))  # whoever reads it is not stuck
    end.start()
    try:
        with pytest.raises(LogError, match=r"map\.pgm: is a device or a pipe"):
            read_map(tmp_path / "map.yaml")
    finally:
        end.join()


def test_a_small_file_that_unpacks_to_a_huge_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(csv_table, "MAX_UNPACKED", 1 << 20)
    path = tmp_path / "truth.csv.gz"
    for spare, refused in ((0, False), (1, True)):
        text = b"stamp_s,x_m,y_m\n0,0,0\n"
        comment = b"#" + bytes((1 << 20) - len(text) - 1 + spare)
        path.write_bytes(gzip.compress(text) + gzip.compress(comment))
        if refused:
            for read in (lambda: read_log_file(path, "truth"), lambda: Reader(path)):
                with pytest.raises(LogError, match=r"truth\.csv\.gz: .* more than 1048576 bytes"):
                    read()
        else:
            assert len(read_log_file(path, "truth")["stamp_ns"]) == 1
            assert len(Reader(path).data) == 1 << 20


# Places ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a" * 300, "/etc/passwd", "../log/map.yaml", "./map.yaml"])
def test_a_map_that_is_not_in_the_folder_is_refused(name: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    (log / "odometry.csv").write_text("stamp_s,v_mps,omega_radps\n0,0,0\n")
    (log / "map.yaml").write_text(MAP)
    (log / "map.pgm").write_bytes(b"P5 1 1 255 \0")
    (log / "log.yaml").write_text(f"map: {name}\n")
    with pytest.raises(LogError, match=r"log\.yaml: map .* is not in the folder"):
        read_log(log)
    (log / "log.yaml").write_text("map: map.yaml\n")
    assert read_log(log).map == "map.yaml"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("0.05", "1.0e-9"),  # a likelihood field of it wrote where it had no memory
        ("0.05", "5.0e-324"),
        ("0.05", "1.0e+308"),
        ("[0, 0, 0]", "[1.0e+308, 0, 0]"),
        ("[0, 0, 0]", "[0, 0, -1.1e+9]"),
    ],
)
def test_a_map_that_is_nowhere_or_of_no_size_is_refused(old: str, new: str, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP.replace(old, new))
    (tmp_path / "map.pgm").write_bytes(b"P5 1 1 255 \0")
    with pytest.raises(LogError, match=r"map\.yaml: (resolution|origin) is .*, expected"):
        read_map(tmp_path / "map.yaml")


@pytest.mark.parametrize("resolution", [1e-6, 1e6])
@pytest.mark.parametrize("place", [-1e9, 1e9])
def test_a_grid_and_the_core_know_the_same_bounds(resolution: float, place: float) -> None:
    cells = np.zeros((1, 1), np.int8)
    GridMap(cells, resolution, (place, place, place)).occupancy_grid()
    beyond = resolution * (0.999 if resolution < 1.0 else 1.001)
    for of_no_size in (beyond, float("nan")):
        with pytest.raises(ValueError, match="resolution_m is"):
            GridMap(cells, of_no_size)
    with pytest.raises(ValueError, match="origin is"):
        GridMap(cells, resolution, (0.0, 1.001 * place, 0.0))


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ("9.2e9,0,0\n-9.2e9,0,0\n", "line 2: stamp_s is 9200000000"),  # 64 bits: increasing
        ("-9.2e9,0,0\n9.2e9,0,0\n", "line 2: stamp_s is -9200000000"),  # and these not
        ("0,1e308,0\n1,-1e308,0\n", "line 2: x_m is 1e"),  # numpy warned of an overflow
        ("0,0,0\n1,0,-1.1e9\n", "line 3: y_m is -1.1e"),
    ],
)
def test_stamps_and_places_that_no_robot_sees_are_refused(
    rows: str, text: str, tmp_path: Path
) -> None:
    (tmp_path / "truth.csv").write_text(f"stamp_s,x_m,y_m\n{rows}")
    with pytest.raises(LogError, match=rf"truth\.csv, {text}"):
        read_log_file(tmp_path / "truth.csv", "truth")


@pytest.mark.parametrize("stamp_ns", [-(1 << 62), 1 << 62])
def test_stamps_that_no_robot_sees_are_not_written(stamp_ns: int, tmp_path: Path) -> None:
    table = {name: np.zeros(1) for name in ("dx_m", "dy_m", "dheading_rad")}
    for stamp, refused in ((stamp_ns, True), (stamp_ns - np.sign(stamp_ns), False)):
        log = Log(tables={"odometry": {"stamp_ns": np.array([stamp], np.int64), **table}})
        if refused:
            with pytest.raises(LogError, match=r"stamp_s is .* expected less than 4\.612e\+09 s"):
                write_log(log, tmp_path)
        else:
            write_log(log, tmp_path)
            assert read_log(tmp_path)["odometry"]["stamp_ns"].tolist() == [stamp]


@pytest.mark.parametrize("row", ["1,1.7e308,1.7e308,0", "1e-9,1e300,0,0", "1e-9,0,0,1e300"])
def test_an_increment_that_is_infinitely_fast_is_refused_without_a_warning(
    row: str, tmp_path: Path
) -> None:
    path = tmp_path / "odometry.csv"
    path.write_text(f"stamp_s,dx_m,dy_m,dheading_rad\n0,0,0,0\n{row}\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(LogError, match=r"odometry\.csv, line 3: inf"):
            read_log_file(path, "odometry")
