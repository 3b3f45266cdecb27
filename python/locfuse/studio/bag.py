# SPDX-License-Identifier: Apache-2.0
"""The bag of a run of the studio, made by a process of its own."""

from __future__ import annotations

from multiprocessing.connection import Connection
from pathlib import Path

from locfuse.config.load import load_config
from locfuse.io.rosbag.bags import write_bag
from locfuse.io.whole import whole_file
from locfuse.run.run import run
from locfuse.studio.work import CONFIG


def write_bag_of(folder: str, name: str, said: Connection) -> None:
    """Run the configuration of a folder and write a bag there; send what went wrong, or ''."""
    try:
        config = load_config(Path(folder, CONFIG))
        with whole_file(Path(folder, name)) as part:
            write_bag(run(config, base=Path(folder)), part, config.ros)
        said.send("")
    except Exception as error:  # reported to the caller
        said.send(" ".join(str(error).split()) or type(error).__name__)
