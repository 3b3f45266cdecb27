# SPDX-License-Identifier: Apache-2.0
"""The command line: help, version, each command's work, and one sentence for what goes wrong."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import locfuse as package
from locfuse.cli.app import COMMANDS, load
from locfuse.config.load import load_config, parse_config
from locfuse.io.recording import checkout
from support_runs import CONFIGS, EXAMPLES, locfuse, recording, room, rows_of, write_folder

CALLS = (
    ("run",),
    ("check",),
    ("capsule",),
    ("replay",),
    ("convert",),
    ("evaluate",),
    ("position",),
    ("survey",),
    ("reproduce",),
    ("sweep",),
    ("studio",),
    ("config",),
    ("config", "dump"),
    ("config", "schema"),
)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "run.yaml"
    path.write_text("simulation: {duration_s: 3}\n")
    return path


@pytest.mark.parametrize("command", CALLS, ids=" ".join)
def test_every_command_says_what_it_does(command: tuple[str, ...]) -> None:
    said = locfuse(*command, "--help")
    assert said.status == 0
    assert "Usage: locfuse " + " ".join(command) in said.out


def test_all_commands_are_listed() -> None:
    said = locfuse("--help")
    assert said.status == 0
    for command in {command[0] for command in CALLS}:
        assert re.search(rf"^\W*{command}\b", said.out, re.MULTILINE), command


def test_the_version_is_that_of_the_package() -> None:
    said = locfuse("--version")
    assert (said.status, said.out) == (0, f"locfuse {package.__version__}\n")


def test_the_program_and_the_module_are_one() -> None:
    said = subprocess.run(
        [sys.executable, "-m", "locfuse", "--version"], capture_output=True, text=True, check=True
    )
    assert said.stdout == f"locfuse {package.__version__}\n"


def test_run_writes_the_folder_and_says_where(config: Path, tmp_path: Path) -> None:
    said = locfuse("run", config, "--out", tmp_path / "out", "--seed", 3)
    assert said.status == 0
    assert re.search(r"^position_rmse_m +0\.\d+$", said.out, re.MULTILINE)
    assert str(tmp_path / "out" / "report.html") in said.out
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert f"{metrics['position_rmse_m']:.6g}" in said.out


LOST = """
simulation: {duration_s: 30, poses: null, faults: [{kind: kidnap, at_s: 10, to: [8, 2, 90]}]}
"""


def test_run_says_what_health_was_and_fails_where_asked_to(config: Path, tmp_path: Path) -> None:
    said = locfuse("run", config, "--out", tmp_path / "out", "--fail-if-lost")
    assert said.status == 0
    assert re.search(r"^health: ok .* at the end ok$", said.out, re.MULTILINE)
    assert "locfuse check" not in said.out
    config.write_text(LOST)
    for options, status in (((), 0), (("--fail-if-lost",), 3)):
        said = locfuse("run", config, "--out", tmp_path / "out", *options)
        assert said.status == status
        assert re.search(r"^health: .*lost .* of the time; at the end ", said.out, re.MULTILINE)
        assert f"locfuse check {config} looks for what is wrong" in said.out
    assert "lost at times" in (tmp_path / "out" / "report.html").read_text()


def test_a_log_given_by_hand_replaces_that_of_the_config(tmp_path: Path) -> None:
    path = tmp_path / "run.yaml"
    path.write_text("start: truth\n")
    log = write_folder(tmp_path / "log")
    said = locfuse("run", path, "--log", log, "--out", tmp_path / "out")
    assert said.status == 0
    assert len(rows_of(tmp_path / "out" / "outcomes.csv")) == 12


def test_paths_of_a_config_are_relative_to_its_file(tmp_path: Path) -> None:
    (tmp_path / "configs").mkdir()
    path = tmp_path / "configs" / "run.yaml"
    path.write_text("log: ../log\n")
    write_folder(tmp_path / "log")
    assert locfuse("run", path, "--out", tmp_path / "out").status == 0


def test_the_seed_decides(config: Path, tmp_path: Path) -> None:
    written = []
    for seed in (1, 2):
        assert locfuse("run", config, "--out", tmp_path, "--seed", seed).status == 0
        written.append((tmp_path / "estimate.csv").read_bytes())
    assert written[0] != written[1]


def test_a_dumped_config_loads_back_and_gives_the_same_metrics(tmp_path: Path) -> None:
    first = tmp_path / "first.yaml"
    first.write_text(
        "simulation: {duration_s: 4, path: {shape: star}}\nestimator: {range: {gate: 0.99}}\n"
    )
    dumped = locfuse("config", "dump", first)
    assert dumped.status == 0
    second = tmp_path / "second.yaml"
    second.write_text(dumped.out)

    assert load_config(second) == load_config(first)
    found = []
    for name in ("first", "second"):
        assert locfuse("run", tmp_path / f"{name}.yaml", "--out", tmp_path / name).status == 0
        metrics = json.loads((tmp_path / name / "metrics.json").read_text())
        found.append({k: v for k, v in metrics.items() if k != "messages_per_second"})
    assert found[0] == found[1]


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_example_is_dumped_with_every_key(name: str) -> None:
    said = locfuse("config", "dump", CONFIGS / name, "--all")
    assert said.status == 0
    data = yaml.safe_load(said.out)
    assert set(data) == set(room().model_dump())
    assert set(data["estimator"]) == set(room().estimator.model_dump())
    assert parse_config(data) == load_config(CONFIGS / name)


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_an_example_changes_is_that_example(name: str) -> None:
    said = locfuse("config", "dump", CONFIGS / name)
    assert said.status == 0
    data = yaml.safe_load(said.out)
    assert parse_config(data) == load_config(CONFIGS / name)
    for key in set(data) - {"simulation", "mcl", "cylinders"}:  # where a value says it is there
        less = {**data}
        del less[key]
        assert parse_config(less) != load_config(CONFIGS / name), key


def test_the_schema_for_editors_has_every_key_with_its_text() -> None:
    said = locfuse("config", "schema")
    assert said.status == 0
    found = json.loads(said.out)
    assert list(found["properties"]) == list(room().model_dump())
    estimator = found["$defs"]["Estimator"]
    assert estimator["additionalProperties"] is False
    assert list(estimator["properties"]) == list(room().estimator.model_dump())
    assert estimator["properties"]["kind"]["enum"] == [
        "pose",
        "landmark_slam",
        "tag_triangle",
        "air",
    ]
    gate = found["$defs"]["Range"]["properties"]["gate"]
    assert (gate["default"], gate["exclusiveMinimum"], gate["maximum"]) == (0.999, 0.0, 1.0)
    texts = [field["description"] for part in (found, *found["$defs"].values())
             for field in part["properties"].values() if "description" in field]  # fmt: skip
    assert len(texts) > 300
    assert not [text for text in texts if "](" in text or "\n" in text or "`" in text]


def test_convert_says_where_the_logs_are(tmp_path: Path) -> None:
    source = recording("tuc-labyrinth")
    said = locfuse("convert", "tuc-labyrinth", source, tmp_path / "out")
    assert said.status == 0
    assert said.out.strip() == str(tmp_path / "out")
    path = tmp_path / "run.yaml"
    path.write_text("start: [1.652, 2.219, 180]\n")
    said = locfuse("run", path, "--log", tmp_path / "out", "--out", tmp_path / "results")
    assert said.status == 0


def test_reproduce_prints_the_table_and_writes_the_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("papers.ekim2020.claims.power_up_claims", lambda configs: [])
    said = locfuse("reproduce", "ekim2020", "--seeds", 4, "--json", tmp_path / "rows.json")
    rows = json.loads((tmp_path / "rows.json").read_text())
    assert said.status == (1 if any(row["met"] is False for row in rows) else 0)
    assert {"id", "claim", "unit", "paper", "ours_median", "ours_low", "ours_high", "required",
            "met"} <= set(rows[0])  # fmt: skip
    assert "required" in said.out
    for path in ("circle", "eight", "square", "star", "waypoints"):
        assert path in said.out


def test_evaluate_finds_what_metrics_json_says(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert locfuse("run", config, "--out", out).status == 0
    said = locfuse("evaluate", out / "estimate.tum", out / "truth.tum")
    assert said.status == 0
    found = re.search(r"^rmse_m +(\S+)$", said.out, re.MULTILINE)
    assert found is not None
    expected = json.loads((out / "metrics.json").read_text())["position_rmse_m"]
    assert float(found[1]) == pytest.approx(expected, abs=1e-9)
    assert re.search(r"^alignment +none$", said.out, re.MULTILINE)


def test_sweep_writes_table_summary_and_pictures_and_says_where(
    config: Path, tmp_path: Path
) -> None:
    key = "simulation.ranges.rate_hz"
    out = tmp_path / "out"
    said = locfuse("sweep", config, "--trials", 7, "--vary", f"{key}=2,5", "--workers", 1,
                   "--out", out)  # fmt: skip
    assert said.status == 0
    summary = json.loads((out / "summary.json").read_text())
    assert [row["trials"] for row in summary["by_key"][key]] == [4, 3]
    assert re.search(r"^ *position_rmse_m +0\.\d+ \[", said.out, re.MULTILINE)
    assert f"{summary['scores']['position_rmse_m']['mean']:.4g}" in said.out
    assert "failed: 0 of 7, 95 % interval 0 to 41 %" in said.out
    for name in ("error_simulation_ranges_rate_hz.png", "cdf.png", "nees.png", "calibration.png"):
        assert (out / name).read_bytes().startswith(b"\x89PNG")
        assert str(out / name) in said.out
    assert str(out / "trials.parquet") in said.out


# What goes wrong ------------------------------------------------------------------------------


def test_unknown_names_are_answered_with_the_nearest(tmp_path: Path) -> None:
    assert "did you mean 'plaza'?" in locfuse("convert", "plza", tmp_path, tmp_path).sentence()
    assert "did you mean 'ekim2020'?" in locfuse("reproduce", "ekim20").sentence()
    config = tmp_path / "run.yaml"
    config.write_text(f"log: {{dataset: tuc_labyrint, path: {tmp_path}}}\n")
    assert "did you mean 'tuc_labyrinth'?" in locfuse("run", config).sentence()


def test_an_unknown_run_of_a_recording_is_answered_with_the_nearest(tmp_path: Path) -> None:
    source = recording("ieu-gazebo-uwb-lidar")
    config = tmp_path / "run.yaml"
    config.write_text(f"log: {{dataset: ieu_gazebo, path: {source.resolve()}, run: run33}}\n")
    assert "no run 'run33'; did you mean 'run3'?" in locfuse("run", config).sentence()


def test_results_that_cannot_be_written_are_one_sentence_with_the_place(
    config: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        assert str(tmp_path / "file") in locfuse("run", config, "--out", out).sentence()
    if os.geteuid() != 0:  # root may write anywhere
        (tmp_path / "closed").mkdir(mode=0o555)
        said = locfuse("run", config, "--out", tmp_path / "closed" / "out")
        assert "closed" in said.sentence()
    assert "/proc" in locfuse("run", config, "--out", "/proc/nowhere").sentence()


def test_rows_that_cannot_be_written_are_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "no").write_text("")
    said = locfuse("reproduce", "ekim2020", "--seeds", 2, "--json", tmp_path / "no" / "rows.json")
    assert said.sentence().endswith("no is not a folder")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--vary", "history_s"], "--vary history_s: expected KEY=LOW..HIGH or KEY=a,b,c"),
        (["--vary", "history_s=1", "--vary", "history_s=2"], "history_s is given twice"),
        (["--vary", "histry_s=1"], "did you mean 'history_s'?"),
        (["--vary", "history_s=-1"], "history_s: expected at least 0"),
        (["--workers", "1", "--dask", "tcp://127.0.0.1:8786"], "give one"),
        (["--recovered-m", "-1"], "recovered_m is -1"),
    ],
)
def test_a_sweep_that_makes_no_sense_is_one_sentence_and_leaves_nothing(
    config: Path, tmp_path: Path, options: list[str], said: str
) -> None:
    out = tmp_path / "out"
    assert said in locfuse("sweep", config, *options, "--out", out).sentence()
    assert not out.exists()


def test_a_config_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    for command in (("run",), ("config", "dump")):
        said = locfuse(*command, tmp_path / "absent.yaml")
        assert "absent.yaml" in said.sentence()


def test_a_folder_where_a_file_is_expected_is_one_sentence(config: Path, tmp_path: Path) -> None:
    for arguments, said in (
        (("replay", tmp_path), "is a folder; expected a capsule"),
        (("replay", tmp_path / "absent.zip"), "absent.zip: no such file"),
        (("capsule", config, "--out", tmp_path), "is a folder; expected a file"),
        (("evaluate", tmp_path, tmp_path), "is a folder; expected a file"),
        (("position", "--anchors", tmp_path, "--ranges", tmp_path), "is a folder; expected a file"),
    ):
        sentence = locfuse(*arguments).sentence()
        assert said in sentence
        assert "Errno" not in sentence


@pytest.mark.parametrize(
    "arguments",
    [("run",), ("nothing",), ("run", "x.yaml", "--seed", "-1"), ("run", "x.yaml", "--sead", "1"),
     ("reproduce", "ekim2020", "--seeds", "1")],
)  # fmt: skip
def test_wrong_usage_is_status_2_and_points_to_the_help(arguments: tuple[str, ...]) -> None:
    said = locfuse(*arguments)
    assert said.status == 2
    assert "--help" in said.err
    assert "Traceback" not in said.err


def test_a_recording_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    config = tmp_path / "run.yaml"
    config.write_text("log: {dataset: mrpt_office, path: nowhere}\n")
    assert "nowhere" in locfuse("run", config).sentence()


# How it starts ------------------------------------------------------------------------------------


def test_the_table_of_commands_says_what_their_modules_say() -> None:
    folder = Path(package.__file__).parent / "cli"
    helpers = {"__init__", "app", "inputs", "terminal"}
    assert set(COMMANDS) == {path.stem for path in folder.glob("*.py")} - helpers
    for name, line in COMMANDS.items():
        assert load(name).help.splitlines()[0] == line
        assert len(line) <= 65, "longer lines are cut on a screen of 80 columns"


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_and_version_load_no_command(option: str) -> None:
    code = ("import sys; from locfuse.cli.app import app; app(standalone_mode=False); "
            "print(*sys.modules, file=sys.stderr)")  # fmt: skip
    said = subprocess.run(
        [sys.executable, "-c", code, option], capture_output=True, text=True, check=True
    )
    loaded = set(said.stderr.split())
    assert "locfuse.cli.app" in loaded
    heavy = {"matplotlib", "papers", "pydantic", "yaml", "rich", "rosbags", "nicegui"}
    assert not heavy & loaded
    assert {name for name in loaded if name.startswith("locfuse.cli.")} == {"locfuse.cli.app"}


@pytest.mark.parametrize(
    ("typed", "offered"),
    [("locfuse re", ["replay", "reproduce"]), ("locfuse run --se", ["--seed"]),
     ("locfuse config d", ["dump"])],
)  # fmt: skip
def test_the_shell_completes_commands_and_options(typed: str, offered: list[str]) -> None:
    said = subprocess.run(
        [sys.executable, "-m", "locfuse"], capture_output=True, text=True, check=True,
        env={**os.environ, "_LOCFUSE_COMPLETE": "complete_bash", "COMP_WORDS": typed,
             "COMP_CWORD": str(len(typed.split()) - 1)},
    )  # fmt: skip
    assert said.stdout.split() == offered


def test_completion_can_be_installed() -> None:
    said = locfuse("--help")
    assert "--install-completion" in said.out
    assert "--show-completion" in said.out


# What is not installed ----------------------------------------------------------------------------


@pytest.fixture
def no_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make imports of matplotlib fail, as they do where it is not installed."""
    for name in [*sys.modules]:
        if name.split(".")[0] in ("matplotlib", "PIL") or name.startswith("locfuse.report.plot"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr("locfuse.report.plot", raising=False)
    for name in ("matplotlib", "PIL"):  # which comes with it
        monkeypatch.setitem(sys.modules, name, None)


@pytest.mark.usefixtures("no_matplotlib")
def test_a_run_without_matplotlib_writes_everything_but_pictures(
    config: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "path.png").write_bytes(b"of an earlier run")
    said = locfuse("run", config, "--out", out)
    assert said.status == 0
    assert said.out.count("pip install 'locfuse[plots]'") == 1
    written = {path.name for path in out.iterdir()}
    assert written == {"config.yaml", "estimate.tum", "truth.tum", "estimate.csv", "outcomes.csv",
                       "health.csv", "metrics.json", "report.html"}  # fmt: skip
    page = (out / "report.html").read_text()
    assert "locfuse[plots]" in page
    assert "<img" not in page
    assert "LocfusePlayer" in page


@pytest.mark.usefixtures("no_matplotlib")
def test_a_film_without_matplotlib_is_one_sentence_before_the_work(
    config: Path, tmp_path: Path
) -> None:
    said = locfuse("run", config, "--out", tmp_path / "out", "--film", tmp_path / "film.gif")
    assert "pip install 'locfuse[plots]'" in said.sentence()
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("no_matplotlib")
def test_check_and_sweep_without_matplotlib_say_how_to_add_pictures(
    config: Path, tmp_path: Path
) -> None:
    said = locfuse("check", config, "--out", tmp_path / "check")
    assert said.status == 0
    assert said.out.count("locfuse[plots]") == 1
    out = tmp_path / "sweep"
    said = locfuse("sweep", config, "--trials", 2, "--workers", 1, "--out", out)
    assert said.status == 0
    assert said.out.count("locfuse[plots]") == 1
    assert (out / "summary.json").is_file()
    assert (out / "trials.parquet").is_file()
    assert not list(out.glob("*.png"))


@pytest.mark.usefixtures("no_matplotlib")
def test_reproduce_without_matplotlib_is_one_sentence() -> None:
    assert "pip install 'locfuse[plots]'" in locfuse("reproduce", "ekim2020").sentence()


@pytest.mark.parametrize("missing", ["nicegui", "starlette.types"])
def test_the_studio_without_its_extra_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    for name in [*sys.modules]:
        if name.startswith("locfuse.studio"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    said = locfuse("studio", "--folder", tmp_path / "studio", "--port", 8699)
    assert "pip install 'locfuse[studio]'" in said.sentence()


def test_what_needs_a_checkout_says_so_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("locfuse.io.recording.__file__", str(tmp_path / "io" / "recording.py"))
    monkeypatch.chdir(tmp_path)
    assert "needs a checkout of locfuse" in locfuse("reproduce", "ekim2020").sentence()
    for kind in ("plaza", "lgo"):
        said = locfuse("convert", kind, tmp_path, tmp_path / "out").sentence()
        assert f"'convert {kind}', which is neither log nor bag, needs a checkout" in said


def test_reproduce_finds_the_checkout_around_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "papers").mkdir()
    (tmp_path / "papers" / "reproduce.py").write_text("")
    (tmp_path / "below").mkdir()
    monkeypatch.chdir(tmp_path / "below")
    assert checkout() == tmp_path


def test_the_demo_needs_nothing_and_leaves_a_configuration_to_change(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    said = locfuse("demo", "--out", out)
    assert said.status == 0, said.err
    assert "nobody said where it began" in said.out
    assert float(re.findall(r"RMSE ([\d.]+) cm", said.out)[0]) < 15.0
    assert "health: ok" in said.out
    assert (out / "report.html").stat().st_size > 100_000
    assert locfuse("run", out / "robot.yaml", "--out", tmp_path / "again").status == 0
