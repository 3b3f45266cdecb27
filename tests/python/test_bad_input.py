# SPDX-License-Identifier: Apache-2.0
"""Bad input: one sentence that names the place and status 1, or a counted verdict.

In either case the belief stays finite, positive definite and, bit for bit, what it was.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import locfuse as lf
from locfuse.config.load import parse_config
from locfuse.io.log_folder import read_log
from locfuse.run.run import run
from locfuse.types import ConfigError, LogError
from support_runs import GOOD, Said, locfuse, rows_of, write_folder

CONFIG = "start: [3, 2, 0]\n"
POSITIONS = "stamp_s,x_m,y_m,sigma_m\n0.1,3,2,0.5\n"
POSES = "stamp_s,x_m,y_m,heading_rad,sigma_xy_m,sigma_heading_rad\n0.1,3,2,0,0.5,0.1\n"
SPEEDS = "stamp_s,v_mps,omega_radps\n0.0,0.2,0\n0.5,0.2,0\n"


def changed(name: str, old: str, new: str) -> dict[str, str | None]:
    """Return a file of the good log, or one of those above, with one text replaced."""
    extra = {"positions.csv": POSITIONS, "poses.csv": POSES}
    text = GOOD[name] if name in GOOD else extra[name]
    assert old in text
    return {name: text.replace(old, new, 1)}


def run_on(tmp_path: Path, files: Mapping[str, str | None], config: str = CONFIG) -> Said:
    tmp_path.mkdir(exist_ok=True)
    (tmp_path / "run.yaml").write_text(config)
    log = write_folder(tmp_path / "log", files)
    return locfuse("run", tmp_path / "run.yaml", "--log", log, "--out", tmp_path / "out")


REFUSED: dict[str, tuple[dict[str, str | None], list[str]]] = {
    # not a number, not finite
    "range nan": (changed("ranges.csv", "5.0,0.1", "nan,0.1"),
                  ["ranges.csv, line 2", "column 4", "nan"]),
    "range infinite": (changed("ranges.csv", "5.0,0.1", "inf,0.1"),
                       ["ranges.csv, line 2", "column 4", "inf"]),
    "range of words": (changed("ranges.csv", "5.0,0.1", "far,0.1"),
                       ["ranges.csv, line 2", "column 4", "far"]),
    "range empty": (changed("ranges.csv", "5.0,0.1", ",0.1"), ["ranges.csv, line 2", "column 4"]),
    "increment nan": (changed("odometry.csv", "0.2,0.02", "0.2,nan"),
                      ["odometry.csv, line 4", "column 2"]),
    "stamp infinite": (changed("odometry.csv", "0.2,", "inf,"),
                       ["odometry.csv, line 4", "column 1"]),
    "stamp beyond 64 bits": (changed("odometry.csv", "0.5,", "1e18,"),
                             ["odometry.csv, line 7", "column 1", "64-bit nanoseconds"]),
    "anchor nan": (changed("anchors.csv", "0,6,1", "0,nan,1"), ["anchors.csv, line 3", "column 3"]),
    "truth nan": (changed("truth.csv", "3.1,2", "nan,2"), ["truth.csv, line 3", "column 2"]),
    "tag nan": ({"log.yaml": "tags: {tag: [0, 0, .nan]}\n"}, ["log.yaml", "tags.tag", "nan"]),
    # sigmas and ranges
    "sigma of a range negative": (changed("ranges.csv", "5.0,0.1", "5.0,-0.1"),
                                  ["ranges.csv, line 2", "sigma_m", "-0.1"]),
    "sigma of a range zero": (changed("ranges.csv", "5.0,0.1", "5.0,0"),
                              ["ranges.csv, line 2", "sigma_m"]),
    "sigma of a position negative": (changed("positions.csv", "0.5", "-0.5"),
                                     ["positions.csv, line 2", "sigma_m", "-0.5"]),
    "sigma of a pose negative": (changed("poses.csv", "0.5,0.1", "0.5,-0.1"),
                                 ["poses.csv, line 2", "sigma_heading_rad", "-0.1"]),
    "sigma of a pose zero": (changed("poses.csv", "0.5,0.1", "0,0.1"),
                             ["poses.csv, line 2", "sigma_xy_m"]),
    "range negative": (changed("ranges.csv", "5.0,0.1", "-5.0,0.1"),
                       ["ranges.csv, line 2", "range", "negative", "-5"]),
    # names
    "anchor listed twice": (changed("anchors.csv", "north", "south"),
                            ["anchors.csv, line 3", "anchor", "twice", "south"]),
    "tag given twice": ({"log.yaml": "tags:\n  tag: [0, 0, 1]\n  tag: [1, 0, 1]\n"},
                        ["log.yaml", "line 3", "'tag'", "twice"]),
    "anchor without a name": (changed("ranges.csv", "tag,south", "tag,"),
                              ["ranges.csv, line 2", "anchor is empty"]),
    # stamps
    "odometry jumps back": (changed("odometry.csv", "0.3,", "0.15,"),
                            ["odometry.csv, line 5", "stamp_s", "0.15", "0.2"]),
    "odometry repeats a stamp": (changed("odometry.csv", "0.3,", "0.2,"),
                                 ["odometry.csv, line 5", "stamp_s"]),
    "truth jumps back": (changed("truth.csv", "0.5,", "-0.5,"),
                         ["truth.csv, line 3", "stamp_s", "-0.5"]),
    "truth repeats a stamp": (changed("truth.csv", "0.5,", "0.0,"), ["truth.csv, line 3"]),
    "arrival before the stamp": (
        {"ranges.csv": "stamp_s,tag,anchor,range_m,arrival_s\n0.2,tag,south,5,0.1\n"},
        ["ranges.csv, line 2", "arrival_s"]),
    # files
    "odometry empty": ({"odometry.csv": ""}, ["odometry.csv", "empty"]),
    "ranges empty": ({"ranges.csv": ""}, ["ranges.csv", "empty"]),
    "odometry without rows": ({"odometry.csv": "stamp_s,dx_m,dy_m,dheading_rad\n"},
                              ["odometry.csv", "no row"]),
    "anchors without rows": ({"anchors.csv": "anchor,x_m,y_m,z_m\n"}, ["anchors.csv", "no row"]),
    "truth empty": ({"truth.csv": ""}, ["truth.csv", "empty"]),
    "nothing to fuse": ({"odometry.csv": None, "ranges.csv": None}, ["no message"]),
    "ranges without anchors": ({"anchors.csv": None}, ["anchors.csv"]),
    "ranges without tags": ({"log.yaml": None}, ["log.yaml", "tags"]),
    # columns
    "column missing": (changed("ranges.csv", "range_m,", ""),
                       ["ranges.csv, line 1", "range_m", "missing"]),
    "column misspelt": (changed("ranges.csv", "range_m", "rnage_m"),
                        ["ranges.csv, line 1", "'rnage_m'", "'range_m'"]),
    "column too many": (changed("anchors.csv", "z_m", "z_m,colour"),
                        ["anchors.csv, line 1", "'colour'"]),
    "column twice": (changed("odometry.csv", "dy_m", "dx_m"),
                     ["odometry.csv, line 1", "'dx_m'", "twice"]),
    "columns of two forms": (changed("odometry.csv", "dheading_rad", "omega_radps"),
                             ["odometry.csv, line 1"]),
    "field missing": (changed("odometry.csv", "0.2,0.02,0,0", "0.2,0.02,0"),
                      ["odometry.csv, line 4", "3 fields, expected 4"]),
    "field too many": (changed("odometry.csv", "0.2,0.02,0,0", "0.2,0.02,0,0,0"),
                       ["odometry.csv, line 4", "5 fields, expected 4"]),
    "semicolons": (changed("truth.csv", "stamp_s,x_m,y_m,heading_rad", "stamp_s;x_m;y_m"),
                   ["truth.csv, line 1"]),
    "unknown file": ({"range.csv": GOOD["ranges.csv"]}, ["range.csv", "'ranges'"]),
    # units
    "increments in millimetres": (
        {"odometry.csv": GOOD["odometry.csv"].replace("0.02", "20")},
        ["odometry.csv, line 3", "200 m/s", "in m"]),
    "turns in degrees": (changed("odometry.csv", "0.2,0.02,0,0", "0.2,0.02,0,15"),
                         ["odometry.csv, line 4", "150 rad/s", "rad"]),
    "speeds in millimetres": ({"odometry.csv": SPEEDS.replace("0.2,0", "200,0")},
                              ["odometry.csv, line 2", "200 m/s"]),
    "turn rates in degrees": ({"odometry.csv": SPEEDS.replace("0.2,0\n", "0.2,-180\n", 1)},
                              ["odometry.csv, line 2", "-180 rad/s"]),
    "stamps in microseconds by ranges of kilometres": (
        changed("ranges.csv", "5.0,0.1", "5000000,0.1"), ["ranges.csv, line 2", "5e+06 m"]),
}  # fmt: skip
REFUSED["ranges in micrometres"] = REFUSED.pop("stamps in microseconds by ranges of kilometres")


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_log_is_refused_in_one_sentence_that_names_the_place(
    tmp_path: Path, case: str
) -> None:
    files, parts = REFUSED[case]

    sentence = run_on(tmp_path, files).sentence()

    for part in parts:
        assert part in sentence
    assert not (tmp_path / "out").exists()
    with pytest.raises(LogError) as caught:
        run(parse_config({"start": [3.0, 2.0, 0.0]}), read_log(tmp_path / "log"))
    assert str(caught.value) == sentence


def test_the_good_log_is_good(tmp_path: Path) -> None:
    assert run_on(tmp_path, {}).status == 0


def test_a_bad_log_leaves_no_traceback_of_the_program(tmp_path: Path) -> None:
    log = write_folder(tmp_path / "log", changed("ranges.csv", "5.0,0.1", "nan,0.1"))
    (tmp_path / "run.yaml").write_text(CONFIG)
    said = subprocess.run(
        [sys.executable, "-m", "locfuse", "run", "run.yaml", "--log", str(log)],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert said.returncode == 1
    assert said.stdout == ""
    assert len(said.stderr.strip().splitlines()) == 1
    assert "Traceback" not in said.stderr
    assert "ranges.csv, line 2" in said.stderr


BAD_CONFIGS: dict[str, tuple[str, list[str]]] = {
    "sigma negative": ("estimator: {range: {sigma_m: -0.1}}", ["estimator.range.sigma_m", "-0.1"]),
    "sigma zero": ("estimator: {range: {sigma_m: 0}}", ["estimator.range", "both 0"]),
    "sigma nan": ("estimator: {range: {sigma_m: .nan}}", ["estimator.range.sigma_m", "nan"]),
    "hold infinite": ("estimator: {hold_s: .inf}", ["estimator.hold_s", "inf"]),
    "start sigma zero": ("start_sigma: {xy_m: 0}", ["start_sigma.xy_m", "0"]),
    "start nan": ("start: [.nan, 0, 0]", ["start", "nan"]),
    "history too long for the clock": ("history_s: 1.0e+12", ["history_s"]),
    "drive of ages": ("simulation: {duration_s: 1.0e+12}",
                      ["simulation.duration_s", "at most 1e+09"]),
    "unknown anchor": ("start: [3, 2, 0]\nanchors: {sotuh: {offset_m: 1}}", ["sotuh", "'south'"]),
    "unknown key": ("startt: truth", ["'startt'", "'start'"]),
    "unknown source": ("use: [lidar]", ["use", "lidar", "ranges"]),
    "anchor given twice": ("anchors: {a: {scale: 1.1}, a: {scale: 1.2}}",
                           ["line 1", "'a'", "twice"]),
    "no anchors": ("simulation: {anchors: {}}", ["simulation", "anchors", "empty"]),
    "poses without noise": ("simulation: {poses: {sigma_xy_m: 0}}",
                            ["simulation.poses.sigma_xy_m is 0", "sigma > 0"]),
    "not valid YAML": ("start: [", ["not valid YAML", "line"]),
    "empty": ("", ["empty"]),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_CONFIGS)
def test_a_bad_config_is_refused_in_one_sentence_that_names_file_and_key(
    tmp_path: Path, case: str
) -> None:
    config, parts = BAD_CONFIGS[case]
    sentence = run_on(tmp_path, {}, config).sentence()
    for part in parts:
        assert part in sentence
    if case != "unknown anchor":  # the log and the config together are wrong, not the file
        assert "run.yaml" in sentence


@pytest.mark.parametrize(
    ("config", "part"),
    [
        ("start_sigma: {xy_m: 1.0e-200}\nsimulation: {duration_s: 1}\n", "covariance"),
        ("estimator: {range: {sigma_m: 1.0e+200}}\nsimulation: {duration_s: 1}\n", "finite"),
        ("start: [1.0e+308, 1.0e+308, 0]\nsimulation: {duration_s: 1}\n", "finite"),
    ],
)
def test_numbers_that_pass_one_by_one_but_cannot_be_computed_with_are_one_sentence(
    tmp_path: Path, config: str, part: str
) -> None:
    (tmp_path / "run.yaml").write_text(config)
    said = locfuse("run", tmp_path / "run.yaml", "--out", tmp_path / "out")
    assert part in said.sentence()


def test_a_start_at_the_truth_of_a_log_without_one_is_refused_with_advice(tmp_path: Path) -> None:
    said = run_on(tmp_path, {"truth.csv": None}, "start: truth\n")
    assert "no truth.csv" in said.sentence()
    assert "start: [x, y, heading_deg]" in said.sentence()


def test_a_log_without_truth_runs_and_says_that_errors_are_unknown(tmp_path: Path) -> None:
    said = run_on(tmp_path, {"truth.csv": None})
    assert said.status == 0
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["position_rmse_m"] is None
    assert metrics["nees_mean"] is None


def test_unknown_anchors_and_tags_are_counted_by_reason(tmp_path: Path) -> None:
    ranges = GOOD["ranges.csv"] + "0.4,tag,ghost,5,0.1\n0.4,other,south,5,0.1\n"
    assert run_on(tmp_path, {"ranges.csv": ranges}).status == 0
    rows = rows_of(tmp_path / "out" / "outcomes.csv")
    reasons = {row["reason"] for row in rows if row["verdict"] == "not_modelled"}
    assert reasons == {"unknown anchor ghost", "unknown tag other"}


@pytest.mark.parametrize("sigma", ["-1", "0"])
def test_a_position_whose_driver_tells_no_sigma_takes_that_of_the_config(
    tmp_path: Path, sigma: str
) -> None:
    files = changed("positions.csv", "0.5", sigma)
    assert run_on(tmp_path / "none", files).status == 0
    (row,) = of_source(tmp_path / "none", "positions")
    assert row["verdict"] == "not_modelled"
    assert row["reason"] == "has no usable sigma; set estimator.position.sigma_m"

    config = f"{CONFIG}estimator: {{position: {{sigma_m: 0.5}}}}\n"
    assert run_on(tmp_path / "own", files, config).status == 0
    assert run_on(tmp_path / "reported", changed("positions.csv", "0.5", "0.5")).status == 0
    assert of_source(tmp_path / "own", "positions") == of_source(tmp_path / "reported", "positions")


def test_a_pose_without_a_heading_is_fused_as_a_position(tmp_path: Path) -> None:
    assert run_on(tmp_path, changed("poses.csv", "0.5,0.1", "0.5,1e3")).status == 0
    (row,) = of_source(tmp_path, "poses")
    assert (row["verdict"], row["dof"]) == ("fused", "2")
    for sigmas in ("-1,-1", "0,0", "1e9,1e300"):
        assert run_on(tmp_path, changed("poses.csv", "0.5,0.1", sigmas)).status == 0
        (row,) = of_source(tmp_path, "poses")
        assert row["verdict"] == "not_modelled"
        assert "set estimator.pose.sigma_m" in row["reason"]


def test_what_is_beyond_the_limits_is_counted_with_its_reason(tmp_path: Path) -> None:
    files = {
        **changed("positions.csv", "3,2,0.5", "3e8,2,0.5"),
        **changed("ranges.csv", "5.0,0.1", "11.0,0.1"),
        **changed("odometry.csv", "0.3,0.02", "0.3,1.5"),
    }
    config = f"{CONFIG}estimator: {{limits: {{speed_mps: 5.0, range_m: 10.0}}}}\n"
    assert run_on(tmp_path, files, config).status == 0
    rows = rows_of(tmp_path / "out" / "outcomes.csv")
    said = {(row["source"], row["reason"]) for row in rows if row["verdict"] == "implausible"}
    assert said == {
        ("odometry", "faster than limits.speed_mps or limits.turn_rate_radps"),
        ("positions", "farther from the origin than limits.distance_m"),
        ("ranges", "longer than limits.range_m"),
    }


def of_source(out: Path, source: str) -> list[dict[str, str]]:
    return [row for row in rows_of(out / "out" / "outcomes.csv") if row["source"] == source]


def test_ranges_in_any_order_and_at_one_stamp_are_fused(tmp_path: Path) -> None:
    lines = GOOD["ranges.csv"].splitlines()
    shuffled = "\n".join([lines[0], *lines[:0:-1]]) + "\n"
    assert run_on(tmp_path, {"ranges.csv": shuffled}).status == 0
    counts = json.loads((tmp_path / "out" / "metrics.json").read_text())["counts"]
    assert counts["ranges"] == {"fused": 6}


def test_a_file_of_ranges_without_rows_is_a_run_without_ranges(tmp_path: Path) -> None:
    assert run_on(tmp_path, {"ranges.csv": "stamp_s,tag,anchor,range_m\n"}).status == 0


def test_the_config_of_a_library_call_is_checked_like_a_file() -> None:
    with pytest.raises(ConfigError, match=r"config: estimator\.hold_s"):
        parse_config({"estimator": {"hold_s": -1.0}})


# The belief -----------------------------------------------------------------------------------

SECOND = 1_000_000_000


def make_ekf(sigma: float = 0.1) -> lf.PoseEkf:
    anchors = lf.AnchorMap([lf.Anchor(0, [0, -2, 1]), lf.Anchor(1, [0, 6, 1])])
    start = lf.PoseEstimate(0, lf.Pose2(3.0, 2.0, 0.0), np.diag([sigma] * 3) ** 2)
    ekf = lf.PoseEkf(lf.PoseEkfConfig(), lf.World(anchors, [lf.Tag(0, [0, 0, 1])]), start)
    ekf.on(lf.Velocity(0, 0.2, 0.1))
    ekf.on(lf.Range(SECOND, tag=0, anchor=0, range=5.1))
    return ekf


def bits(ekf: lf.PoseEkf) -> tuple[int, bytes, bytes]:
    return ekf.belief.stamp, ekf.belief.x.tobytes(), ekf.belief.P.tobytes()


VERDICTS: dict[str, tuple[Callable[[], Any], lf.Verdict]] = {
    "unknown anchor": (lambda: lf.Range(2 * SECOND, 0, 9, 5.0), lf.Verdict.NOT_MODELLED),
    "unknown tag": (lambda: lf.Range(2 * SECOND, 9, 0, 5.0), lf.Verdict.NOT_MODELLED),
    "a fix of another planet": (lambda: lf.PositionFix(2 * SECOND, [1e9, 0], np.eye(2)),
                                lf.Verdict.IMPLAUSIBLE),
    "a counter that wrapped": (lambda: lf.Increment(2 * SECOND, 3 * SECOND, lf.Pose2(429496, 0, 0)),
                               lf.Verdict.IMPLAUSIBLE),
    "a spin": (lambda: lf.Velocity(2 * SECOND, 0.0, 51.0), lf.Verdict.IMPLAUSIBLE),
    "a range of another city": (lambda: lf.Range(2 * SECOND, 0, 0, 10000.5),
                                lf.Verdict.IMPLAUSIBLE),
    "a fix without covariance": (lambda: lf.PositionFix(2 * SECOND, [3, 2], np.zeros((2, 2))),
                                 lf.Verdict.NOT_MODELLED),
    "a pose without covariance": (lambda: lf.PoseObservation(2 * SECOND, lf.Pose2(3, 2, 0),
                                                             -np.eye(3)), lf.Verdict.NOT_MODELLED),
    "wild range": (lambda: lf.Range(2 * SECOND, 0, 0, 500.0), lf.Verdict.GATED),
    "wild position": (lambda: lf.PositionFix(2 * SECOND, [90, 0], 0.01 * np.eye(2)),
                      lf.Verdict.GATED),
    "wild pose": (lambda: lf.PoseObservation(2 * SECOND, lf.Pose2(3, 2, 3.0), 0.01 * np.eye(3)),
                  lf.Verdict.GATED),
    "range of the past": (lambda: lf.Range(SECOND - 1, 0, 0, 5.0), lf.Verdict.STALE),
    "velocity of the past": (lambda: lf.Velocity(SECOND - 1, 0.2, 0.0), lf.Verdict.STALE),
    "motion of the past": (lambda: lf.Increment(0, SECOND - 1, lf.Pose2(1, 0, 0)),
                           lf.Verdict.STALE),
}  # fmt: skip


@pytest.mark.parametrize("case", VERDICTS)
def test_a_message_that_is_not_fused_changes_no_bit(case: str) -> None:
    make, verdict = VERDICTS[case]
    ekf, untouched = make_ekf(), make_ekf()
    before = bits(ekf)

    assert ekf.on(make()).verdict == verdict

    assert bits(ekf) == before
    ekf.on(lf.Range(3 * SECOND, tag=0, anchor=1, range=4.9))
    untouched.on(lf.Range(3 * SECOND, tag=0, anchor=1, range=4.9))
    assert bits(ekf) == bits(untouched), "what is not in the belief was changed"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -1.0])
def test_a_message_that_is_refused_changes_no_bit(value: float) -> None:
    ekf = make_ekf()
    before = bits(ekf)
    bad = -1.0 if value == math.inf else value  # a variance of infinity: not measured
    for make in (
        lambda: ekf.on(lf.Range(2 * SECOND, 0, 0, value)),
        lambda: ekf.on(lf.Range(2 * SECOND, 0, 0, 5.0, value)),
        lambda: ekf.on(lf.PositionFix(2 * SECOND, [3, 2], np.diag([1.0, bad]))),
        lambda: ekf.on(lf.PoseObservation(2 * SECOND, lf.Pose2(), np.diag([1.0, bad, 1.0]))),
        lambda: ekf.on_joint([lf.Range(2 * SECOND, 0, 0, 5.0), lf.Range(3 * SECOND, 0, 1, 5.0)]),
        lambda: ekf.on_joint([]),
        lambda: ekf.on_epoch(SECOND, 2 * SECOND, lf.Pose2(), [0, 1], [5.0, value]),
    ):
        with pytest.raises(ValueError, match=r"expected|symmetric positive definite"):
            make()
    assert bits(ekf) == before


def wild_message(rng: np.random.Generator, stamp: int, decades: float) -> lf.Range | Any:
    """Return a valid message whose numbers lie within so many decades of one."""

    def size() -> float:
        return float(10.0 ** rng.uniform(-decades, decades)) if rng.random() < 0.5 else 1.0

    sign = float(rng.choice([-1.0, 1.0]))
    kind = rng.integers(5)
    if kind == 0:
        return lf.Velocity(stamp, sign * size(), size())
    if kind == 1:
        end = stamp + int(rng.integers(0, SECOND))
        return lf.Increment(stamp, end, lf.Pose2(sign * size(), size(), size()))
    if kind == 2:
        return lf.Range(stamp, 0, int(rng.integers(0, 3)), size(), size())
    if kind == 3:
        return lf.PositionFix(stamp, [sign * size(), size()], np.diag([size(), size()]))
    pose = lf.Pose2(size(), sign * size(), size())
    return lf.PoseObservation(stamp, pose, np.diag([size(), size(), size()]))


def beliefs_after_wild_messages(seed: int, decades: float) -> list[lf.GaussianBelief]:
    """Return the belief after each message that was fused; the others must have changed no bit."""
    rng = np.random.default_rng(seed)
    ekf, stamp, found = make_ekf(), SECOND, []
    for _ in range(200):
        stamp += int(rng.integers(0, SECOND // 2))
        before = bits(ekf)
        try:
            verdict = ekf.on(wild_message(rng, stamp, decades)).verdict
        except (ValueError, lf.NumericalError):  # noise that rounds to zero; numbers that break
            verdict = lf.Verdict.IGNORED
        if verdict == lf.Verdict.FUSED:
            found.append(ekf.belief)
        else:
            assert bits(ekf) == before
    return found


@pytest.mark.parametrize("seed", range(20))
def test_the_belief_stays_positive_definite_over_eight_decades(seed: int) -> None:
    found = beliefs_after_wild_messages(seed, decades=4.0)
    assert len(found) > 30
    for belief in found:
        sigma = np.sqrt(np.diag(belief.P))
        assert np.linalg.eigvalsh(belief.P / np.outer(sigma, sigma)).min() > -1e-12


@pytest.mark.parametrize("decades", [12.0, 20.0, 100.0, 300.0])
def test_the_belief_stays_finite_and_its_variances_positive_whatever_is_said(
    decades: float,
) -> None:
    found = [b for seed in range(40) for b in beliefs_after_wild_messages(seed, decades)]
    assert len(found) > 100
    for belief in found:
        assert np.isfinite(belief.x).all()
        assert np.isfinite(belief.P).all()
        assert (belief.P == belief.P.T).all()
        assert (np.diag(belief.P) > 0.0).all()
        assert -np.pi <= belief.x[2] < np.pi


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"truth.csv": "stamp_s,x_m,y_m,heading_rad\n1000,3,2,0\n1001,3,2,0\n"},
         ["start is 'truth'", "after the last message"]),
        ({"log.yaml": "tags: {mast: [0, 0, 0]}\n"}, ["no range can be used", "mast"]),
        ({"odometry.csv": "stamp_s,v_mps,omega_radps\n1700000000,0.2,0\n1700000001,0.2,0\n"},
         ["odometry begin", "ranges end", "same origin"]),
    ],
)  # fmt: skip
def test_what_would_score_without_being_used_is_refused(
    tmp_path: Path, files: dict[str, str | None], words: list[str]
) -> None:
    said = run_on(tmp_path, files, "start: truth\n")
    assert said.status == 1
    assert all(word in said.err for word in words), said.err


def test_yes_is_no_number(tmp_path: Path) -> None:
    said = run_on(tmp_path, {}, CONFIG + "estimator: {range: {sigma_m: yes}}\n")
    assert said.status == 1
    assert "estimator.range: sigma_m is True" in said.err
