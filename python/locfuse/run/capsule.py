# SPDX-License-Identifier: Apache-2.0
"""A run in one file that replays bit for bit: configuration, log, version and result."""

from __future__ import annotations

import hashlib
import json
import platform
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from locfuse import NumericalError, __version__
from locfuse.config.load import load_config
from locfuse.config.safe_yaml import HALF_OF_A_PAIR
from locfuse.config.schema import RunConfig
from locfuse.core import compiler, kernels
from locfuse.io.csv_table import MAX_UNPACKED, refuse_device
from locfuse.io.log_folder import SCHEMA, read_log, write_log
from locfuse.io.log_yaml import load_yaml
from locfuse.io.result_tables import write_columns, write_estimate
from locfuse.io.whole import naming, whole_file
from locfuse.run.run import Progress, load_log, run
from locfuse.types import ConfigError, Log, LogError, shown, words

FORMAT = 1
ABOUT, CONFIG, ESTIMATE, OUTCOMES, ERROR = ("capsule.json", "config.yaml", "estimate.csv",
                                            "outcomes.csv", "error.txt")  # fmt: skip
LOG_FILES = (*(f"{stem}.csv" for stem in SCHEMA), "log.yaml", "map.yaml", "map.pgm")
FILES = (ABOUT, CONFIG, ESTIMATE, OUTCOMES, ERROR, *(f"log/{name}" for name in LOG_FILES))

# A capsule may come from a stranger: beyond these and MAX_UNPACKED it is not unpacked.
MAX_BYTES_OF_TEXT = 1 << 18  # of what is YAML or JSON
DEEPEST = 20  # of nested YAML
_BEGIN = (yaml.BlockMappingStartToken, yaml.BlockSequenceStartToken, yaml.FlowMappingStartToken,
          yaml.FlowSequenceStartToken)  # fmt: skip
_END = (yaml.BlockEndToken, yaml.FlowMappingEndToken, yaml.FlowSequenceEndToken)
_AS_OLD_AS_ZIP = (1980, 1, 1, 0, 0, 0)  # a date would be other bytes each time


@dataclass(frozen=True)
class Capsule:
    """The inputs of a run, to repeat it, and its results.

    Attributes
    ----------
    about : mapping
        ``format``, ``version``, ``machine`` and ``compiler`` that made it, ``result``: the SHA-256
        of the files of the result.
    config : RunConfig
        Effective, every default filled in; its log is the folder ``log`` of the capsule.
    log : Log
        As recorded, read, converted or simulated.
    result : mapping of file name to text
        ``estimate.csv`` and ``outcomes.csv``; of a run that failed ``error.txt``.
    """

    about: Mapping[str, Any]
    config: RunConfig
    log: Log
    result: Mapping[str, str]


@dataclass(frozen=True)
class Difference:
    """Where a file of the result is first another one.

    `line` counts from 1; `lines` is how many differ in all; `stamp_s` is empty for a line without
    one. `was` (in the capsule) and `found` (now) map columns that differ to their text; a line that
    is not in both, or has more columns in one of them, is one column ``line``.
    """

    file: str
    line: int
    lines: int
    stamp_s: str
    was: Mapping[str, str]
    found: Mapping[str, str]


def machine() -> str:
    """Return the properties of this machine that the last bits depend on: processor, libc."""
    return f"{platform.machine()} {kernels()}, {' '.join(platform.libc_ver())}"


def make_capsule(
    config: RunConfig,
    log: Log | None = None,
    *,
    base: Path | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
) -> Capsule:
    """Run, and keep the inputs and results.

    Parameters
    ----------
    config, log, base, seed, progress
        As `run` takes them.

    Returns
    -------
    Capsule
        Also of a run that fails: the error is then its result.

    Raises
    ------
    ConfigError, LogError
        If there is no log, or it cannot be read.

    Examples
    --------
    >>> from locfuse.config.load import parse_config
    >>> capsule = make_capsule(parse_config({"simulation": {"duration_s": 2}}))
    >>> replay_capsule(capsule)
    []
    """
    seed = config.seed if seed is None else seed
    log = load_log(config, base, seed) if log is None else log
    log = replace(log, map=None if log.grid is None else "map.yaml")
    ros = config.ros.model_copy(update={"world": None})
    own = {"log": "log", "simulation": None, "seed": seed, "ros": ros}
    config = config.model_copy(update=own)
    result = _result_of(config, log, progress)
    about = {
        "format": FORMAT,
        "version": __version__,
        "machine": machine(),
        "compiler": compiler(),
        "result": _hash_of(result),
    }
    return Capsule(about, config, log, result)


def replay_capsule(capsule: Capsule, progress: Progress | None = None) -> list[Difference]:
    """Repeat the run of a capsule and return where its results differ.

    Parameters
    ----------
    capsule : Capsule
    progress : callable, optional
        As `run` takes it.

    Returns
    -------
    list of Difference
        One for each file that differs; empty if estimates and outcomes, or the error, are the same
        bit for bit.
    """
    return differences(capsule.result, _result_of(capsule.config, capsule.log, progress))


def differences(was: Mapping[str, str], found: Mapping[str, str]) -> list[Difference]:
    """Return where each file of a result is first another one; empty if all are the same."""
    return [
        difference
        for file in dict.fromkeys([*was, *found])
        for difference in _first(file, was.get(file, ""), found.get(file, ""))
    ]


def write_capsule(capsule: Capsule, path: str | Path) -> None:
    """Write a capsule as a zip of plain files; the same capsule gives the same bytes.

    Raises
    ------
    LogError
        If `write_log` cannot write the log.
    """
    config = yaml.safe_dump(capsule.config.model_dump(mode="json"), sort_keys=False)
    about = json.dumps(dict(capsule.about), indent=1) + "\n"
    texts = {ABOUT: about, CONFIG: config, **capsule.result}
    with naming(Path(path)), tempfile.TemporaryDirectory() as folder:
        write_log(capsule.log, Path(folder) / "log")
        with whole_file(path) as part, zipfile.ZipFile(part, "w") as archive:
            for name in FILES:
                file = Path(folder, name)
                if name in texts or file.exists():
                    data = texts[name].encode() if name in texts else file.read_bytes()
                    info = zipfile.ZipInfo(name, _AS_OLD_AS_ZIP)
                    info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, 3
                    info.external_attr = 0o644 << 16
                    archive.writestr(info, data, compresslevel=9)


def read_capsule(path: str | Path) -> Capsule:
    """Read a capsule, whoever made it: only files that a capsule has are looked at.

    Raises
    ------
    LogError
        If it is not a capsule, is damaged, too large, of another format, or was changed by hand; or
        its log cannot be read.
    ConfigError
        If this version does not understand its configuration.
    """
    path = Path(path)
    with tempfile.TemporaryDirectory() as folder:
        unpacked = Path(folder)
        (unpacked / "log").mkdir()
        try:
            _unpack(path, unpacked)
            about = _about_in(unpacked)
            _check_yaml(unpacked)
            result = {
                name: (unpacked / name).read_bytes().decode()
                for name in (ESTIMATE, OUTCOMES, ERROR)
                if (unpacked / name).exists()
            }
            if _hash_of(result) != about["result"]:
                raise LogError("its result is not the one that it was made with")
            config, log = load_config(unpacked / CONFIG), read_log(unpacked / "log")
            named = {"log": config.log, "simulation": config.simulation, "world": config.ros.world}
            if named != {"log": "log", "simulation": None, "world": None}:
                raise LogError(f"{CONFIG} names {shown(named)}, expected only the log 'log'")
        except FileNotFoundError:
            raise LogError(f"{path}: no such file") from None
        except IsADirectoryError:
            raise LogError(f"{path}: is a folder; expected a capsule") from None
        except (ConfigError, LogError) as error:
            kind = ConfigError if isinstance(error, ConfigError) else LogError
            raise kind(f"{path}: {str(error).replace(f'{unpacked}/', '')}") from error
        except (OSError, EOFError, ValueError, RuntimeError, struct.error, zlib.error,
                zipfile.BadZipFile, yaml.YAMLError) as error:  # fmt: skip
            raise LogError(f"{path}: no capsule, or damaged ({words(error)})") from error
        return Capsule(about, config, log, result)


def _result_of(config: RunConfig, log: Log, progress: Progress | None) -> dict[str, str]:
    """Return the files of a run's result, by name."""
    try:
        result = run(config, log, progress=progress)
    except (ValueError, NumericalError) as error:
        return {ERROR: f"{type(error).__name__}: {error}\n"}
    with tempfile.TemporaryDirectory() as folder:
        estimate, outcomes = Path(folder, ESTIMATE), Path(folder, OUTCOMES)
        write_estimate(estimate, result.estimate)
        write_columns(outcomes, result.outcomes)
        return {path.name: path.read_text(encoding="utf-8") for path in (estimate, outcomes)}


def _hash_of(result: Mapping[str, str]) -> str:
    digest = hashlib.sha256()
    for name, text in result.items():
        digest.update(f"{name} {len(text.encode())}\n{text}".encode())
    return digest.hexdigest()


def _first(file: str, was: str, found: str) -> Iterator[Difference]:
    """Yield where two texts first differ, if they do."""
    before, now = was.splitlines(), found.splitlines()
    length = max(len(before), len(now))
    before += [""] * (length - len(before))
    now += [""] * (length - len(now))
    other = [i for i, (a, b) in enumerate(zip(before, now, strict=True)) if a != b]
    if not other:
        return
    row = other[0]
    names = before[0].split(",") if before[0] == now[0] and before[row] and now[row] else ["line"]
    a, b = (lines[row].split(",", len(names) - 1) for lines in (before, now))
    if len(a) != len(b):
        names, a, b = ["line"], [before[row]], [now[row]]
    columns = [i for i, (old, new) in enumerate(zip(a, b, strict=True)) if old != new]
    stamp_s = a[0] if names[0] == "stamp_s" else ""
    yield Difference(file, row + 1, len(other), stamp_s, {names[i]: a[i] for i in columns},
                     {names[i]: b[i] for i in columns})  # fmt: skip


def _unpack(path: Path, folder: Path) -> None:
    """Unpack the files of a capsule; nothing is written but what has a name of `FILES`."""
    refuse_device(path)
    left = MAX_UNPACKED
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        for info in archive.infolist():
            name = info.filename
            if name not in FILES or names.count(name) > 1:
                raise LogError(f"no capsule: it holds {name[:80]!r}" + " twice" * (name in FILES))
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise LogError(f"no capsule: {name!r} is not packed as one packs")
            is_short = name.endswith((".yaml", ".json", ".txt"))
            most = min(left, MAX_BYTES_OF_TEXT) if is_short else left
            if info.file_size > most:
                raise LogError(f"{name!r} has {info.file_size} bytes, expected at most {most}")
            data = archive.read(info)  # never more than the size it says
            left -= len(data)
            (folder / name).write_bytes(data)


def _about_in(folder: Path) -> dict[str, Any]:
    """Return the checked metadata of a capsule."""
    for name in (ABOUT, CONFIG):
        if not (folder / name).exists():
            raise LogError(f"no capsule: it has no {name}")
    about = json.loads((folder / ABOUT).read_bytes())
    made = about.get("format") if isinstance(about, dict) else about
    if made != FORMAT:
        raise LogError(f"{ABOUT} says format {made!r}, expected {FORMAT}")
    for key in ("version", "machine", "compiler", "result"):
        if not isinstance(about.get(key), str):
            raise LogError(f"{ABOUT} has no {key}")
        if HALF_OF_A_PAIR.search(about[key]):
            raise LogError(f"{ABOUT}: {key} has half of a surrogate pair, which is not a character")
    return dict(about)


def _check_yaml(folder: Path) -> None:
    """Refuse YAML that grows when read, and a map that is not that of the capsule."""
    for path in (folder / CONFIG, *sorted(folder.glob("log/*.yaml"))):
        depth = 0
        for token in yaml.scan(path.read_bytes()):
            depth += isinstance(token, _BEGIN) - isinstance(token, _END)
            if isinstance(token, yaml.AliasToken) or depth > DEEPEST:
                raise LogError(f"{path.name} has aliases or is too deep, as no capsule is")
    for file, key, expected in (("log.yaml", "map", "map.yaml"), ("map.yaml", "image", "map.pgm")):
        path = folder / "log" / file
        named = load_yaml(path) if path.exists() else None
        if isinstance(named, dict) and named.get(key, expected) != expected:
            raise LogError(f"{file} names {key} {named[key]!r}, expected {expected!r}")
