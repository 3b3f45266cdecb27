# SPDX-License-Identifier: Apache-2.0
"""What was found of a robot, and the folder that it is written to."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from locfuse.check.finding import Finding
from locfuse.check.proposal import Line, written
from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import write_world
from locfuse.io.whole import write_whole
from locfuse.run.mapping import MapResult
from locfuse.run.survey_result import SurveyResult
from locfuse.tune.result import TuneResult
from locfuse.types import ConfigError, Log, RunResult

CONFIGURATION = "robot.yaml"
WORLD = "world"
TUNED = "tuned"  # where a value comes from


@dataclass(frozen=True)
class Commissioned:
    """A robot that is set up.

    Attributes
    ----------
    lines : tuple of (key, value, where it comes from)
        Of the configuration.
    config : RunConfig
        The same, parsed; its ``ros.world`` is the folder that `write_commissioned` makes.
    world : Log
        Map, anchors, landmarks and places of tags, without messages.
    checks : tuple of Finding
        What ``check`` says of the recording, with all that was found.
    map : MapResult or None
    survey : SurveyResult or None
    tuned : TuneResult or None
    drive : RunResult or None
        The recording, driven with the configuration.
    missing : tuple of str
        Parts that could not be made, and why, a sentence each.
    advice : tuple of str
        What another drive would improve, a sentence each.
    """

    lines: tuple[Line, ...]
    config: RunConfig
    world: Log
    checks: tuple[Finding, ...] = ()
    map: MapResult | None = None
    survey: SurveyResult | None = None
    tuned: TuneResult | None = None
    drive: RunResult | None = None
    missing: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()

    @property
    def is_tuned(self) -> bool:
        """Whether what was tuned is part of the configuration."""
        return any(why.startswith(TUNED) for _, _, why in self.lines)

    @property
    def yaml(self) -> str:
        """The configuration, a comment beside each value."""
        return "".join(written(self.lines))


def write_commissioned(result: Commissioned, folder: Path) -> list[Path]:
    """Write ``robot.yaml`` and the folder ``world`` that it names; returns the files.

    Raises ConfigError as `check_new`.
    """
    check_new(folder)
    folder.mkdir(parents=True, exist_ok=True)
    world = folder / WORLD
    if says_anything(result.world):
        write_world(result.world, world)
    write_whole(folder / CONFIGURATION, result.yaml)
    return [folder / CONFIGURATION, *sorted(world.glob("*"))]


def check_new(folder: Path) -> None:
    """Raise ConfigError where a robot was set up before."""
    for path in (folder / name for name in (CONFIGURATION, WORLD, "drive", "report.html")):
        if path.exists():
            raise ConfigError(f"{path}: is there already; name another folder with --out")


def says_anything(world: Log) -> bool:
    """Return whether there is a map, an anchor, a landmark or a tag."""
    return bool(world.tables or world.tags) or world.grid is not None
