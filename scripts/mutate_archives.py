# SPDX-License-Identifier: Apache-2.0
"""Mutates bags, capsules, logs and maps and reads them: ``mutate_archives.py N [SEED] [KEEP]``.

Each is read in a process of its own that may take 1 GiB and 10 s of processor time. It is read, or
refused with a ConfigError or a LogError of one line; nothing else is written, started or called up.
What breaks that is reported, with status 1, and kept in the folder KEEP.
"""

from __future__ import annotations

import gzip
import logging
import os
import resource
import shutil
import signal
import sys
import tempfile
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from locfuse.config.load import parse_config
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.rosbag.bag_stream import Bag
from locfuse.io.rosbag.bags import read_bag, write_bag
from locfuse.io.rosbag.container import need, zstd
from locfuse.io.rosbag.wire import store
from locfuse.run.capsule import make_capsule, read_capsule, write_capsule
from locfuse.run.run import load_log
from locfuse.types import ConfigError, LogError

MAX_BYTES = 1 << 30
MAX_SECONDS = 10
GOOD = ("read", "refused")
ENDS = (*GOOD, "broken")  # by exit status of the process that reads
CALLS = ("os.exec", "os.fork", "os.kill", "os.posix_spawn", "os.system", "socket.connect",
         "subprocess.Popen")  # fmt: skip
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
NUMBERS = [
    *range(8),
    127,
    128,
    255,
    256,
    2**16 - 1,
    *(2**k - d for k in (31, 32, 63, 64) for d in (0, 1)),
]
Generator = np.random.Generator


def write_seeds(folder: Path) -> None:
    """Write small archives of each kind, one a folder."""
    log = load_log(parse_config({"simulation": {"duration_s": 1.5}}), None, 0)
    for name in ("bag", "mcap"):
        (folder / name).mkdir()
        write_bag(log, folder / name / f"a.{name}")
    messages = list(Bag(folder / "mcap" / "a.mcap").messages(lambda _: True))
    modes = need("rosbags.rosbag2").CompressionMode
    for name, plugin, mode in (("plain_mcap", "MCAP", None), ("db3", "SQLITE3", None),
                               ("packed", "SQLITE3", modes.FILE),
                               ("messages", "SQLITE3", modes.MESSAGE)):  # fmt: skip
        _write_ros2(folder / name, messages, plugin, mode)
    (folder / "capsule").mkdir()
    config = parse_config({"simulation": {"duration_s": 1.5, "map": {}}})
    write_capsule(make_capsule(config), folder / "capsule" / "a.zip")
    write_log(load_log(config, None, 0), folder / "log")
    table = folder / "log" / "odometry.csv"
    table.with_suffix(".csv.gz").write_bytes(gzip.compress(table.read_bytes(), mtime=0))
    table.unlink()


def _write_ros2(folder: Path, messages: list[Any], plugin: str, mode: Any) -> None:
    rosbag2 = need("rosbags.rosbag2")
    writer = rosbag2.Writer(folder, version=8, storage_plugin=rosbag2.StoragePlugin[plugin])
    if mode is not None:
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    known: dict[str, Any] = {}
    with writer:
        for connection, time_ns, data in messages:
            topic, kind = f"/{connection.topic}", connection.type.replace("/", "/msg/")
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store("cdr"))
            writer.write(known[topic], time_ns, data)


def mutate(folder: Path, rng: Generator) -> None:
    """Change a file of a folder, or what is packed in it."""
    paths = sorted(folder.iterdir(), key=lambda path: path.name)
    others = [path for path in paths if path.name != "metadata.yaml"]
    path = (others if rng.random() < 0.9 else paths)[rng.integers(len(others))]
    data = path.read_bytes()
    if path.suffix == ".zip" and rng.random() < 0.8:
        with zipfile.ZipFile(path) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        name = str(rng.choice(list(files)))
        files[name] = mutated(files[name], rng)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, text in files.items():
                archive.writestr(name, text)
    elif path.suffix in (".gz", ".zstd") and rng.random() < 0.8:
        module = gzip if path.suffix == ".gz" else zstd()
        path.write_bytes(module.compress(mutated(module.decompress(data), rng)))
    else:
        path.write_bytes(mutated(data, rng))


def mutated(data: bytes, rng: Generator) -> bytes:
    """Return bytes of which some are others, cut off, moved, repeated, or other lengths."""
    is_paged = b"SQLite format 3" in data[:100] and rng.random() < 0.8  # of which no page moves
    for _ in range(int(rng.geometric(0.4))):
        at, other = sorted(rng.integers(0, len(data) + 1, 2).tolist())
        at = int(at * rng.random() ** 2) if rng.random() < 0.5 else at  # lengths are in front
        size = min(other - at, int(rng.integers(1, 5000)))
        order: Literal["little", "big"] = "little" if rng.random() < 0.5 else "big"
        width = int(rng.choice([1, 2, 4, 8]))
        number = (NUMBERS[rng.integers(len(NUMBERS))] % 256**width).to_bytes(width, order)
        changed = [
            data[:at] + rng.bytes(1) + data[at + 1 :],
            data[:at] + rng.bytes(size) + data[at + size :],
            data[:at] + number + data[at + width :],
            data[:at] + data[other : other + size] + data[at + len(data[other : other + size]) :],
            data[:at] + data[at + size :],
            data[:at] + data[at : at + size] * 20 + data[at + size :],
            data[:at] if rng.random() < 0.3 else data,
        ]
        data = changed[rng.integers(4 if is_paged else len(changed))]
    return data


def read(folder: Path, out: Path) -> None:
    """Read what a folder of seeds holds; a bag is also written as a log."""
    if folder.name == "capsule":
        read_capsule(folder / "a.zip")
    elif folder.name == "log":
        read_log(folder)
    else:
        of_file = next((f for f in folder.iterdir() if f.suffix in (".bag", ".mcap")), folder)
        write_log(read_bag(of_file), out)


def outcome(work: Callable[[], None], allowed: Path) -> str:
    """Return how a process ended that did some work and may write to one folder only."""
    pid = os.fork()
    if pid == 0:
        os._exit(_limited(work, allowed))
    _, status = os.waitpid(pid, 0)
    if os.WIFSIGNALED(status):
        return signal.Signals(os.WTERMSIG(status)).name
    return ENDS[os.waitstatus_to_exitcode(status)]


def _limited(work: Callable[[], None], allowed: Path) -> int:
    broken: list[str] = []

    def watch(event: str, given: tuple[Any, ...]) -> None:
        is_call = event in CALLS
        is_write = event == "open" and isinstance(given[2], int) and given[2] & WRITES
        if is_write and isinstance(given[0], str | bytes):
            is_call = not Path(os.fsdecode(given[0])).resolve().is_relative_to(allowed)
        if is_call:
            broken.append(f"{event} {given}")

    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MAX_BYTES,) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_SECONDS,) * 2)
    signal.alarm(30 * MAX_SECONDS)
    sys.addaudithook(watch)
    status = 0
    try:
        work()
    except (ConfigError, LogError) as error:
        status = 1
        if "\n" in str(error) or len(str(error)) > 2000:
            broken.append(f"{len(str(error))} letters or several lines: {str(error)[:300]}")
    except BaseException:
        broken.append(traceback.format_exc())
    if broken:
        print(*broken, sep="\n", file=sys.stderr, flush=True)
        return 2
    return status


def try_out(count: int, seed: int, keep: Path | None = None) -> Counter[str]:
    """Return how many mutations of each kind of archive ended in which way."""
    found: Counter[str] = Counter()
    logging.getLogger("locfuse").setLevel(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as name:
        root = Path(name).resolve()
        (root / "seeds").mkdir()
        write_seeds(root / "seeds")
        kinds = sorted((root / "seeds").iterdir())
        for number in range(count):
            kind, work = kinds[number % len(kinds)], root / "around" / "work"
            shutil.copytree(kind, work / kind.name)
            (work / "tmp").mkdir()
            mutate(work / kind.name, np.random.default_rng([seed, number]))
            how = outcome(partial(_read_in, work, kind.name), work)
            if strange := _strange(root, kind):
                how = f"left {', '.join(strange)}"
            if how not in GOOD:
                print(f"{kind.name}, seed {seed}, number {number}: {how}", file=sys.stderr)
                if keep is not None:
                    shutil.copytree(work / kind.name, keep / f"{kind.name}_{seed}_{number}")
            found[f"{kind.name}: {how}"] += 1
            shutil.rmtree(root / "around")
    return found


def _read_in(work: Path, name: str) -> None:
    os.chdir(work)
    tempfile.tempdir = str(work / "tmp")
    read(work / name, work / "out")


def _strange(root: Path, kind: Path) -> list[str]:
    """Return which files are where none was to be written."""
    here = Path("around", "work")
    mine = {f"{here / kind.name / path.name}{end}" for path in kind.iterdir()
            for end in ("", "-journal", "-shm", "-wal")}  # fmt: skip
    allowed = {"seeds", "around", str(here), *(str(here / name) for name in (kind.name, "tmp"))}
    return [name for path in root.rglob("*") if (name := str(path.relative_to(root))) not in
            mine | allowed and not path.is_relative_to(root / "seeds")
            and not path.is_relative_to(root / here / "out")]  # fmt: skip


def main(count: str = "10000", seed: str = "0", keep: str | None = None) -> int:
    """Print counts; return 1 if something broke."""
    found = try_out(int(count), int(seed), None if keep is None else Path(keep))
    for what, times in sorted(found.items()):
        print(f"{times:6} {what}")
    return int(any(what.split(": ")[1] not in GOOD for what in found))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
