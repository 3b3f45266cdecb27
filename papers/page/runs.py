# SPDX-License-Identifier: Apache-2.0
"""All papers at once: their experiments in processes side by side, and one page of it all."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

from locfuse.types import ConfigError
from papers.claims import Progress
from papers.page.html import PAGE, page_of
from papers.page.repeated import PAPERS_IN_ORDER, ROWS, Repeated, write_rows
from papers.reproduce import draw, reproduce

LONGEST = ("gadau2022", "celan2017")  # begun first, so that no worker waits for them in the end


def stages(
    key: str, seeds: int, folder: Path | None, progress: Progress | None = None
) -> Iterator[Repeated]:
    """Repeat one paper: yield what came out first without pictures, then with them.

    Parameters
    ----------
    key : str
        A key of `reproduce.PAPERS`.
    seeds : int
    folder : Path, optional
        For its pictures, made if absent; without one there are none.
    progress : callable, optional
        Receives (runs done, runs in all).

    Raises
    ------
    ConfigError
        If the paper is not known.
    """
    began = time.monotonic()
    claims = [claim.row() for claim in reproduce(key, seeds, progress)]
    one = Repeated(key, seeds, time.monotonic() - began, claims, [])
    yield one
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        pictures = [file.name for file in draw(key, min(seeds, 12), folder)]
        yield replace(one, seconds=time.monotonic() - began, pictures=pictures)


def repeat(key: str, seeds: int, folder: Path) -> Repeated:
    """Repeat one paper; its exception is kept as its result, so that the others go on."""
    began = time.monotonic()
    one = Repeated(key, seeds, 0.0, [], [])
    try:
        for found in stages(key, seeds, folder):
            one = found
    except Exception as problem:
        seconds = time.monotonic() - began
        one = replace(one, seconds=seconds, error=f"{type(problem).__name__}: {problem}")
    return one


def seeds_of(quick: bool, seeds: int | None = None) -> dict[str, int]:
    """Return how many seeds each of the five papers has, quick or not, or as many as are asked.

    Raises
    ------
    ConfigError
        If both are asked.
    """
    if seeds is not None and quick:
        raise ConfigError(f"--seeds {seeds} and --quick say both how many seeds; give one of them")
    return {paper.key: seeds or (paper.quick_seeds if quick else paper.seeds)
            for paper in PAPERS_IN_ORDER}  # fmt: skip


def repeat_all(
    folder: Path,
    seeds: Mapping[str, int],
    quick: bool = False,
    progress: Progress | None = None,
    executor: Executor | None = None,
    workers: int = 2,
) -> list[Repeated]:
    """Repeat every paper and write ``papers.html`` and ``papers.json`` into a folder.

    Parameters
    ----------
    folder : Path
        Made if absent; pictures go into a folder for each paper.
    seeds : mapping of a paper's key to its seeds
        As `seeds_of`.
    quick : bool
        What the rows say of it.
    progress : callable, optional
        Receives (papers done, papers in all).
    executor : Executor, optional
        That runs them; a pool of `workers` processes otherwise.

    Returns
    -------
    list of Repeated
        In the order of `PAPERS_IN_ORDER`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if executor is None:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            return repeat_all(folder, seeds, quick, progress, pool)
    by_length = sorted(PAPERS_IN_ORDER, key=lambda p: p.key not in LONGEST)
    futures = [executor.submit(repeat, p.key, seeds[p.key], folder / p.key) for p in by_length]
    found = {}
    for done, future in enumerate(as_completed(futures), start=1):
        one = future.result()
        found[one.paper] = one
        if progress is not None:
            progress(done, len(futures))
    repeated = [found[p.key] for p in PAPERS_IN_ORDER]
    write_page(repeated, folder, quick)
    return repeated


def write_page(repeated: Sequence[Repeated], folder: Path, quick: bool) -> None:
    """Write page and rows beside the folders of the pictures."""
    write_rows(repeated, folder / ROWS, quick)
    (folder / PAGE).write_text(page_of(repeated, folder), encoding="utf-8")
