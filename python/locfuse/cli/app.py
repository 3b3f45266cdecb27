# SPDX-License-Identifier: Apache-2.0
"""The command line: a table of its commands, each loaded when it is called."""

from __future__ import annotations

import importlib
import logging
import os
import signal
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from locfuse import NumericalError, __version__

# Module of this folder, and the first line of its help.
COMMANDS = {
    "demo": "Simulate a robot, localize it, and open its report.",
    "run": "Localize along a log or a simulated drive and write a report.",
    "check": "Report problems of a configuration and its log before a run.",
    "capsule": "Run, and pack all it takes to repeat the run into one file.",
    "replay": "Run a capsule again and compare the results bit for bit.",
    "convert": "Convert between bags, log folders and published recordings.",
    "evaluate": "Compare two trajectories: position error at matching stamps.",
    "commission": "Set up a robot by one drive: map, anchors, noise, configuration.",
    "map": "Make a map of a drive with a laser.",
    "survey": "Find where anchors and landmarks are, by a drive among them.",
    "tune": "Find noise, latencies and scales by recordings.",
    "position": "Locate tags from ranges alone, each epoch by itself.",
    "reproduce": "Run a paper's experiments and compare them with its claims.",
    "sweep": "Run a configuration many times with other seeds and values.",
    "studio": "Draw a world in the browser and run estimators in it.",
    "config": "Inspect configurations.",
}


def load(name: str) -> Any:
    """Import the module of a command, a function of its name or an `app`; return the command."""
    module = importlib.import_module(f"locfuse.cli.{name}")
    command = getattr(module, "app", None)
    if command is None:
        command = typer.Typer(add_completion=False)
        command.command()(getattr(module, name))
    return typer.main.get_command(command)


class LazyGroup(TyperGroup):
    """The commands of the table; the help and the completion of their names import none."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for name, line in COMMANDS.items():
            self.add_command(TyperCommand(name, help=line))

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        name, command, rest = super().resolve_command(ctx, args)
        return name, load(name) if name else command, rest


# Without markup, as Typer's rich help loads longer than all of locfuse; commands have theirs.
app = typer.Typer(cls=LazyGroup, no_args_is_help=True, pretty_exceptions_enable=False,
                  rich_markup_mode=None, help="Localization for mobile robots.")  # fmt: skip


class _Notes(logging.Formatter):
    """Writes what is logged on one line."""

    def format(self, record: logging.LogRecord) -> str:
        from locfuse.cli.terminal import visible  # loads rich, which help does without

        return visible(" ".join(super().format(record).split()))


def main() -> None:
    """Run the command line; errors become one sentence and exit status 1.

    On SIGTERM it ends as after an error, so that no temporary file stays.
    """
    notes = logging.StreamHandler(sys.stderr)
    notes.setFormatter(_Notes("locfuse: %(message)s"))
    logging.getLogger("locfuse").addHandler(notes)
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    try:
        app(prog_name="locfuse")
    except (ValueError, NumericalError, OSError, MemoryError) as error:
        from locfuse.cli.terminal import visible

        said = " ".join(_text_of(error).split())
        print("locfuse:", visible(said) or "out of memory", file=sys.stderr)
        sys.exit(1)
    finally:
        signal.signal(signal.SIGTERM, before)
        logging.getLogger("locfuse").removeHandler(notes)


def _text_of(error: BaseException) -> str:
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{os.fsdecode(error.filename)}: {error.strerror}"
    return str(error)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"locfuse {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass
