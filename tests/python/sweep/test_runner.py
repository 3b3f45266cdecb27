# SPDX-License-Identifier: Apache-2.0
"""Many trials: the same table whoever runs them, whatever ends in between."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import support_sweep
from locfuse.config.load import load_config
from locfuse.io.whole import alone_in
from locfuse.sweep import Trials, run_trials
from locfuse.sweep.table import BATCHES
from locfuse.types import ConfigError
from support_runs import room
from support_sweep import VARY, assert_same, short_room

TRIALS = 12


def on_threads(threads: int = 1, trials: int = TRIALS, **more: Any) -> Trials:
    with ThreadPoolExecutor(threads) as pool:
        return run_trials(short_room(), trials, VARY, executor=pool, **more)


def test_the_table_is_the_same_on_any_executor_and_number_of_workers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    expected = on_threads()
    assert len(expected) == TRIALS
    assert not expected.failed.any()
    assert_same(on_threads(3), expected)
    assert_same(run_trials(short_room(), TRIALS, VARY, workers=2), expected)
    monkeypatch.setattr("locfuse.sweep.runner.BATCH_S", 0.0)
    assert_same(on_threads(2), expected)


def test_varied_keys_do_vary_the_runs() -> None:
    with ThreadPoolExecutor(1) as pool:
        found = run_trials(short_room(), 40, {"simulation.ranges.sigma_relative": [0.001, 0.1]},
                           executor=pool)  # fmt: skip
    small, large = (found["nis_ranges"][k::2].mean() for k in (0, 1))
    assert large > 10.0 * small


def test_a_value_that_is_not_allowed_is_refused_before_any_trial_starts() -> None:
    class Unused(Executor):
        def submit(self, *args: Any, **kwargs: Any) -> Future[Any]:
            raise AssertionError("a trial was started")

    for values in ("0.1,0.2,-0.3", "-0.00001..0.1"):
        with pytest.raises(ConfigError, match="expected at least 0"):
            run_trials(short_room(), 3, {"simulation.ranges.sigma_m": values}, executor=Unused())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"trials": 0}, "trials is 0"),
        ({"workers": 0}, "workers is 0"),
        ({"recovered_m": 0.0}, "recovered_m is 0"),
        ({"recovered_m": float("nan")}, "recovered_m is nan"),
        ({"config": room(simulation=None)}, "names no 'log'"),
    ],
)
def test_what_makes_no_sense_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        run_trials(**{"config": short_room(), "trials": 3, **changes})


def test_trials_that_fail_are_rows_among_others() -> None:
    config = room(simulation={"duration_s": 2.0, "poses": None}, use=["odometry", "ranges"])
    with ThreadPoolExecutor(2) as pool:
        found = run_trials(config, 6, {"start": "truth,auto"}, executor=pool)
    assert found.failed.tolist() == [False, True] * 3
    assert np.isfinite(found["position_rmse_m"]).tolist() == [True, False] * 3
    assert "LogError" in found["error"][1]


# What is kept ----------------------------------------------------------------------------------


def test_a_sweep_that_is_there_is_not_run_again_and_may_grow(tmp_path: Path) -> None:
    first = on_threads(out=tmp_path)
    calls: list[tuple[int, int]] = []
    again = on_threads(out=tmp_path, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(TRIALS, TRIALS)]
    assert again["wall_s"].tolist() == first["wall_s"].tolist()
    more = on_threads(out=tmp_path, trials=TRIALS + 4)
    assert_same(more, on_threads(trials=TRIALS + 4))
    assert more["wall_s"][:TRIALS].tolist() == first["wall_s"].tolist()


def test_the_folder_of_another_sweep_is_refused(tmp_path: Path) -> None:
    on_threads(out=tmp_path)
    with pytest.raises(ConfigError, match="another sweep: its recovered_m"):
        on_threads(out=tmp_path, recovered_m=0.5)
    with ThreadPoolExecutor(1) as pool, pytest.raises(ConfigError, match="another sweep: its vary"):
        run_trials(short_room(), TRIALS, executor=pool, out=tmp_path)


def test_the_table_holds_what_is_returned(tmp_path: Path) -> None:
    found = on_threads(out=tmp_path)
    table = pq.read_table(tmp_path / "trials.parquet")
    assert table.column_names == list(found.columns)
    for name, column in found.columns.items():
        values = table.column(name).to_pylist()
        if name == "error":
            assert values == [None] * TRIALS
        elif column.dtype == np.float64:
            np.testing.assert_array_equal(np.array(values, np.float64), column)
        else:
            assert values == column.tolist()


def test_a_sweep_that_was_killed_goes_on_to_the_same_table(tmp_path: Path) -> None:
    trials, out = 150, tmp_path / "out"
    config = tmp_path / "room.yaml"
    config.write_text("simulation: {duration_s: 60}\n")
    vary = [f"--vary={key}={values}" for key, values in VARY.items()]
    command = [sys.executable, "-m", "locfuse", "sweep", str(config), f"--trials={trials}",
               "--workers=2", f"--out={out}", *vary]  # fmt: skip
    started = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for(lambda: started.poll() is not None or any((out / "parts").glob(BATCHES)))
    children = Path(f"/proc/{started.pid}/task/{started.pid}/children").read_text().split()
    assert started.poll() is None, "it was done before it could be killed"
    started.send_signal(signal.SIGKILL)
    started.wait()
    assert not (out / "trials.parquet").exists()
    kept = sum(len(pq.read_table(part)) for part in (out / "parts").glob(BATCHES))
    assert 0 < kept < trials
    wait_for(lambda: not any(is_running(int(pid)) for pid in children))

    room_again = load_config(config)
    calls: list[int] = []
    resumed = run_trials(room_again, trials, VARY, workers=2, base=tmp_path, out=out,
                         progress=lambda done, total: calls.append(done))  # fmt: skip
    assert calls[0] == kept
    with ThreadPoolExecutor(1) as pool:
        assert_same(resumed, run_trials(room_again, trials, VARY, executor=pool, base=tmp_path))


def test_an_interrupt_ends_it_at_once_and_nothing_runs_on(tmp_path: Path) -> None:
    config = tmp_path / "room.yaml"
    config.write_text("simulation: {duration_s: 150000}\n")  # a trial of minutes
    command = [sys.executable, "-m", "locfuse", "sweep", str(config), "--trials=8", "--workers=1",
               f"--out={tmp_path / 'out'}"]  # fmt: skip
    # As from a terminal: what a shell starts in the background ignores interrupts.
    interruptible = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    started = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                               preexec_fn=interruptible)  # fmt: skip
    of_it = Path(f"/proc/{started.pid}/task/{started.pid}/children")
    wait_for(lambda: started.poll() is not None or is_busy(of_it.read_text().split()))
    children = of_it.read_text().split()
    started.send_signal(signal.SIGINT)
    assert started.wait(60.0) != 0
    wait_for(lambda: not any(is_running(int(pid)) for pid in children))


def is_busy(pids: list[str]) -> bool:
    """Return whether one of some processes has computed for two seconds."""
    ticks = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11] for pid in pids]
    return any(int(tick) > 2 * os.sysconf("SC_CLK_TCK") for tick in ticks)


def wait_for(happens: Any, seconds: float = 120.0) -> None:
    until = time.monotonic() + seconds
    while not happens():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.005)


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


# Workers that end ------------------------------------------------------------------------------


def test_a_process_that_is_killed_costs_no_trial() -> None:
    killed: list[int] = []

    def kill_one(done: int, total: int) -> None:
        if done > 0 and not killed:
            killed.append(multiprocessing.active_children()[0].pid or 0)
            os.kill(killed[0], signal.SIGKILL)

    found = run_trials(short_room(), 60, VARY, workers=2, progress=kill_one)
    assert len(killed) == 1
    assert_same(found, on_threads(trials=60))


def test_a_trial_that_ends_its_process_is_a_row_with_its_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    expected = on_threads()
    monkeypatch.setattr("locfuse.sweep.runner.run_batch", support_sweep.ends_its_worker)
    found = run_trials(short_room(), TRIALS, VARY, workers=2)
    assert np.flatnonzero(found.failed).tolist() == [3]
    assert found["error"][3].startswith("its worker ended: BrokenProcessPool")
    good = ~found.failed
    assert_same(found.some(good), expected.some(good))


def test_a_trial_that_is_better_the_second_time_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = on_threads()
    monkeypatch.setattr("locfuse.sweep.runner.run_batch", support_sweep.ends_its_worker_once)
    found = run_trials(short_room(), TRIALS, VARY, workers=2, base=tmp_path)
    assert (tmp_path / "ended").exists()
    assert_same(found, expected)


class Broken(Executor):
    """An executor whose batches all end in the same way."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def submit(self, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_exception(self.error)
        return future


def test_an_executor_that_is_gone_is_one_sentence(tmp_path: Path) -> None:
    for error, said in (
        (BrokenExecutor("gone"), "is broken"),
        (CancelledError(), "cancelled its work"),
    ):
        with pytest.raises(OSError, match=f"{said}.*run the same again to resume"):
            run_trials(short_room(), 3, executor=Broken(error), out=tmp_path)


def test_two_programs_do_not_write_one_sweep(tmp_path: Path) -> None:
    with (
        ThreadPoolExecutor(1) as pool,
        alone_in(tmp_path / "out"),
        pytest.raises(ConfigError, match="another program is writing it"),
    ):
        run_trials(short_room(), TRIALS, VARY, executor=pool, out=tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_an_executor_that_runs_nothing_gives_rows_with_its_error() -> None:
    found = run_trials(short_room(), 5, executor=Broken(MemoryError("no room")))
    assert found["error"].tolist() == ["its worker ended: MemoryError: no room"] * 5


def test_processes_use_one_thread_each_and_the_environment_is_left_as_it_was(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from locfuse.sweep.workers import ONE_THREAD, ProcessPool, one_thread_each

    monkeypatch.setenv(ONE_THREAD[0], "7")
    monkeypatch.delenv(ONE_THREAD[1], raising=False)
    with one_thread_each(), ProcessPool(1) as pool:
        assert [pool.submit(os.getenv, name).result() for name in ONE_THREAD] == ["1"] * 3
    assert os.environ[ONE_THREAD[0]] == "7"
    assert ONE_THREAD[1] not in os.environ


def test_workers_do_not_import_the_command_line() -> None:
    # They import the script that started them: that of the console, as pip writes it.
    entry = '[project.scripts]\nlocfuse = "locfuse.__main__:main"\n'
    assert entry in (Path(__file__).resolve().parents[3] / "pyproject.toml").read_text()
    code = "import sys; from locfuse.__main__ import main; print('locfuse.cli.app' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    assert found.stdout == "False\n"
