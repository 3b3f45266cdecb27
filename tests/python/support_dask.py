# SPDX-License-Identifier: Apache-2.0
"""A Dask cluster on loopback, in a network of its own: a scheduler and two workers.

``python support_dask.py FOLDER``, in a fresh network namespace, runs a sweep on it, ends one of the
workers in the middle, and writes the table into FOLDER. It prints what it did as JSON.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from locfuse.sweep import dask_cluster, run_trials
from support_sweep import VARY, short_room

ADDRESS = "tcp://127.0.0.1:8786"
TRIALS = 60


def namespace() -> list[str] | None:
    """Return the words that start a command where nothing but loopback is; None if they fail."""
    words = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--net", "--map-root-user"]
    words += ["sh", "-c", 'ip link set lo up && exec "$@"', "sh"]
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        return None
    return words if subprocess.run([*words, "true"], capture_output=True).returncode == 0 else None


@contextlib.contextmanager
def cluster(workers: int, folder: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Start a scheduler and workers of one process and one thread; yield the workers."""
    module = [sys.executable, "-m"]
    settings = {**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ACTIVE_MEMORY_MANAGER__START": "False"}
    commands = [[*module, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "8786",
                 "--no-dashboard"]]  # fmt: skip
    commands += [[*module, "distributed.cli.dask_worker", ADDRESS, "--nthreads", "1", "--no-nanny",
                  "--no-dashboard", "--host", "127.0.0.1", "--local-directory", str(folder)]
                 for _ in range(workers)]  # fmt: skip
    with contextlib.ExitStack() as stack:
        started: list[subprocess.Popen[bytes]] = []
        for command in commands:
            log = stack.enter_context((folder / f"dask_{len(started)}.log").open("wb"))
            process = subprocess.Popen(command, env=settings, stdout=log, stderr=log)
            stack.callback(_end, process)
            started.append(process)
        yield started[1:]


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.kill()
    process.wait()


def main(folder: Path) -> None:
    """Run the sweep; half way through, one of the workers is killed."""
    with cluster(2, folder) as workers, dask_cluster(ADDRESS, workers=2) as (executor, threads):
        killed_at: list[int] = []

        def kill_one(done: int, total: int) -> None:
            if done >= total // 3 and not killed_at:
                workers[0].send_signal(signal.SIGKILL)
                workers[0].wait()
                killed_at.append(done)

        found = run_trials(short_room(), TRIALS, VARY, executor=executor, workers=threads,
                           out=folder / "out", progress=kill_one)  # fmt: skip
        alive = [worker.poll() is None for worker in workers]
    print(json.dumps({"threads": threads, "killed_at": killed_at, "alive": alive,
                      "trials": len(found), "failed": int(found.failed.sum())}))  # fmt: skip


if __name__ == "__main__":
    main(Path(sys.argv[1]))
