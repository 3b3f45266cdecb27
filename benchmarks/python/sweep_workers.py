# SPDX-License-Identifier: Apache-2.0
"""Duration of a sweep with one process, with two, and with two local workers of a Dask cluster.

``PYTHONPATH=tests/python .venv/bin/python benchmarks/python/sweep_workers.py [TRIALS] [ROUNDS]``

Says also whether they give the same table, and one that was killed at half and resumed, too. Runs
itself in a network namespace of its own. The three take turns, so that what else the machine
does falls on all of them; figures are medians over the rounds. The processes of a pool are started
within the time that is taken; the workers of the cluster are there before, as those of a cluster.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from locfuse.config.load import load_config
from locfuse.sweep import Trials, dask_cluster, run_trials
from locfuse.sweep.table import NOT_REPEATED, PARTS, TABLE
from locfuse.sweep.workers import one_thread_each

ROOM = Path(__file__).resolve().parents[2] / "examples/configs/ekim_room.yaml"
INSIDE = "LOCFUSE_IN_NAMESPACE"


def main(trials: int, rounds: int) -> None:
    """Measure and print."""
    from support_dask import ADDRESS, cluster  # here: each process of a pool imports this file

    taken: dict[str, list[float]] = {"1 process": [], "2 processes": [], "2 workers, Dask": []}
    tables: dict[str, Trials] = {}
    config = load_config(ROOM)
    with tempfile.TemporaryDirectory() as name, one_thread_each(), cluster(2, Path(name)):
        for turn in range(rounds):
            for who, seconds in taken.items():
                out = Path(name) / who.replace(" ", "_") / str(turn)
                began = time.perf_counter()
                if "Dask" in who:
                    with dask_cluster(ADDRESS, workers=2) as (executor, threads):
                        found = run_trials(config, trials, executor=executor, workers=threads,
                                           out=out)  # fmt: skip
                else:
                    found = run_trials(config, trials, workers=int(who[0]), out=out)
                seconds.append(time.perf_counter() - began)
                tables[who] = found
        tables["killed at half, resumed"] = killed_and_resumed(trials, Path(name) / "killed")
    one, two, dask = (statistics.median(seconds) for seconds in taken.values())
    for who, seconds in taken.items():
        shown = " ".join(f"{value:.1f}" for value in seconds)
        print(f"{who:16} {statistics.median(seconds):6.1f} s   ({shown})")
    print(f"2 processes are {one / two:.2f} times as fast as 1; Dask takes {dask / two:.2f} times "
          "as long as the pool")  # fmt: skip
    for who, table in tables.items():
        print(f"{who:24} {len(table)} trials, {difference(table, tables['1 process'])}")


def killed_and_resumed(trials: int, out: Path) -> Trials:
    """Return the table of a sweep that was killed halfway and resumed."""
    command = [sys.executable, "-m", "locfuse", "sweep", str(ROOM), f"--trials={trials}",
               "--workers=2", f"--out={out}"]  # fmt: skip
    started = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while kept(out) < trials // 2:
        if started.poll() is not None:
            sys.exit("the sweep was over before it could be killed")
        time.sleep(0.02)
    started.kill()
    started.wait()
    print(f"killed when {kept(out)} of {trials} trials were kept")
    return run_trials(load_config(ROOM), trials, base=ROOM.parent, workers=2, out=out)


def kept(out: Path) -> int:
    """Return the number of trials in a folder."""
    import pyarrow.parquet as pq

    files = [out / TABLE, *(out / PARTS).glob("*.parquet")]
    try:
        return sum(pq.read_metadata(file).num_rows for file in files if file.is_file())
    except FileNotFoundError:  # the parts were merged meanwhile
        return 0


def difference(table: Trials, expected: Trials) -> str:
    """Return a sentence that names the columns that differ bitwise."""
    names = [name for name, column in expected.columns.items() if name not in NOT_REPEATED
             and table[name].tobytes() != column.tobytes()]  # fmt: skip
    return f"other values of {', '.join(names)}" if names else "the same bit for bit"


if __name__ == "__main__":
    from support_dask import namespace

    if INSIDE not in os.environ:
        words = namespace()
        if words is None:
            sys.exit("needs unshare and ip, and the right to make a network namespace")
        os.environ[INSIDE] = "1"
        os.execvp(words[0], [*words, sys.executable, *sys.argv])
    given = [int(word) for word in sys.argv[1:]]
    main(*(given + [1000, 3][len(given) :]))
