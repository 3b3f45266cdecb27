# SPDX-License-Identifier: Apache-2.0
"""Published recordings as log folders: counts, units and figures that their notes state."""

from __future__ import annotations

import csv
import gzip
import shutil
from pathlib import Path

import numpy as np
import pytest

from locfuse.config.load import load_config
from locfuse.eval.errors import interpolate
from locfuse.io.datasets import CONVERTERS, convert
from locfuse.io.log_folder import read_log
from locfuse.run import run, truth_of
from locfuse.types import NANOSECONDS, ConfigError, FloatArray, Log, LogError, RunResult
from support_runs import CONFIGS, recording, require_recording_of, rows_of

FOLDERS = {
    "plaza": "plaza",
    "ieu_gazebo": "ieu-gazebo-uwb-lidar",
    "mrpt_office": "mrpt-uwb-lidar",
    "tuc_labyrinth": "tuc-labyrinth",
    "ghent": "ghent-iiot",
    "lias": "lias-planar",
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Log]:
    """Return the logs of all recordings by folder name; Plaza1 and the like by their data set."""
    found: dict[str, Log] = {}
    for name, folder in FOLDERS.items():
        out = tmp_path_factory.mktemp("converted") / name
        found |= {path.name: read_log(path) for path in convert(name, recording(folder), out)}
    return found


def rows_in(log: Log) -> dict[str, int]:
    return {stem: len(next(iter(table.values()))) for stem, table in log.tables.items()}


def range_errors(log: Log) -> dict[str, FloatArray]:
    """Return range minus distance from the true position, by anchor, in metres."""
    truth, table = truth_of(log), log["ranges"]
    assert truth is not None
    places = {str(name): np.array([x, y, z]) for name, x, y, z in zip(
        *(log["anchors"][key] for key in ("anchor", "x_m", "y_m", "z_m")), strict=True
    )}  # fmt: skip
    forward, left, up = next(iter(log.tags.values()))
    errors = {}
    for name, place in places.items():
        rows = table["anchor"] == name
        stamps, first = np.unique(table["stamp_ns"][rows], return_index=True)
        at, inside = interpolate(truth, stamps)
        heading = np.zeros(len(at)) if at.heading is None else at.heading
        c, s = np.cos(heading), np.sin(heading)
        tag = np.column_stack([
            at.position[:, 0] + c * forward - s * left,
            at.position[:, 1] + s * forward + c * left,
            np.full(len(at), up),
        ])  # fmt: skip
        measured = table["range_m"][rows][first][inside]
        errors[name] = measured - np.linalg.norm(tag - place, axis=1)
    return errors


def length_m(log: Log) -> float:
    return float(np.hypot(np.diff(log["truth"]["x_m"]), np.diff(log["truth"]["y_m"])).sum())


def duration_s(log: Log) -> float:
    return float(np.ptp(log["truth"]["stamp_ns"])) / 1e9


def test_plaza_has_the_rows_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    log = logs["plaza"]
    assert rows_in(log) == {"odometry": 9657 + 1, "ranges": 3529, "truth": 9658, "anchors": 4}
    assert duration_s(log) == pytest.approx(1933.0, abs=1.0)
    assert length_m(log) == pytest.approx(1859.0, abs=1.0)
    assert list(log.tags) == ["2"]
    assert log["anchors"]["anchor"].tolist() == ["0", "1", "5", "6"]
    np.testing.assert_allclose(
        np.column_stack([log["anchors"]["x_m"], log["anchors"]["y_m"]]),
        [[-46.623, 11.026], [11.036, -6.959], [-17.665, 59.009], [22.053, 23.848]],
        atol=6e-4,
    )
    errors = range_errors(log)
    medians = {name: float(np.median(values)) for name, values in errors.items()}
    expected = {"0": 2.794, "1": 3.041, "5": 2.748, "6": 2.875}
    assert medians == pytest.approx(expected, abs=0.01)


def test_plaza_begins_and_ends_as_published(logs: dict[str, Log]) -> None:
    log, source = logs["plaza"], recording("plaza")
    driven = rows_of(source / "plaza1_odometry.csv")
    assert log["odometry"]["stamp_ns"][0] == log["truth"]["stamp_ns"][0] == 3_856_857_300_000
    assert [log["odometry"][k][0] for k in ("dx_m", "dy_m", "dheading_rad")] == [0.0, 0.0, 0.0]
    assert log["odometry"]["dheading_rad"][-1] == float(driven[-1]["dheading"])
    chord = np.hypot(log["odometry"]["dx_m"][1:], log["odometry"]["dy_m"][1:])
    length = np.array([abs(float(row["dist"])) for row in driven])
    np.testing.assert_allclose(chord, length, rtol=0.01, atol=1e-6)
    heard = rows_of(source / "plaza1_ranges.csv")
    assert log["ranges"]["range_m"][[0, -1]].tolist() == [
        float(heard[0]["range"]), float(heard[-1]["range"])
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "odometry", "epochs", "scans", "seconds", "metres", "sigma"),
    [
        ("home", 2782, 461, 464, 92.7, 9.55, 0.0074),
        ("run3", 990, 164, 165, 33.0, 5.01, 0.0070),
        ("straight", 647, 107, 107, 21.5, 2.97, 0.0078),
        ("static", 187, 31, 31, 11.8, 0.0, 0.0071),
    ],
)
def test_ieu_gazebo_has_the_rows_and_figures_of_its_notes(
    logs: dict[str, Log], name: str, odometry: int, epochs: int, scans: int, seconds: float,
    metres: float, sigma: float,
) -> None:  # fmt: skip
    log = logs[name]
    assert rows_in(log) == {"odometry": odometry, "ranges": 4 * epochs, "scans": scans,
                            "truth": odometry, "anchors": 4}  # fmt: skip
    assert duration_s(log) == pytest.approx(seconds, abs=0.1)
    assert length_m(log) == pytest.approx(metres, abs=0.01)
    assert log["scans"]["ranges_m"].shape[1] == 360
    assert (log.map is None) == (name == "home")
    errors, table = range_errors(log), log["ranges"]
    relative = np.concatenate([
        values / table["range_m"][table["anchor"] == anchor][-len(values):]
        for anchor, values in errors.items()
    ])  # fmt: skip
    assert float(relative.std()) == pytest.approx(sigma, abs=4e-4)
    heading = log["truth"]["heading_rad"]
    assert (-np.pi <= heading).all()
    assert (heading < np.pi).all()


def test_ieu_gazebo_begins_and_ends_as_published(logs: dict[str, Log]) -> None:
    log, source = logs["run3"], recording("ieu-gazebo-uwb-lidar")
    drive, heard = rows_of(source / "run3_odom.csv"), rows_of(source / "run3_ranges.csv")
    for row in (0, -1):
        assert log["odometry"]["stamp_ns"][row] == round(float(drive[row]["t"]) * 1e9)
        assert log["odometry"]["v_mps"][row] == float(drive[row]["v"])
        assert log["odometry"]["omega_radps"][row] == float(drive[row]["w"])
        assert log["truth"]["x_m"][row] == float(drive[row]["x"])
    assert log["ranges"]["anchor"][:4].tolist() == ["26955", "26952", "26959", "26954"]
    assert log["ranges"]["range_m"][:4].tolist() == [float(heard[0][f"r{i}"]) for i in range(4)]
    assert log["ranges"]["range_m"][-4:].tolist() == [float(heard[-1][f"r{i}"]) for i in range(4)]


def test_mrpt_office_has_the_rows_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    log = logs["mrpt_office"]
    assert rows_in(log) == {"odometry": 200, "ranges": 594, "scans": 200, "truth": 199,
                            "anchors": 3}  # fmt: skip
    assert log["scans"]["ranges_m"].shape[1] == 361
    assert duration_s(log) == pytest.approx(211.0, abs=1.0)
    assert length_m(log) == pytest.approx(60.0, abs=1.0)
    assert log.tags == {"antenna": (0.16, 0.0, 1.12)}
    np.testing.assert_allclose(
        np.column_stack([log["anchors"][key] for key in ("x_m", "y_m", "z_m")]),
        [[-1.79, -4.55, 1.94], [4.71, -4.33, 1.04], [4.7023, 0.3185, 1.33]],
    )
    errors = range_errors(log)
    medians = {name: float(np.median(values)) for name, values in errors.items()}
    assert medians == pytest.approx({"1": 0.075, "2": -0.042, "3": -0.018}, abs=0.002)
    assert float(np.abs(errors["1"]).max()) == pytest.approx(13.18, abs=0.01)
    assert float(np.abs(errors["2"]).max()) == pytest.approx(0.21, abs=0.01)


def test_mrpt_office_odometry_begins_at_the_first_frame(logs: dict[str, Log]) -> None:
    table = logs["mrpt_office"]["odometry"]
    assert table["stamp_ns"][:2].tolist() == [0, 110_200_000]
    assert [table[key][0] for key in ("dx_m", "dy_m", "dheading_rad")] == [0.0, 0.0, 0.0]
    last = rows_of(recording("mrpt-uwb-lidar") / "odometry.csv")[-1]
    assert table["dx_m"][-1] == float(last["dx"])
    assert table["dheading_rad"][-1] == float(last["dphi"])


def test_tuc_labyrinth_has_the_rows_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    log = logs["tuc_labyrinth"]
    assert rows_in(log) == {"odometry": 233, "ranges": 233, "truth": 233, "anchors": 4}
    assert duration_s(log) == pytest.approx(29.8, abs=0.1)
    assert length_m(log) == pytest.approx(9.2, abs=0.3)
    errors = range_errors(log)
    assert {name: len(values) for name, values in errors.items()} == {
        "105": 58, "107": 59, "108": 58, "109": 58
    }  # fmt: skip
    medians = {name: float(np.median(values)) for name, values in errors.items()}
    assert medians == pytest.approx(
        {"105": 0.149, "107": 0.069, "108": 0.107, "109": 0.082}, abs=0.001
    )
    assert "heading_rad" not in log["truth"]
    first = log["truth"]
    assert (first["x_m"][0], first["y_m"][0]) == (1.65205, 2.21918)


def test_tuc_labyrinth_wheels_turn_as_the_truth_does(logs: dict[str, Log]) -> None:
    log = logs["tuc_labyrinth"]
    wheels = rows_of(recording("tuc-labyrinth") / "wheel_odometry.csv")
    left, right = (np.array([float(row[k]) for row in wheels]) for k in ("v_first", "v_second"))
    np.testing.assert_allclose(log["odometry"]["v_mps"], (left + right) / 2.0, atol=1e-15)
    np.testing.assert_allclose(log["odometry"]["omega_radps"], (right - left) / 0.157, atol=1e-12)


def errors_at_rest(log: Log) -> FloatArray:
    """Return range minus distance of every range of a log whose robot stands, in metres."""
    table, at = log["ranges"], log["truth"]
    heading = at["heading_rad"][0] if "heading_rad" in at else 0.0
    c, s = np.cos(heading), np.sin(heading)
    places = {str(name): np.array([x, y, z]) for name, x, y, z in zip(
        *(log["anchors"][key] for key in ("anchor", "x_m", "y_m", "z_m")), strict=True
    )}  # fmt: skip
    tags = {
        name: np.array([at["x_m"][0] + c * x - s * y, at["y_m"][0] + s * x + c * y, z])
        for name, (x, y, z) in log.tags.items()
    }
    distance = [
        np.linalg.norm(places[anchor] - tags[tag])
        for anchor, tag in zip(table["anchor"].tolist(), table["tag"].tolist(), strict=True)
    ]
    return np.asarray(table["range_m"] - np.array(distance), dtype=np.float64)


def test_ghent_has_the_ranges_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    errors: dict[str, list[float]] = {"LOS": [], "NLOS": []}
    with gzip.open(recording("ghent-iiot") / "ranges.csv.gz", "rt") as file:
        published = list(csv.DictReader(file))
    sites = [name for name in logs if name.startswith("site_")]
    assert sites == [f"site_{n}" for n in (0, 2, 4, 6, 8, 10, 12)]
    for name in sites:
        table, error = logs[name]["ranges"], errors_at_rest(logs[name])
        mine = [row for row in published if f"site_{row['tag_site']}" == name]
        assert len(error) == len(mine)
        for anchor in np.unique(table["anchor"]):
            rows = table["anchor"] == anchor
            assert (table["stamp_ns"][rows] == NANOSECONDS * np.arange(rows.sum())).all()
            theirs = [row for row in mine if row["anchor"] == anchor]
            assert [float(row["range"]) for row in theirs] == table["range_m"][rows].tolist()
            for row, e in zip(theirs, error[rows].tolist(), strict=True):
                errors[row["condition"]].append(e)
    assert (len(errors["LOS"]), len(errors["NLOS"])) == (2442, 5913)
    los, nlos = np.array(errors["LOS"]), np.array(errors["NLOS"])
    assert [np.median(los), los.std(), np.abs(los).max()] == pytest.approx(
        [-0.068, 0.124, 0.44], abs=0.005
    )
    assert [np.median(nlos), nlos.std(), np.abs(nlos).max()] == pytest.approx(
        [0.086, 0.363, 5.04], abs=0.005
    )


def test_ghent_sites_are_where_and_how_high_they_were(logs: dict[str, Log]) -> None:
    log = logs["site_4"]
    assert log.tags == {"tag": (0.0, 0.0, 1.501)}
    assert np.unique(log["truth"]["x_m"]).tolist() == [9.994]
    assert np.unique(log["truth"]["y_m"]).tolist() == [6.148]
    np.testing.assert_array_equal(log["truth"]["stamp_ns"], np.unique(log["ranges"]["stamp_ns"]))
    assert len(log["anchors"]["anchor"]) == 19


@pytest.mark.parametrize(
    ("session", "poses", "ranges", "median", "std", "largest"),
    [("814", 18, 233913, 0.181, 0.105, 3.13), ("820", 6, 91962, 0.094, 0.101, 2.27)],
)
def test_lias_has_the_ranges_and_figures_of_its_notes(
    logs: dict[str, Log], session: str, poses: int, ranges: int, median: float, std: float,
    largest: float,
) -> None:  # fmt: skip
    of_session = [log for name, log in logs.items() if name.startswith(f"{session}_p")]
    errors = np.concatenate([errors_at_rest(log) for log in of_session])
    assert (len(of_session), len(errors)) == (poses, ranges)
    assert [np.median(errors), errors.std(), np.abs(errors).max()] == pytest.approx(
        [median, std, largest], abs=0.005
    )


def test_lias_poses_have_the_tags_and_anchors_of_their_session(logs: dict[str, Log]) -> None:
    log = logs["820_p1_300"]
    assert log.tags == {
        "0": (-0.113, -0.2432, 0.9733), "1": (-0.1316, 0.2363, 0.972), "2": (0.3492, 0.2542, 0.97)
    }  # fmt: skip
    assert log["anchors"]["x_m"].tolist()[:2] == [0.9998, -0.0878]
    assert log["truth"]["heading_rad"][0] == pytest.approx(np.deg2rad(299.781 - 360.0))
    first = log["ranges"]["stamp_ns"] == 0
    assert log["ranges"]["tag"][first].tolist() == [tag for tag in "012" for _ in range(8)]
    assert log["ranges"]["anchor"][first].tolist() == list("01234567") * 3


# How well they are localized ------------------------------------------------------------------


def run_of(name: str, of_dataset: str | None = None) -> RunResult:
    require_recording_of(name)
    config = load_config(CONFIGS / name)
    if of_dataset is not None:
        assert config.log is not None
        assert not isinstance(config.log, str)
        log = config.log.model_copy(update={"run": of_dataset})
        config = config.model_copy(update={"log": log})
    return run(config, base=CONFIGS)


@pytest.mark.parametrize(
    ("name", "of_dataset", "limit_m"),
    [
        ("plaza.yaml", None, 0.40),
        ("tuc_labyrinth.yaml", None, 0.08),
        ("mrpt_office.yaml", None, 0.15),
        ("ieu_gazebo.yaml", "run3", 0.010),
        ("ieu_gazebo.yaml", "straight", 0.010),
        ("ieu_gazebo.yaml", "home", 0.010),
    ],
)
def test_a_recorded_drive_is_localized_within_its_limit(
    name: str, of_dataset: str | None, limit_m: float
) -> None:
    metrics = run_of(name, of_dataset).metrics
    assert metrics["position_rmse_m"] <= limit_m
    compared, total = [int(word) for word in metrics["truth"].split() if word.isdigit()][:2]
    assert compared >= 0.95 * total


@pytest.mark.parametrize(
    ("name", "change", "limit_m"),
    [
        ("plaza.yaml", {"anchors": {}}, 0.40),
        ("tuc_labyrinth.yaml", {"anchors": {}}, 0.08),
        ("mrpt_office.yaml", {"estimator": {"gate_range": 1.0}}, 0.15),
    ],
    ids=["plaza without the stated scale", "labyrinth without the stated offset",
         "office without gates"],
)  # fmt: skip
def test_without_what_is_stated_of_it_the_limit_is_broken(
    name: str, change: dict[str, dict[str, float]], limit_m: float
) -> None:
    require_recording_of(name)
    config = load_config(CONFIGS / name)
    if "anchors" in change:
        config = config.model_copy(update={"anchors": {}})
    else:
        estimator = config.estimator.model_copy(update=change["estimator"])
        config = config.model_copy(update={"estimator": estimator})
    assert run(config, base=CONFIGS).metrics["position_rmse_m"] > limit_m


def test_in_the_office_beacon_1_is_rejected_where_it_is_wrong_and_hardly_any_other() -> None:
    result = run_of("mrpt_office.yaml")

    rejected = result.metrics["rejected"]
    assert 0.3 < rejected["1"]["share"] < 0.45
    assert rejected["2"]["count"] == 0
    assert rejected["3"]["share"] < 0.02

    truth, o = result.truth, result.outcomes
    assert truth is not None
    assert truth.heading is not None
    places = dict(zip(result.log["anchors"]["anchor"].tolist(), np.column_stack(
        [result.log["anchors"][key] for key in ("x_m", "y_m", "z_m")]), strict=True))  # fmt: skip
    table = result.log["ranges"]
    wrong: list[str] = []
    right: list[str] = []
    for stamp, anchor, range_m in zip(
        table["stamp_ns"], table["anchor"], table["range_m"], strict=True
    ):
        row = int(np.searchsorted(truth.stamp_ns, stamp))
        if row == len(truth) or truth.stamp_ns[row] != stamp:
            continue
        c, s = np.cos(truth.heading[row]), np.sin(truth.heading[row])
        tag = np.array([*(truth.position[row] + 0.16 * np.array([c, s])), 1.12])
        error = abs(range_m - float(np.linalg.norm(tag - places[str(anchor)])))
        is_row = (o.source == "ranges") & (o.stamp_ns == stamp) & (o.anchor == anchor)
        verdict = str(o.verdict[is_row][0])
        (wrong if error > 1.5 else right if error < 0.3 else []).append(verdict)
    assert len(wrong) > 90
    assert len(right) > 800
    assert wrong.count("gated") == len(wrong)
    assert right.count("gated") < 0.01 * len(right)


# What is refused ------------------------------------------------------------------------------


def test_an_unknown_recording_is_refused_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="'plazza'; did you mean 'plaza'"):
        convert("plazza", tmp_path, tmp_path / "out")


@pytest.mark.parametrize("name", CONVERTERS)
def test_a_folder_that_is_not_the_recording_is_named(name: str, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    for source in (empty, tmp_path / "absent"):
        with pytest.raises(LogError) as caught:
            convert(name, source, tmp_path / "out")
        assert str(source) in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_damaged_file_is_named_by_line_and_nothing_is_written(tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(recording("tuc-labyrinth"), source, copy_function=shutil.copyfile)
    source.chmod(0o755)
    lines = (source / "ranges.csv").read_text().splitlines()
    lines[4] = lines[4].replace(",", ";", 1)
    (source / "ranges.csv").write_text("\n".join(lines))
    with pytest.raises(LogError, match=r"ranges\.csv, line 5: 4 fields, expected 5"):
        convert("tuc_labyrinth", source, tmp_path / "out")
    (source / "ranges.csv").write_text("time,range\n1,2\n")
    with pytest.raises(LogError, match=r"expected the header t,anchor,range"):
        convert("tuc_labyrinth", source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_converting_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    source = recording("tuc-labyrinth")
    (folder,) = convert("tuc-labyrinth", source, tmp_path / "out")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    convert("tuc_labyrinth", source, tmp_path / "out")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
