# SPDX-License-Identifier: Apache-2.0
"""Data of the player: the numbers of the run, decimated to its maximum of bytes."""

from __future__ import annotations

import base64
import io
import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from locfuse.config.load import parse_config
from locfuse.eval.consistency import band
from locfuse.eval.errors import errors_against
from locfuse.report.html_page import page
from locfuse.report.player import pack, player_css, player_html, player_js, player_script
from locfuse.report.player.messages import seen_of
from locfuse.report.plot import style
from locfuse.report.plot.health import STATE_COLORS
from locfuse.run.health import STATES
from locfuse.run.run import run
from locfuse.types import FREE, NANOSECONDS, OCCUPIED, UNKNOWN, Frame, GridMap, Health, RunResult
from support_results import EPOCH_NS, make_result

TYPES = {"f64": "<f8", "f32": "<f4", "u32": "<u4", "u16": "<u2", "u8": "u1"}


def array(packed: dict[str, Any]) -> NDArray[Any]:
    """Return an array that was packed."""
    (name,) = set(packed) & set(TYPES)
    values = np.frombuffer(base64.b64decode(packed[name]), TYPES[name])
    return values.reshape(packed["shape"])


def with_scans(result: RunResult, n: int, beams: int) -> RunResult:
    """Return a run with a laser; beam k of scan i sees k cm and i mm, the first beam nothing."""
    ranges = 0.01 * np.arange(beams) + 0.001 * (np.arange(n) % 5)[:, None]
    ranges[:, 0] = np.nan
    stamps = EPOCH_NS + np.arange(n) * (NANOSECONDS // 40)
    laser = {"pose_in_body": [0.1, 0.0, 0.0], "angle_min_rad": -1.0, "angle_increment_rad": 0.01,
             "range_min_m": 0.0, "range_max_m": 100.0}  # fmt: skip
    tables = {**result.log.tables, "scans": {"stamp_ns": stamps, "ranges_m": ranges}}
    return replace(result, log=replace(result.log, tables=tables, laser=laser))


def clouds(n: int, size: int) -> list[Frame]:
    rng = np.random.default_rng(5)
    return [
        Frame(EPOCH_NS + k * (NANOSECONDS // 10), rng.uniform(-9.0, 7.0, (size, 4)), np.zeros(3),
              k > 3)
        for k in range(n)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def room() -> RunResult:
    config = {
        "simulation": {
            "duration_s": 20,
            "faults": [{"kind": "nlos", "walls": [[2, 0.5, 2, 4]], "extra_m": 2.0}],
            "positions": {},
        },
        "estimator": {"range": {"latency_s": 0.05}},
    }
    return run(parse_config(config), seed=2)


def test_tracks_and_errors_are_those_of_the_run(room: RunResult) -> None:
    packed = pack(room)
    estimate, errors = room.estimate, errors_against(room.estimate, room.truth)  # type: ignore[arg-type]
    origin = int(packed["start_ns"])
    assert np.array_equal(array(packed["estimate"]["t"]), (estimate.stamp_ns - origin) / 1e9)
    assert np.array_equal(array(packed["estimate"]["x"]), estimate.position[:, 0])
    assert np.array_equal(array(packed["estimate"]["y"]), estimate.position[:, 1])
    assert estimate.heading is not None
    assert estimate.covariance is not None
    assert np.array_equal(array(packed["estimate"]["heading"]), estimate.heading.astype("f4"))
    P = estimate.covariance.astype("f4")
    terms = np.column_stack([P[:, 0, 0], P[:, 0, 1], P[:, 1, 1]])
    assert np.array_equal(array(packed["estimate"]["covariance"]), terms)
    assert room.truth is not None
    assert np.array_equal(array(packed["truth"]["x"]), room.truth.position[:, 0])
    assert errors.heading is not None
    error = np.column_stack([errors.position, errors.heading]).astype("f4")
    assert np.array_equal(array(packed["errors"]["error"]), error)
    assert packed["metrics"]["position_rmse_m"] == room.metrics["position_rmse_m"]
    assert packed["end"] == pytest.approx(20.0, abs=0.1)


def test_a_flight_has_its_height_and_that_of_the_truth() -> None:
    flight = {"path": {"shape": "circle", "radius_m": 2}, "duration_s": 3, "flight": {}}
    result = run(parse_config({"simulation": flight, "estimator": {"kind": "air"}}), seed=1)
    packed, estimate, truth = pack(result), result.estimate, result.truth
    assert estimate.height is not None
    assert estimate.height_variance is not None
    assert truth is not None
    assert truth.height is not None
    sigma = np.sqrt(estimate.height_variance).astype("f4")
    assert np.array_equal(array(packed["estimate"]["height"]), estimate.height.astype("f4"))
    assert np.array_equal(array(packed["estimate"]["sigma_height"]), sigma)
    assert np.array_equal(array(packed["truth"]["height"]), truth.height.astype("f4"))


def test_messages_are_those_of_the_run_with_reasons_in_words(room: RunResult) -> None:
    packed, outcomes = pack(room), room.outcomes
    shown = ~((outcomes.source == "odometry") & (outcomes.verdict == "fused"))
    rows = np.flatnonzero(shown)[np.argsort(outcomes.stamp_ns[shown], kind="stable")]
    messages = {key: array(value) for key, value in packed["messages"].items() if key != "of"}
    assert packed["messages"]["of"] == len(rows)
    assert [packed["sources"][k] for k in messages["source"]] == outcomes.source[rows].tolist()
    assert [packed["names"][k] for k in messages["who"]] == outcomes.anchor[rows].tolist()
    verdicts = [packed["verdicts"][k][0] for k in messages["verdict"]]
    assert verdicts == outcomes.verdict[rows].tolist()
    assert np.array_equal(messages["nis"], outcomes.nis[rows].astype("f4"), equal_nan=True)
    gated = np.flatnonzero(outcomes.verdict[rows] == "gated")
    assert len(gated) > 3
    for k in gated.tolist():
        words = packed["reasons"][messages["reason"][k]]
        text = words.replace("{nis}", f"{messages['nis'][k]:.4g}")
        written = re.sub(r"^nis (\S+) > (\S+)$", r"NIS \1 above the gate of \2",
                         str(outcomes.reason[rows[k]]))  # fmt: skip
        assert text == written
    assert packed["bands"]["1"] == band(1)


def test_what_a_message_saw_is_found_in_the_log_though_it_came_late(room: RunResult) -> None:
    seen, outcomes, log = seen_of(room), room.outcomes, room.log
    ranges = log["ranges"]
    place = {
        (anchor, stamp): value
        for anchor, stamp, value in zip(ranges["anchor"].tolist(), ranges["stamp_ns"].tolist(),
                                        ranges["range_m"].tolist(), strict=True)
    }  # fmt: skip
    rows = np.flatnonzero(outcomes.source == "ranges").tolist()
    assert len(rows) == len(place) > 100
    for row in rows:  # at stamps that a delay of 0.05 s moved
        stamp = int(outcomes.stamp_ns[row]) + NANOSECONDS // 20
        assert seen[row, 0] == place[str(outcomes.anchor[row]), stamp]
    fixes = np.flatnonzero(outcomes.source == "positions")
    assert np.array_equal(seen[fixes, 0], log["positions"]["x_m"])
    assert np.isnan(seen[outcomes.source == "odometry"]).all()


def test_a_log_without_its_messages_says_nothing_of_what_they_saw() -> None:
    assert np.isnan(seen_of(make_result())).all()


@pytest.mark.parametrize("max_bytes", [40_000, 150_000, 1_000_000, 4_000_000])
def test_any_run_stays_within_its_bytes(max_bytes: int) -> None:
    result = make_result(n=20_000, every_source=True, rejected={"A2": (100.0, 300.0)})
    result = with_scans(result, 4000, 400)
    packed = pack(result, particles=clouds(300, 2000), max_bytes=max_bytes)
    size = len(json.dumps(packed))
    assert 0.8 * max_bytes < size <= max_bytes


def test_a_short_run_is_not_decimated() -> None:
    result = with_scans(make_result(), 50, 90)
    packed = pack(result, particles=clouds(20, 500))
    for name in ("estimate", "truth", "errors", "messages", "scans", "particles"):
        assert packed[name]["of"] == packed[name]["t"]["shape"][0], name
    assert packed["particles"]["xy"]["shape"] == [20 * 500, 2]


def test_decimation_keeps_the_ends_the_rejected_and_the_largest_error() -> None:
    result = make_result(n=5000, rejected={"A2": (100.0, 130.0)})
    position = result.estimate.position.copy()
    position[3217] += 5.0
    result = replace(result, estimate=replace(result.estimate, position=position))
    packed = pack(result, max_bytes=150_000)
    end = 499.9
    for name in ("estimate", "truth", "errors", "messages"):
        t = array(packed[name]["t"])
        assert len(t) < packed[name]["of"]
        assert (t[0], t[-1]) == (0.0, pytest.approx(end))
        assert np.all(np.diff(t) >= 0.0)
    gated = [name for name, _ in packed["verdicts"]].index("gated")
    assert np.sum(array(packed["messages"]["verdict"]) == gated) == 300
    assert 321.7 in array(packed["errors"]["t"])


def test_decimated_messages_are_of_every_anchor() -> None:
    packed = pack(make_result(n=5000), max_bytes=100_000)
    counts = np.bincount(array(packed["messages"]["who"]))
    assert len(counts) == 4
    assert counts.min() > 0.9 * counts.max()


def test_more_rejected_ones_than_there_is_room_for_are_decimated_themselves() -> None:
    result = make_result(n=20_000, rejected=dict.fromkeys(("A1", "A2", "A3"), (0.0, 2000.0)))
    packed = pack(result, max_bytes=60_000)
    t = array(packed["messages"]["t"])
    assert (t[0], t[-1]) == (0.0, pytest.approx(1999.9))
    assert len(json.dumps(packed)) <= 60_000


def test_scans_are_whole_centimetres_and_coarser_before_they_are_fewer() -> None:
    packed = pack(with_scans(make_result(), 100, 200))["scans"]
    ranges = array(packed["ranges_cm"])
    assert ranges.shape == (100, 200)
    assert ranges[0].tolist() == list(range(200))  # nothing came back to beam 0
    thin = pack(with_scans(make_result(n=20), 400, 400), max_bytes=200_000)["scans"]
    assert thin["ranges_cm"]["shape"][0] == 400
    assert 90 <= thin["ranges_cm"]["shape"][1] < 400
    step = round(thin["lasers"][0]["angle_increment"] / 0.01)
    assert array(thin["ranges_cm"])[0].tolist() == list(range(0, 400, step))


def test_scans_that_differ_are_shown_as_the_widest_counts() -> None:
    result = with_scans(make_result(), 3, 200)
    scans = dict(result.log["scans"])
    scans["beams"] = np.array([200.0, 100.0, 200.0])
    scans["angle_min_rad"] = np.array([-1.0, -1.0, -0.99])
    scans["angle_increment_rad"] = np.array([0.01, 0.02, 0.01])
    log = replace(result.log, tables={**result.log.tables, "scans": scans})
    ranges = array(pack(replace(result, log=log))["scans"]["ranges_cm"])
    assert ranges.shape == (3, 200)
    assert ranges[0].tolist() == list(range(200))
    assert ranges[1, ::2].tolist() == list(range(100))  # at twice the angle between beams
    assert ranges[2].tolist() == [0, 0, *range(1, 199)]  # one beam later


def test_particles_are_where_they_were_to_a_millimetre() -> None:
    frames = clouds(12, 700)
    packed = pack(make_result(), particles=frames)["particles"]
    first, xy = array(packed["first"]), array(packed["xy"])
    at = packed["low"] + xy * np.array(packed["scale"])
    for k, frame in enumerate(frames):
        assert at[first[k] : first[k + 1]] == pytest.approx(frame.particles[:, :2], abs=1e-3)
    assert array(packed["ready"]).tolist() == [int(frame.ready) for frame in frames]


def test_health_keeps_each_change_of_state() -> None:
    n = 40_000
    state = np.full(n, "ok", dtype=STATES.dtype)
    state[10_001:10_004] = "lost"
    health = Health(
        stamp_ns=EPOCH_NS + np.arange(n) * (NANOSECONDS // 10),
        state=state,
        within=np.linspace(1.0, 0.5, n),
        wrong=np.zeros(n),
        protection=np.zeros((n, 3)),
        reason=np.where(state == "lost", "measurements speak against the pose", ""),
    )
    packed = pack(replace(make_result(), health=health), max_bytes=100_000)
    t, states = array(packed["health"]["t"]), array(packed["health"]["state"])
    lost = t[states == packed["health"]["states"].index("lost")]
    assert len(t) < n
    assert lost.tolist() == pytest.approx([1000.1, 1000.3])
    assert [event["text"] for event in packed["events"]] == [
        "lost: measurements speak against the pose",
        "found again",
    ]
    assert [event["t"] for event in packed["events"]] == pytest.approx([1000.1, 1000.4])


def test_the_map_is_what_is_known_of_it_and_where_it_was() -> None:
    cells = np.full((40, 60), UNKNOWN, np.int8)
    cells[10:20, 5:50] = FREE
    cells[12, 7] = OCCUPIED
    grid = GridMap(cells, 0.25, (3.0, -2.0, 0.5))
    result = make_result()
    packed = pack(replace(result, log=replace(result.log, grid=grid)))["map"]
    picture = Image.open(io.BytesIO(base64.b64decode(packed["png"].partition(",")[2])))
    grey = np.asarray(picture)[::-1]
    assert grey.shape == (10, 45) == (packed["height"], packed["width"])
    assert grey[2, 2] == 0
    assert np.sum(grey == 255) == 449
    at = GridMap(np.zeros((1, 1), np.int8), 0.25, tuple(packed["origin"]))
    assert at.to_world(np.zeros(2)) == pytest.approx(grid.to_world(np.array([5.0, 10.0])))


def test_a_large_map_becomes_coarser_until_it_fits() -> None:
    rng = np.random.default_rng(1)
    noise = rng.choice(np.array([FREE, OCCUPIED], np.int8), (1500, 1500))
    result = make_result(n=50)
    packed = pack(replace(result, log=replace(result.log, grid=GridMap(noise, 0.05))),
                  max_bytes=120_000)  # fmt: skip
    assert packed["map"]["resolution_m"] > 0.05
    assert packed["map"]["width"] * packed["map"]["resolution_m"] >= 75.0
    assert len(json.dumps(packed)) <= 120_000


def test_too_few_bytes_are_refused_with_what_it_takes() -> None:
    with pytest.raises(ValueError, match="max_bytes is 900, but the map and the names"):
        pack(make_result(), max_bytes=900)


def test_a_run_without_truth_health_or_messages_is_packed() -> None:
    packed = pack(make_result(with_truth=False, anchors=()))
    assert "truth" not in packed
    assert "health" not in packed
    assert packed["messages"]["of"] == 0
    assert packed["metrics"]["position_rmse_m"] is None


def test_walls_of_a_simulation_and_radii_of_landmarks_are_packed(room: RunResult) -> None:
    assert pack(room)["walls"] == [[2.0, 0.5, 2.0, 4.0]]
    table = {"landmark": np.array(["post"]), "x_m": np.array([1.0]), "y_m": np.array([2.0]),
             "radius_m": np.array([0.3])}  # fmt: skip
    log = replace(room.log, tables={**room.log.tables, "landmarks": table})
    packed = pack(replace(room, log=log))
    assert packed["landmarks"] == {"post": [1.0, 2.0, 0.3]}
    assert packed["anchors"]["A1"][:2] == [0.0, 0.0]


def test_a_run_with_mcl_looks_at_its_particles_on_the_way() -> None:
    config = parse_config({
        "simulation": {"room_m": [12, 8], "map": {"generate": "hallways", "seed": 2},
                       "path": {"shape": "roam", "speed_mps": 0.5}, "duration_s": 6,
                       "laser": {"range_max_m": 5}, "poses": None},
        "start": "truth",
        "mcl": {},
    })  # fmt: skip
    result = run(config, seed=3)
    frames = result.frames
    assert [frame.stamp_ns for frame in frames] == result.estimate.stamp_ns.tolist()
    assert np.array_equal([frame.pose[:2] for frame in frames], result.estimate.position)
    for frame in frames:
        cloud, weight = frame.particles[:, :2], frame.particles[:, 3:]
        spread = np.linalg.norm(np.sum(weight * cloud, axis=0) / np.sum(weight) - frame.pose[:2])
        assert spread < 0.3
    assert pack(result)["particles"]["t"]["shape"] == [len(frames)]


def test_frames_of_a_long_run_are_evenly_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    from locfuse.run import mcl as localization

    counter = iter(range(10_000))
    monkeypatch.setattr(localization, "frame_of", lambda _: next(counter))
    film = localization._Frames(None)  # type: ignore[arg-type]
    scans = 3000
    for _ in range(scans):
        film.look()
    assert 350 <= len(film.frames) <= 700
    assert film._each == 8
    assert len(film.frames) == -(-scans // 8)


def test_no_text_of_a_user_ends_the_element_that_holds_it() -> None:
    evil = "</script><script>alert(1)</script><!--"
    html = player_html([pack(make_result(anchors=(evil,), config={"name": evil}))])
    assert html.count("<script") == html.count("</script>") == 2
    data = re.search(r'class="locfuse-runs">(.*?)</script>', html, re.DOTALL)
    assert data is not None
    assert json.loads(data[1])[0]["name"] == evil


def test_a_page_allows_the_script_of_the_player_by_its_hash() -> None:
    import hashlib

    text = page("t", player_html([pack(make_result())]), player_script())
    script = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script[0].encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in text
    assert "script-src" not in page("t", "b")


def test_colours_are_those_of_the_pictures() -> None:
    light = re.search(r"light: \{(.*?)\n    \},", player_js(), re.DOTALL)
    assert light is not None
    colours = dict(re.findall(r'(\w+): "(#[0-9a-fA-F]{6})"', light[1]))
    names = ("truth", "rejected", "anchor", "wall", "unknown")
    assert [colours[name] for name in names] == [
        style.TRUTH, style.REJECTED, style.ANCHOR, style.MUTED, style.GRID]  # fmt: skip
    assert colours["band"] == style.ESTIMATE_PALE
    assert f'runs: ["{style.ESTIMATE}"' in light[1]
    assert {name: colours[name] for name in STATE_COLORS} == STATE_COLORS
    for colour in (style.ESTIMATE, style.REJECTED, style.ANCHOR):
        assert colour in player_css()
