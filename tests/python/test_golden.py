# SPDX-License-Identifier: Apache-2.0
"""Golden runs: what was recorded comes out again, bit for bit, on any number of threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from locfuse.config.load import load_config
from locfuse.config.scenario import Fault
from locfuse.config.schema import SOURCES, RunConfig
from locfuse.run.capsule import (
    Capsule,
    differences,
    machine,
    make_capsule,
    read_capsule,
    replay_capsule,
)
from support_runs import ROOT

GOLDEN = ROOT / "tests" / "golden"
RUNS = sorted(GOLDEN.glob("*.zip"))
CONFIGS = sorted(GOLDEN.glob("*.yaml"))


def on_threads(capsule: Capsule, threads: int) -> Capsule:
    """Return the capsule with as many workers for particles; other estimators have none."""
    mcl = capsule.config.mcl
    if mcl is None:
        return capsule
    mcl = mcl.model_copy(update={"threads": threads})
    return replace(capsule, config=capsule.config.model_copy(update={"mcl": mcl}))


def golden(path: Path) -> Capsule:
    capsule = read_capsule(path)
    if capsule.about["machine"] != machine():
        pytest.skip(
            f"recorded on {capsule.about['machine']}, this is {machine()}: last bits differ"
        )
    return capsule


@pytest.mark.parametrize("threads", [1, 2, 4])
@pytest.mark.parametrize("path", RUNS, ids=lambda path: path.stem)
def test_it_comes_out_again_bit_for_bit(path: Path, threads: int) -> None:
    """As many at once, too: no run sees another."""
    capsule = on_threads(golden(path), threads)
    with ThreadPoolExecutor(threads) as pool:
        for found in pool.map(replay_capsule, [capsule] * threads):
            assert found == [], "meant? ./dev golden records it anew, see CONTRIBUTING.md"


def test_each_has_its_configuration_and_each_ran() -> None:
    assert [path.stem for path in RUNS] == [path.stem for path in CONFIGS]
    assert len(RUNS) >= 10
    assert not [path.stem for path in RUNS if "error.txt" in read_capsule(path).result]
    assert sum(path.stat().st_size for path in RUNS) < 600_000


def test_together_they_cover_what_runs_can_do() -> None:
    configs = [load_config(path) for path in CONFIGS]
    text = "".join(read_capsule(path).result["outcomes.csv"] for path in RUNS)
    for source in (*SOURCES, "scans", "switch"):
        assert f",{source}," in text, source
    for verdict in ("fused", "gated", "ignored", "not_modelled", "stale"):
        assert f",{verdict}," in text, verdict
    used = {fault.kind for c in configs if c.simulation for fault in c.simulation.faults}
    assert used == {kind.model_fields["kind"].default for kind in get_args(get_args(Fault)[0])}
    assert {c.mcl.likelihood for c in configs if c.mcl} >= {"field", "beams"}
    learnt = [c.estimator.calibration.model_dump() for c in configs]
    never = {name for name in learnt[0] if not any(one[name] > 0.0 for one in learnt)}
    assert never == set()
    assert any(c.cylinders for c in configs)
    assert any(c.mcl and c.mcl.poses_hz for c in configs)
    assert any(c.mcl and c.mcl.switch for c in configs)
    assert {c.mcl is None for c in configs if c.start == "auto"} == {True, False}


def changed(config: RunConfig) -> RunConfig:
    """Return the configuration with a gate that is a little narrower."""
    ranges = config.estimator.range.model_copy(update={"gate": 0.98})
    estimator = config.estimator.model_copy(update={"range": ranges})
    return config.model_copy(update={"estimator": estimator})


def test_a_filter_that_does_something_else_is_noticed() -> None:
    capsule = read_capsule(GOLDEN / "nlos.zip")
    assert replay_capsule(replace(capsule, config=changed(capsule.config))) != []


def test_a_last_bit_of_a_covariance_is_noticed() -> None:
    capsule = read_capsule(GOLDEN / "room.zip")
    text = capsule.result["estimate.csv"]
    *head, last = text.rstrip("\n").split(",")
    other = ",".join([*head, repr(float(np.nextafter(float(last), 1.0)))]) + "\n"
    (found,) = differences(capsule.result, {**capsule.result, "estimate.csv": other})
    assert (found.lines, list(found.was)) == (1, ["cov_heading_heading"])


def test_recording_again_gives_the_same_file_but_for_who_made_it() -> None:
    capsule = golden(GOLDEN / "room.zip")
    again = make_capsule(load_config(GOLDEN / "room.yaml"), capsule.log)
    assert again.result == capsule.result
