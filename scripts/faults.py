# SPDX-License-Identifier: Apache-2.0
"""Let the n-th write of a command fail or kill it, and check that results are whole or absent.

Usage: faults.py [--count N] [COMMAND ...]. COMMAND is one of those of `COMMANDS`; N the faults for
each, spread over all its calls that change a file: a full disk, an input or output error, SIGKILL,
a clock that is set back by a day.
"""

from __future__ import annotations

import argparse
import ctypes
import errno
import importlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "tests" / "python" / "support_faults.c"
KINDS = {
    "full disk": errno.ENOSPC,
    "input or output": errno.EIO,
    "kill": 0,
    "read-only": errno.EROFS,
    "no permission": errno.EACCES,
    "clock set back": -1,
}
SCENE = "name: {name}\nseed: {seed}\nsimulation: {{duration_s: 2, map: {{}}}}\n"
MAPPED = (
    "name: {name}\nseed: {seed}\n"
    "estimator: {{kind: landmark_slam, landmark_slam: {{use_map: false}}}}\n"
    "simulation: {{duration_s: 4, ranges: null, poses: null, landmarks: {{A: [5, 5], B: [9, 6]}},\n"
    "  landmark_sightings: {{}}}}\n"
)
# What a command writes anew over results of before; "studio" saves a scene.
COMMANDS: dict[str, tuple[str, ...]] = {
    "run": ("run", "{config}", "--out", "{out}"),
    "map": ("run", "{mapped}", "--out", "{out}"),
    "convert": ("convert", "log", "{log}", "{out}"),
    "bag": ("convert", "log", "{log}", "{out}/drive.mcap"),
    "capsule": ("capsule", "{config}", "--out", "{out}/run.zip"),
    "sweep": ("sweep", "{same}", "--out", "{out}", "--trials", "{trials}", "--workers", "1"),
    "studio": (),
}
RESUMED = ("sweep",)  # what may be written in part, and is completed by the same command


def preloaded(arguments: Sequence[str]) -> int:
    """Run this script again with the library of faults in front of the C library."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder, "faults.so")
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, SOURCE, "-ldl"], check=True)
        environment = {**os.environ, "LD_PRELOAD": str(library), "MPLBACKEND": "agg"}
        command = [sys.executable, __file__, *arguments]
        return subprocess.run(command, env=environment, check=False).returncode


def forked(work: Callable[[], None]) -> int:
    """Do some work in a copy of this process; return its exit status, negative for a signal."""
    child = os.fork()
    if child == 0:
        status = 0
        try:
            work()
        except SystemExit as ended:
            status = int(ended.code or 0)
        except BaseException as error:  # what no command should let through
            os.write(2, f"{type(error).__name__}: {error}\n".encode())
            status = 70
        os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def content(folder: Path) -> dict[str, bytes]:
    """Return the files of results but for those that are hidden."""
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file() and not any(p.startswith(".") for p in file.relative_to(folder).parts)
    }


def save_scene(values: dict[str, object]) -> None:
    """Save the scene of a configuration as the studio does, in its words for what goes wrong."""
    from locfuse.studio.scene import Scene
    from locfuse.studio.workspace import Workspace
    from locfuse.types import ConfigError

    try:
        scene = Scene()
        scene.load_text(Path(str(values["config"])).read_text())
        Workspace(Path(str(values["out"]))).save(scene, "hall", replace=True)
    except (ConfigError, OSError) as error:
        os.write(2, f"locfuse: {error}\n".encode())
        raise SystemExit(1) from None


def command_of(name: str, values: dict[str, object], fault: tuple[int, int] | None, said: Path,
               counted: Path | None = None) -> int:  # fmt: skip
    """Call a command in a copy of this process, with a fault or with none; return its status."""
    library = ctypes.CDLL(None)

    def work() -> None:
        from locfuse.cli import app

        sys.argv = ["locfuse", *(part.format(**values) for part in COMMANDS[name])]
        file = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, 1)
        os.dup2(file, 2)
        library.faults_arm(*(fault or (10**9, 0)))
        try:
            if name == "studio":
                save_scene(values)
            else:
                app.main()
        finally:
            calls = library.faults_calls()
            library.faults_arm(-1, 0)
            if counted is not None:
                counted.write_text(str(calls))

    return forked(work)


def check(name: str, count: int, folder: Path) -> list[str]:
    """Return what is wrong with a command under `count` faults."""
    for which, seed in (("old", 1), ("new", 2)):
        (folder / f"{which}.yaml").write_text(SCENE.format(name=which, seed=seed))
        (folder / f"{which}-mapped.yaml").write_text(MAPPED.format(name=which, seed=seed))
    results = {}
    logs = {}
    for which in ("old", "new"):
        logs[which] = folder / f"log-{which}"
        config = folder / f"{which}.yaml"
        values: dict[str, object] = {"config": config, "log": logs[which], "out": folder / which,
                                     "mapped": folder / f"{which}-mapped.yaml",
                                     "same": folder / "old.yaml", "trials": 1 + seed}  # fmt: skip
        write_log_of(config, logs[which])
        if which == "new" and name in RESUMED:
            shutil.copytree(folder / "old", folder / "new")
        else:
            (folder / which).mkdir()
        if command_of(name, values, None, folder / "said", folder / "calls") != 0:
            return [f"{name} fails without a fault: {(folder / 'said').read_text()}"]
        results[which] = comparable(content(folder / which))
    calls = int((folder / "calls").read_text())
    wrong = []
    statuses: Counter[int] = Counter()
    out = folder / "out"
    for index in range(count):
        kind = list(KINDS)[index % len(KINDS)]
        n = 1 + index * calls // count
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(folder / "old", out)
        values = {**values, "out": out}
        status = command_of(name, values, (n, KINDS[kind]), folder / "said")
        statuses[status] += 1
        said = (folder / "said").read_text().strip()
        found = comparable(content(out))
        is_marked = "incomplete.txt" in found
        is_whole = found in (results["old"], results["new"])
        if name in RESUMED:
            is_whole = all(found[k] in (results["old"].get(k), results["new"].get(k, found[k]))
                           for k in found)  # fmt: skip
            again = command_of(name, values, None, folder / "said again")
            if again != 0 or comparable(content(out)) != results["new"]:
                wrong.append(f"{name}, {kind} at call {n}: is not resumed, status {again}: "
                             f"{(folder / 'said again').read_text()[-200:]}")  # fmt: skip
        what = f"{name}, {kind} at call {n} of {calls}, status {status}"
        if not is_whole and not is_marked:
            names = sorted(k for k in found if found[k] != results["old"].get(k))
            wrong.append(f"{what}: neither old nor new: {names}")
        if status == 0 and found != results["new"]:
            wrong.append(f"{what}: says that it went well")
        if kind == "clock set back" and (status != 0 or found != results["new"]):
            wrong.append(f"{what}: a clock is nothing to results: {said[-200:]}")
        if kind != "kill" and status not in (0, 1):
            wrong.append(f"{what}: {said[-200:]}")
        if kind != "kill" and status == 1 and "locfuse:" not in said:
            wrong.append(f"{what}: no sentence: {said[-200:]}")
        if kind != "kill" and status == 1 and "/" not in said:
            wrong.append(f"{what}: names no file: {said[-200:]}")
    if statuses[1] + statuses[-signal.SIGKILL] < count // len(KINDS) * (len(KINDS) - 1) // 2:
        wrong.append(f"{name}: faults have no effect, exit statuses {dict(statuses)}")
    print(f"{name}: {count} faults over {calls} calls, statuses {dict(statuses)}, "
          f"{len(wrong)} wrong", flush=True)  # fmt: skip
    return wrong


def comparable(files: dict[str, bytes]) -> dict[str, bytes]:
    """Leave out what two equal runs do not share: times in metrics, report and tables of sweeps."""
    names_only = ("metrics.json", "report.html", "summary.json", ".parquet")
    return {name: b"" if name.endswith(names_only) else data
            for name, data in files.items()}  # fmt: skip


def write_log_of(config: Path, folder: Path) -> None:
    """Write the simulated log of a configuration."""
    from locfuse.config.load import load_config
    from locfuse.io.log_folder import write_log
    from locfuse.run.run import load_log

    write_log(load_log(load_config(config), None, 0), folder)


def main() -> int:
    """Try each command; return 1 if one leaves something that is neither whole nor marked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("commands", nargs="*", default=[])
    chosen = parser.parse_args()
    if not hasattr(ctypes.CDLL(None), "faults_arm"):
        return preloaded(sys.argv[1:])
    for module in ("cli.app", "cli.run", "cli.convert", "cli.capsule", "cli.sweep", "report.plot",
                   "studio.workspace"):  # fmt: skip
        importlib.import_module(f"locfuse.{module}")  # once, for all that are forked

    wrong: list[str] = []
    for name in chosen.commands or COMMANDS:
        with tempfile.TemporaryDirectory() as folder:
            wrong += check(name, chosen.count, Path(folder))
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
