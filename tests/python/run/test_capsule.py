# SPDX-License-Identifier: Apache-2.0
"""Capsules: they replay bit for bit, say where they do not, and read only what is theirs."""

from __future__ import annotations

import io
import json
import os
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import load_config, parse_config
from locfuse.io.log_folder import write_world
from locfuse.run.capsule import (
    Capsule,
    differences,
    make_capsule,
    read_capsule,
    replay_capsule,
    write_capsule,
)
from locfuse.run.run import load_log, run
from locfuse.types import ConfigError, Log, LogError
from support_runs import CONFIGS, locfuse, room, write_folder

LATE = {
    "simulation": {
        "duration_s": 6,
        "faults": [
            {"kind": "latency", "source": "poses", "delay_s": 0.3, "jitter_s": 0.2},
            {"kind": "outliers", "probability": 0.1, "magnitude_m": 3.0},
        ],
    }
}


@pytest.fixture(scope="module")
def capsule() -> Capsule:
    return make_capsule(parse_config(LATE), seed=5)


@pytest.fixture
def path(capsule: Capsule, tmp_path: Path) -> Path:
    write_capsule(capsule, tmp_path / "run.zip")
    return tmp_path / "run.zip"


def files_of(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(files: dict[str, bytes], path: Path, how: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", how) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


def test_a_capsule_replays_bit_for_bit_after_a_journey(capsule: Capsule, path: Path) -> None:
    arrived = read_capsule(path)
    assert arrived.result == capsule.result
    assert arrived.config == capsule.config
    assert replay_capsule(arrived) == []


def test_its_result_is_that_of_the_run(capsule: Capsule) -> None:
    config = parse_config(LATE)
    result = run(config, seed=5)
    rows = [line.split(",") for line in capsule.result["estimate.csv"].splitlines()[1:]]
    assert [float(row[1]) for row in rows] == result.estimate.position[:, 0].tolist()
    assert capsule.result["outcomes.csv"].count("\n") == len(result.outcomes) + 1


def test_it_does_not_depend_on_the_simulator(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> None:
        raise AssertionError("simulated")

    monkeypatch.setattr("locfuse.run.run.simulate", broken)
    assert read_capsule(path).config.simulation is None
    assert replay_capsule(read_capsule(path)) == []


def test_the_same_run_gives_the_same_bytes(capsule: Capsule, path: Path, tmp_path: Path) -> None:
    write_capsule(make_capsule(parse_config(LATE), seed=5), tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == path.read_bytes()
    write_capsule(make_capsule(parse_config(LATE), seed=6), tmp_path / "other.zip")
    assert (tmp_path / "other.zip").read_bytes() != path.read_bytes()


def test_it_holds_plain_files(path: Path, capsule: Capsule) -> None:
    files = files_of(path)
    assert {"capsule.json", "config.yaml", "estimate.csv", "log/ranges.csv"} <= set(files)
    assert json.loads(files["capsule.json"]) == dict(capsule.about)


def test_a_map_and_scans_travel_along(tmp_path: Path) -> None:
    config = load_config(CONFIGS / "rooms_mcl.yaml")
    assert config.simulation is not None
    short = config.simulation.model_copy(update={"duration_s": 3.0})
    mcl = make_capsule(config.model_copy(update={"simulation": short, "start": "truth"}))
    write_capsule(mcl, tmp_path / "mcl.zip")
    arrived = read_capsule(tmp_path / "mcl.zip")
    assert arrived.log.grid is not None
    assert replay_capsule(arrived) == []


def test_a_map_that_lay_in_a_folder_of_its_own_travels_along(tmp_path: Path) -> None:
    config = room()
    log = load_log(parse_config({"simulation": {"duration_s": 1, "map": {}}}), None, 0)
    write_capsule(make_capsule(config, replace(log, map="maps/floor.yaml")), tmp_path / "c.zip")
    assert read_capsule(tmp_path / "c.zip").log.map == "map.yaml"


def test_a_run_that_fails_is_packed_with_its_error(tmp_path: Path) -> None:
    config = parse_config({"use": ["poses"], "start": [3.0, 2.0, 0.0], "log": "log"})
    write_folder(tmp_path / "log")
    write_capsule(make_capsule(config, base=tmp_path), tmp_path / "failed.zip")
    arrived = read_capsule(tmp_path / "failed.zip")
    assert arrived.result["error.txt"].startswith("LogError: nothing to fuse")
    assert replay_capsule(arrived) == []
    healed = replace(arrived, config=room().model_copy(update={"start": (3.0, 2.0, 0.0)}))
    assert [d.file for d in replay_capsule(healed)] == ["error.txt", "estimate.csv", "outcomes.csv"]


def test_it_says_where_a_result_is_first_another_one(capsule: Capsule) -> None:
    ranges = capsule.log["ranges"]
    distance = ranges["range_m"].copy()
    changed = int(np.flatnonzero(ranges["stamp_ns"] == 3_000_000_000)[0])
    distance[changed] += 1e-9
    tables = {**capsule.log.tables, "ranges": {**ranges, "range_m": distance}}
    first, second = replay_capsule(replace(capsule, log=replace(capsule.log, tables=tables)))
    assert (first.file, second.file) == ("estimate.csv", "outcomes.csv")
    assert first.stamp_s == second.stamp_s == "3.000000000"
    assert first.lines > 1
    assert (
        set(first.was)
        == set(first.found)
        <= set(capsule.result["estimate.csv"].splitlines()[0].split(","))
    )
    assert all(first.was[name] != first.found[name] for name in first.was)


@pytest.mark.parametrize(("was", "found"), [("3", "3,1,2"), ("3,1,2", "3,1")])
def test_a_line_that_is_cut_off_differs_as_a_whole(was: str, found: str) -> None:
    one, other = ({"estimate.csv": f"stamp_s,x_m,y_m\n{line}\n"} for line in (was, found))
    (difference,) = differences(one, other)
    assert difference.line == 2
    assert (difference.was, difference.found) == ({"line": was}, {"line": found})


# A stranger's file -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["../evil.csv", "/tmp/evil.csv", "log/../../evil.csv", "log/evil.csv", "log/", "a\\b"]
)
def test_files_that_no_capsule_has_are_refused(path: Path, tmp_path: Path, name: str) -> None:
    evil = packed({**files_of(path), name: b"x"}, tmp_path / "evil.zip")
    with pytest.raises(LogError, match=r"evil\.zip: no capsule: it holds"):
        read_capsule(evil)
    assert not (tmp_path.parent / "evil.csv").exists()


def test_a_file_that_is_there_twice_is_refused(path: Path) -> None:
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("config.yaml", b"")
    with pytest.raises(LogError, match=r"'config\.yaml' twice"):
        read_capsule(path)


def test_a_bomb_is_not_unpacked(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bomb = packed({**files_of(path), "config.yaml": b" " * (1 << 20)}, tmp_path / "bomb.zip")
    with pytest.raises(LogError, match=r"'config\.yaml' has 1048576 bytes, expected at most"):
        read_capsule(bomb)
    monkeypatch.setattr("locfuse.run.capsule.MAX_UNPACKED", 10_000)
    with pytest.raises(LogError, match="bytes, expected at most"):
        read_capsule(path)


def test_a_size_that_lies_does_not_help(path: Path, tmp_path: Path) -> None:
    data = bytearray(packed({**files_of(path), "error.txt": b"x" * 5000}, path).read_bytes())
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        at = archive.start_dir
    entry = data.index(b"error.txt", at) - 46
    data[entry + 24 : entry + 28] = (7).to_bytes(4, "little")
    (tmp_path / "lies.zip").write_bytes(data)
    with pytest.raises(LogError, match=r"lies\.zip: no capsule, or damaged"):
        read_capsule(tmp_path / "lies.zip")


def test_of_a_name_of_kilobytes_only_a_part_is_shown(path: Path, tmp_path: Path) -> None:
    data = bytearray(packed(files_of(path), path).read_bytes())
    at = data.index(b"PK\x03\x04")
    data[at + 26 : at + 28] = (30_000).to_bytes(2, "little")  # length of the name in its header
    (tmp_path / "long.zip").write_bytes(data + b"\0" * 30_000)
    with pytest.raises(LogError, match=r"long\.zip: no capsule, or damaged") as error:
        read_capsule(tmp_path / "long.zip")
    assert len(str(error.value)) < 500


def test_yaml_that_grows_is_refused(path: Path, tmp_path: Path) -> None:
    rows = [
        "a0: &a0 [x]",
        *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30)),
    ]
    grown = packed({**files_of(path), "log/log.yaml": "\n".join(rows).encode()}, tmp_path / "y.zip")
    with pytest.raises(LogError, match=r"log\.yaml has aliases"):
        read_capsule(grown)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("log/log.yaml", "map: ../../secret.yaml"),
        ("log/map.yaml", "image: ../../secret.pgm\nresolution: 0.1\norigin: [0, 0, 0]"),
    ],
)
def test_a_map_from_elsewhere_is_refused(path: Path, tmp_path: Path, file: str, text: str) -> None:
    evil = packed({**files_of(path), file: text.encode()}, tmp_path / "map.zip")
    with pytest.raises(LogError, match=r"names \w+ '\.\./\.\./secret"):
        read_capsule(evil)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"capsule.json": b"{"}, "no capsule, or damaged"),
        ({"capsule.json": b"[" * 100_000}, "no capsule, or damaged"),
        ({"capsule.json": b'{"format": 2}'}, "says format 2, expected 1"),
        ({"capsule.json": b'{"format": 1}'}, "capsule.json has no version"),
        (
            {"capsule.json": b'{"format": 1, "version": "\\ud800"}'},
            "capsule.json: version has half of a surrogate pair",
        ),
        ({"estimate.csv": b"stamp_s\n"}, "its result is not the one that it was made with"),
        ({"outcomes.csv": b"\xff"}, "no capsule, or damaged"),
        ({"config.yaml": b"mlc: {}"}, "config.yaml: unknown key 'mlc'"),
        ({"config.yaml": b"a: 1\na: 2"}, "config.yaml, line 2: is not valid YAML"),
        ({"config.yaml": b"a: \xe0"}, "no capsule, or damaged (unacceptable character"),
        ({"log/ranges.csv": b"stamp_s,range_m\n"}, "ranges.csv, line 1: column 'tag' is missing"),
        ({"log/log.yaml": b"[" * 100_000}, "log.yaml has aliases or is too deep"),
    ],
)
def test_what_is_wrong_inside_is_said(
    path: Path, tmp_path: Path, change: dict[str, bytes], said: str
) -> None:
    odd = packed({**files_of(path), **change}, tmp_path / "odd.zip")
    with pytest.raises((LogError, ConfigError)) as error:
        read_capsule(odd)
    assert str(error.value).startswith(f"{odd}: ")
    assert said in str(error.value)
    assert "/tmp" not in str(error.value).removeprefix(str(odd))


@pytest.mark.parametrize(
    ("line", "evil"),
    [
        (b"log: log", b"log: /etc"),
        (b"log: log", b"log: ../log"),
        (b"log: log", b"log: {dataset: plaza, path: /etc}"),
        (b"world: null", b"world: ../world"),
        (b"log: log\nsimulation: null", b"log: null\nsimulation: {map: {image: /etc/passwd}}"),
    ],
    ids=["root", "beside", "data set", "world", "simulation"],
)
def test_a_configuration_that_leads_out_of_the_capsule_is_refused(
    path: Path, tmp_path: Path, line: bytes, evil: bytes
) -> None:
    files = files_of(path)
    assert line in files["config.yaml"]
    files["config.yaml"] = files["config.yaml"].replace(line, evil, 1)
    with pytest.raises((LogError, ConfigError), match=r"out\.zip: config.yaml(: | names \{'log')"):
        read_capsule(packed(files, tmp_path / "out.zip"))


def test_a_world_beside_the_configuration_is_in_the_log_of_the_capsule(tmp_path: Path) -> None:
    write_folder(tmp_path / "log")
    anchors = {"anchor": ["A"], "x_m": [9.0], "y_m": [8.0], "z_m": [2.0]}
    write_world(
        Log({"anchors": {name: np.asarray(column) for name, column in anchors.items()}}),
        tmp_path / "world",
    )
    config = parse_config({"log": "log", "start": "truth", "ros": {"world": "world"}})
    write_capsule(make_capsule(config, base=tmp_path), tmp_path / "c.zip")
    capsule = read_capsule(tmp_path / "c.zip")
    assert capsule.config.ros.world is None
    assert list(capsule.log["anchors"]["x_m"]) == [9.0]
    assert replay_capsule(capsule) == []


def test_a_link_is_unpacked_as_the_text_that_it_is(path: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret.csv"
    secret.write_text("stamp_s,x_m,y_m\n0,0,0\n")
    with zipfile.ZipFile(path, "a") as archive:
        info = zipfile.ZipInfo("log/truth.csv")
        if info.filename in archive.namelist():
            info.filename = "log/relations.csv"
        info.create_system, info.external_attr = 3, 0o120777 << 16
        archive.writestr(info, str(secret))
    with pytest.raises(LogError, match=r"line 1: unknown column '/"):
        read_capsule(path)


def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "run.zip")
    with pytest.raises(LogError, match=r"run\.zip: is a device or a pipe; expected a file"):
        read_capsule(tmp_path / "run.zip")


def test_other_ways_of_packing_are_refused(path: Path, tmp_path: Path) -> None:
    with pytest.raises(LogError, match="not packed as"):
        read_capsule(packed(files_of(path), tmp_path / "b.zip", zipfile.ZIP_BZIP2))


def test_truncated_and_damaged_files_are_one_clear_error(path: Path, tmp_path: Path) -> None:
    data, damaged = path.read_bytes(), tmp_path / "damaged.zip"
    rng = np.random.default_rng(7)
    for cut in (0, 1, 100, len(data) // 2, len(data) - 1):
        damaged.write_bytes(data[:cut])
        with pytest.raises(LogError, match=r"damaged\.zip: no capsule, or damaged"):
            read_capsule(damaged)
    with zipfile.ZipFile(path) as archive:
        directory = archive.start_dir
    expected, sentences = read_capsule(path).result, []
    for place in (*rng.integers(0, len(data), 60), *rng.integers(directory, len(data), 150)):
        wrong = bytearray(data)
        wrong[place] ^= int(rng.integers(1, 256))
        damaged.write_bytes(wrong)
        try:  # a date may change without harm
            assert read_capsule(damaged).result == expected
        except (LogError, ConfigError) as error:
            sentences.append(str(error))
    assert len(sentences) > 100
    assert all(sentence.startswith(f"{damaged}: ") for sentence in sentences)


# The command line ------------------------------------------------------------------------------


def test_the_commands_pack_and_replay(tmp_path: Path) -> None:
    config = tmp_path / "run.yaml"
    config.write_text("start: truth\n")
    log, out = write_folder(tmp_path / "log"), tmp_path / "made" / "bug.zip"
    said = locfuse("capsule", config, "--log", log, "--out", out)
    assert said.status == 0
    assert read_capsule(out).about["result"] in said.out
    again = locfuse("replay", out)
    assert again.status == 0
    assert "the same bit for bit: estimate.csv, outcomes.csv" in again.out


def test_the_command_says_what_differs(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsule: Capsule
) -> None:
    other = capsule.config.model_copy(update={"history_s": 0.0})
    changed = replace(capsule, config=other)
    monkeypatch.setattr("locfuse.cli.replay.read_capsule", lambda _: changed)
    said = locfuse("replay", path)
    assert said.status == 1
    assert "outcomes.csv: " in said.out
    assert re.search(
        r"estimate\.csv: \d+ lines differ, the first is line \d+ \(\d+\.\d+ s\)", said.out
    )
    assert re.search(r"^  x_m: was \S+, is \S+$", said.out, re.MULTILINE)


def test_the_command_refuses_in_one_sentence(tmp_path: Path) -> None:
    assert "no such file" in locfuse("replay", tmp_path / "none.zip").sentence()
    (tmp_path / "text.zip").write_text("hello")
    assert "no capsule" in locfuse("replay", tmp_path / "text.zip").sentence()
