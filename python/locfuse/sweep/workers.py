# SPDX-License-Identifier: Apache-2.0
"""Workers of a sweep: processes of this machine, or a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection

from locfuse.types import ConfigError

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
PATIENCE_S = 10.0  # timeout of the scheduler and of its first worker


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class ProcessPool(ProcessPoolExecutor):
    """A pool of new processes that never outlive their parent; see `one_thread_each`.

    Each holds the far end of a pipe. When the near end closes, by `end` or because this process was
    killed, it exits at once, even within a trial.
    """

    def __init__(self, workers: int) -> None:
        context = multiprocessing.get_context("spawn")
        far_end, self._line = context.Pipe(duplex=False)
        super().__init__(workers, context, initializer=_settle, initargs=(far_end,))

    def end(self) -> None:
        """End the processes at once."""
        self._line.close()
        self.shutdown(wait=False, cancel_futures=True)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Limit processes started in this context to one thread each, also in libraries.

    Libraries read the environment when they are loaded, before any code of ours runs.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _settle(line: Connection) -> None:
    """Leave interrupts to the parent, and exit with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(line,), daemon=True).start()


def _end_with(line: Connection) -> None:
    line.poll(None)  # nothing is ever sent: this returns when the pipe closes
    os._exit(1)


@contextmanager
def dask_cluster(address: str, workers: int = 1) -> Iterator[tuple[Executor, int]]:
    """Connect to the scheduler of a Dask cluster.

    `address` is such as ``tcp://10.0.0.1:8786``. At least `workers` are waited for up to 10 s;
    later ones work, too. Yields an executor, and the threads of all workers together. Raises
    ConfigError if distributed is not installed, OSError if no scheduler answers, or it has fewer.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ConfigError(
            "a Dask cluster needs the package distributed; pip install 'locfuse[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise OSError(f"no Dask scheduler answers at {address} ({why})") from None
    try:
        try:
            client.wait_for_workers(workers, timeout=PATIENCE_S)
        except TimeoutError:
            raise OSError(
                f"the Dask scheduler at {address} has fewer than {workers} workers; start some by "
                f"'dask worker {address} --nthreads 1'"
            ) from None
        with client.get_executor(pure=False) as executor:
            yield executor, sum(client.ncores().values())
    finally:
        client.close()
