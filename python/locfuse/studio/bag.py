# SPDX-License-Identifier: Apache-2.0
"""The bag of a run of the studio, made by a process of its own."""

from __future__ import annotations

import os
from multiprocessing.connection import Connection
from pathlib import Path

from locfuse.config.load import load_config
from locfuse.io.rosbag.bags import write_bag
from locfuse.run.run import run
from locfuse.studio.work import CONFIG


def write_bag_of(folder: str, name: str, said: Connection) -> None:
    """Run the configuration of a folder and write a bag there; send what went wrong, or ''."""
    part = Path(folder, f".part-{name}")  # its ending says of which kind it is
    try:
        config = load_config(Path(folder, CONFIG))
        write_bag(run(config, base=Path(folder)), part, config.ros)
        os.replace(part, Path(folder, name))
        said.send("")
    except Exception as error:  # reported to the caller
        part.unlink(missing_ok=True)
        said.send(" ".join(str(error).split()) or type(error).__name__)
