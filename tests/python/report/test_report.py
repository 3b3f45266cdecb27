# SPDX-License-Identifier: Apache-2.0
"""The page about a run: complete, readable without a network, executing nothing but its player."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.report.player import player_script
from locfuse.report.report import write_report
from locfuse.types import Frame, GridMap, RunResult
from support_results import make_result

PNG = b"\x89PNG\r\n\x1a\n"


class _Page(HTMLParser):
    """Collects tags with attributes, table rows by table id, and the text of the page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.text = ""
        self._rows: list[list[str]] = []
        self._open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self._open.append(tag)
        if tag == "table":
            self._rows = self.tables.setdefault(str(dict(attrs)["id"]), [])
        elif tag == "tr":
            self._rows.append([])
        elif tag in ("td", "th"):
            self._rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag, f"</{tag}> closes another tag"

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] in ("td", "th"):
            self._rows[-1][-1] += data
        if not {"style", "script"} & set(self._open):
            self.text += data + " "


def _page(result: RunResult, folder: Path) -> _Page:
    return _Page(write_report(result, folder).read_text(encoding="utf-8"))


def _images(page: _Page) -> list[bytes]:
    sources = [str(attributes["src"]) for tag, attributes in page.tags if tag == "img"]
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    return [base64.b64decode(source.split(",", 1)[1], validate=True) for source in sources]


def test_report_writes_its_files_and_holds_the_same_pictures(tmp_path: Path) -> None:
    folder = tmp_path / "not" / "there" / "yet"
    path = write_report(make_result(every_source=True), folder)

    assert path == folder / "report.html"
    assert {file.name for file in folder.iterdir()} == {
        "report.html",
        "path.png",
        "errors.png",
        "nis.png",
        "outcomes.png",
    }
    images = _images(_Page(path.read_text(encoding="utf-8")))
    assert sorted(images) == sorted(file.read_bytes() for file in folder.glob("*.png"))
    assert all(image.startswith(PNG) for image in images)


def test_report_needs_nothing_from_outside(tmp_path: Path) -> None:
    text = write_report(make_result(), tmp_path).read_text(encoding="utf-8")

    assert "http://" not in text
    assert "https://" not in text
    assert not re.search(r"url\(|@import", text)
    page = _Page(text)
    assert not {"link", "iframe", "object", "a"} & {tag for tag, _ in page.tags}
    for _, attributes in page.tags:
        assert "href" not in attributes
        assert attributes.get("src", "data:") is not None
        assert str(attributes.get("src", "data:")).startswith("data:")
    policy = [a["content"] for t, a in page.tags if t == "meta" and "http-equiv" in a]
    digest = base64.b64encode(hashlib.sha256(player_script().encode()).digest()).decode()
    assert policy == [
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{digest}'"
    ]


def test_report_stays_below_eight_megabytes_whatever_the_log(tmp_path: Path) -> None:
    result = make_result(n=50_000, every_source=True, rejected={"A3": (100.0, 1500.0)})
    stamps = result.estimate.stamp_ns
    rng = np.random.default_rng(1)
    scans = {"stamp_ns": stamps, "ranges_m": rng.uniform(0.5, 9.0, (len(stamps), 360))}
    laser = {"pose_in_body": [0.0, 0.0, 0.0], "angle_min_rad": -3.1, "angle_increment_rad": 0.01,
             "range_min_m": 0.1, "range_max_m": 10.0}  # fmt: skip
    noise = rng.choice(np.array([0, 100], np.int8), (1600, 1600))
    log = replace(result.log, tables={**result.log.tables, "scans": scans}, laser=laser,
                  grid=GridMap(noise, 0.05))  # fmt: skip
    frames = tuple(
        Frame(int(stamp), rng.uniform(-9.0, 9.0, (2000, 4)), np.zeros(3), True)
        for stamp in stamps[:: len(stamps) // 600]
    )
    path = write_report(replace(result, log=log, frames=frames), tmp_path)
    assert 4_000_000 < path.stat().st_size < 8_000_000


def test_wrong_anchor_is_named_with_count_share_and_times(tmp_path: Path) -> None:
    result = make_result(rejected={"A2": (3.0, 12.0), "A1": (0.0, 0.5)})
    table = _page(result, tmp_path).tables["rejected-table"]

    assert table[1:] == [
        ["anchor A2", "90 of 200 (45.0 %)", "3.0 to 11.9 s (90)".replace(" ", "\xa0")],
        ["anchor A1", "5 of 200 (2.5 %)", "0.0 to 0.4 s (5)".replace(" ", "\xa0")],
    ]


def test_many_stretches_of_rejections_are_cut_to_the_longest(tmp_path: Path) -> None:
    result = make_result(n=200, anchors=("A",))
    verdict = np.full(200, "fused", dtype="<U16")
    verdict[::10] = "gated"
    verdict[101:104] = "gated"
    outcomes = replace(result.outcomes, verdict=verdict)
    page = _page(replace(result, outcomes=outcomes), tmp_path)

    times = (
        page.tables["rejected-table"][1][2]
        .replace("\xa0", " ")
        .removesuffix(" and 12 shorter ones")
        .split(", ")
    )
    assert times == [*(f"{k}.0 s (1)" for k in range(7)), "10.0 to 10.3 s (4)"]


def test_no_rejection_is_said_in_a_sentence(tmp_path: Path) -> None:
    page = _page(make_result(), tmp_path)
    assert "rejected-table" not in page.tables
    assert "No message was rejected by the gate." in page.text


def test_counts_and_nis_of_each_source_are_in_the_table(tmp_path: Path) -> None:
    result = make_result(every_source=True, rejected={"A2": (3.0, 12.0)})
    table = _page(result, tmp_path).tables["counts-table"]

    assert table[0] == ["source", "fused", "gated", "total", "mean NIS", "expected NIS"]
    rows = {row[0]: row[1:] for row in table[1:]}
    assert rows["ranges"] == [
        "710",
        "90",
        "800",
        f"{result.metrics['nis_mean']['ranges']:.3g}",
        "1",
    ]
    assert rows["odometry"] == ["200", "0", "200", "-", "-"]
    assert rows["poses"][-1] == "3"
    assert list(rows) == ["odometry", "ranges", "positions", "poses"]


def test_key_figures_are_those_of_the_metrics(tmp_path: Path) -> None:
    result = make_result(rejected={"A2": (3.0, 12.0)})
    metrics = {**result.metrics, "position_rmse_m": 0.1234, "position_max_m": 12.34}
    text = _page(replace(result, metrics=metrics), tmp_path).text

    for figure in ("0.123 m", "12.3 m", "position RMSE", "1.15 deg", "123\u202f456"):
        assert figure in text
    assert "710" in text
    assert "messages fused of 800 (88.8\xa0%)" in text
    assert "no alignment was applied" in text


@pytest.mark.parametrize(
    ("nees", "share", "said"),
    [
        (3.0, 0.95, "consistent"),
        (30.0, 0.1, "over-confident"),
        (7.3, 0.75, "over-confident"),  # the mean alone lies inside the band of a single stamp
        (0.01, 0.02, "too cautious"),
    ],
)
def test_nees_is_judged_by_mean_and_share(
    nees: float, share: float, said: str, tmp_path: Path
) -> None:
    result = make_result()
    metrics = {**result.metrics, "nees_mean": nees, "nees_in_band": share}
    text = _page(replace(result, metrics=metrics), tmp_path).text
    numbers = f"{100 * share:.1f} % of stamps inside their 95 % band 0.22 to 9.3"
    assert f"expected 3; {numbers} {said}" in text.replace("\xa0", " ")


def test_a_share_of_almost_nothing_does_not_break_the_page(tmp_path: Path) -> None:
    result = make_result()
    metrics = {**result.metrics, "counts": {"ranges": {"fused": 1, "gated": 99_999}}}
    assert "(<0.1\xa0%)" in _page(replace(result, metrics=metrics), tmp_path).text


def test_verdicts_of_the_table_are_explained(tmp_path: Path) -> None:
    result = make_result(rejected={"A2": (3.0, 12.0)})
    assert "gated: rejected by the gate." in _page(result, tmp_path).text


def test_without_truth_a_sentence_stands_for_the_errors(tmp_path: Path) -> None:
    (tmp_path / "errors.png").write_bytes(b"of an earlier run")
    page = _page(make_result(with_truth=False), tmp_path)

    assert not (tmp_path / "errors.png").exists()
    assert len(_images(page)) == 3
    assert "no truth, so the errors are unknown" in page.text
    assert "position RMSE" not in page.text
    assert "NEES (" not in page.text
    assert "None" not in page.text


def test_truth_of_another_time_is_said_and_not_drawn(tmp_path: Path) -> None:
    result = make_result()
    assert result.truth is not None
    other = replace(result.truth, stamp_ns=result.truth.stamp_ns + 10**15)
    page = _page(replace(result, truth=other), tmp_path)
    assert "do not overlap in time" in page.text


def test_texts_of_the_user_are_shown_and_not_executed(tmp_path: Path) -> None:
    evil = "</title><script>alert(1)</script><img src=x onerror='alert(2)'>\"&{0}"
    result = make_result(
        anchors=(evil, "A2"),
        rejected={evil: (0.0, 5.0)},
        config={"name": evil, "description": evil, evil: [evil]},
    )
    result = replace(
        result,
        metrics={
            **result.metrics,
            "truth": evil,
            "counts": {evil: {"fused": 3, evil: 1}},
            "nis_mean": {evil: 1.0},
        },
    )
    page = _page(result, tmp_path)

    scripts = [attributes.get("type") for tag, attributes in page.tags if tag == "script"]
    assert scripts == ["application/json", None]  # the player's data and the player
    assert len(_images(page)) == 4
    assert not any("onerror" in attributes for _, attributes in page.tags)
    assert page.text.count("<script>alert(1)</script>") >= 6
    assert page.tables["rejected-table"][1][0] == f"anchor {evil}"


def test_configuration_can_be_read_back(tmp_path: Path) -> None:
    config: dict[str, Any] = {
        "name": "office <1>",
        "estimator": {"gate": 0.99, "tags": {"uwb": np.array([0.1, 0.2, 0.3])}},
        "log": Path("some/folder"),
        "seed": np.int64(3),
        "smooth": False,
        "map": None,
    }
    text = write_report(make_result(config=config), tmp_path).read_text(encoding="utf-8")
    (shown,) = re.findall(r"<pre>(.*?)</pre>", text, flags=re.DOTALL)

    assert yaml.safe_load(unescape(shown)) == {
        "name": "office <1>",
        "estimator": {"gate": 0.99, "tags": {"uwb": [0.1, 0.2, 0.3]}},
        "log": "some/folder",
        "seed": 3,
        "smooth": False,
        "map": None,
    }


def test_description_of_the_log_stands_in_for_that_of_the_configuration(tmp_path: Path) -> None:
    page = _page(make_result(config={"name": "n"}, description="three anchors in a hall"), tmp_path)
    assert "three anchors in a hall" in page.text
    assert "Localization run" not in page.text


@pytest.mark.parametrize("anchors", [(), ("only",), tuple(f"a{k}" for k in range(30))])
def test_any_number_of_anchors_gives_a_report(anchors: tuple[str, ...], tmp_path: Path) -> None:
    page = _page(make_result(n=30, anchors=anchors, every_source=True), tmp_path)
    assert len(_images(page)) == 4
