# SPDX-License-Identifier: Apache-2.0
"""Range-only positioning at recorded sites, of tags at rest at surveyed places."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from locfuse import _core
from locfuse.io.datasets import convert
from locfuse.io.log_folder import read_log
from locfuse.run.messages import truth_of
from locfuse.types import FloatArray, Log, LogError
from papers.claims import Claim, absent, claim_of
from papers.ekim2020.simulated import SIGMA_M


def _logs(configs: Path, dataset: str, folder: str) -> Iterator[Log]:
    source = (configs / "../../../shared/data" / folder).resolve()
    with tempfile.TemporaryDirectory() as out:
        for log in convert(dataset, source, Path(out) / "log"):
            yield read_log(log)


def epochs(log: Log, tag: str) -> tuple[FloatArray, FloatArray, float]:
    """Return anchors (m, 3), ranges (epochs, m) with NaN where one is missing, and tag height."""
    table, anchors = log["ranges"], log["anchors"]
    names = {str(name): column for column, name in enumerate(anchors["anchor"])}
    rows = table["tag"] == tag
    _, epoch = np.unique(table["stamp_ns"][rows], return_inverse=True)
    ranges = np.full((int(epoch.max()) + 1, len(names)), np.nan)
    columns = [names[str(name)] for name in table["anchor"][rows]]
    ranges[epoch, columns] = table["range_m"][rows]
    at = np.column_stack([anchors["x_m"], anchors["y_m"], anchors["z_m"]]).astype(float)
    return at, ranges, float(log.tags[tag][2])


def site_claims(configs: Path) -> Iterator[Claim]:
    """Tags at rest at surveyed places: median of the planar error over all epochs."""
    try:
        logs = list(_logs(configs, "ghent", "ghent-iiot"))
    except LogError as error:
        yield absent("start_ghent", "Ghent hall, NLOS: 2D median", str(error))
    else:
        for loss, required in (("none", None), ("one_sided", 0.11)):
            errors = np.concatenate([_planar_errors(log, tag, loss) for log in logs
                                     for tag in log.tags])  # fmt: skip
            yield _median(f"start_ghent_{loss}", f"Ghent hall, loss {loss}: 2D error", errors,
                          required)  # fmt: skip
    try:
        converted = _logs(configs, "lias", "lias-planar")
        logs = [log for log in converted if np.ptp(log["truth"]["x_m"]) == 0.0]  # at rest
    except LogError as error:
        yield absent("start_lias", "LIAS poses at rest: 2D median", str(error))
        return
    raw, corrected, bodies = [], [], []
    for at, log in enumerate(logs):
        bodies.append(_body_errors(log))
        others = [other for k, other in enumerate(logs) if k != at and _same_room(other, log)]
        for tag in log.tags:
            raw.append(_planar_errors(log, tag, "none"))
            offsets = np.nanmedian(np.vstack([_residuals(other, tag) for other in others]), axis=0)
            corrected.append(_planar_errors(log, tag, "none", offsets))
    yield _median("start_lias_raw", "LIAS poses at rest, raw: 2D error of a pose",
                  np.concatenate(bodies), 0.14, "middle of the three tags")  # fmt: skip
    yield _median("start_lias_tag", "the same, of a single tag", np.concatenate(raw), None)
    yield _median("start_lias_offset", "LIAS, one offset per link: 2D error",
                  np.concatenate(corrected), 0.08, "offsets from the other poses")  # fmt: skip


def _median(
    id: str, claim: str, errors: FloatArray, required: float | None, note: str = ""
) -> Claim:
    limit = np.inf if required is None else required
    text = "-" if required is None else f"<= {required:g}"
    return claim_of(id, claim, "m", None, errors, text, lambda v: v <= limit, note)


def _tag_place(log: Log, tag: str) -> FloatArray:
    """Return where a tag at rest is in truth: x, y, z in world."""
    truth = truth_of(log)
    assert truth is not None
    heading = 0.0 if truth.heading is None else float(truth.heading[0])
    forward, left, up = log.tags[tag]
    x, y = truth.position[0]
    c, s = np.cos(heading), np.sin(heading)
    return np.array([x + c * forward - s * left, y + s * forward + c * left, up])


def _planar_errors(log: Log, tag: str, loss: str, offsets: FloatArray | float = 0.0) -> FloatArray:
    anchors, ranges, height = epochs(log, tag)
    found = _core.locate_batch(anchors, ranges - offsets, SIGMA_M, height=height, loss=loss)
    placed = np.isfinite(found.position[:, 0])  # the last epochs of a site have few ranges
    errors: FloatArray = np.linalg.norm(found.position[placed] - _tag_place(log, tag)[:2], axis=1)
    return errors


def _body_errors(log: Log) -> FloatArray:
    """Return errors of the middle of the tags, each positioned alone."""
    found, true = [], []
    for tag in log.tags:
        anchors, ranges, height = epochs(log, tag)
        found.append(_core.locate_batch(anchors, ranges, SIGMA_M, height=height).position)
        true.append(_tag_place(log, tag)[:2])
    rows = min(map(len, found))
    middle = np.mean([positions[:rows] for positions in found], axis=0)
    errors: FloatArray = np.linalg.norm(middle - np.mean(true, axis=0), axis=1)
    return errors[np.isfinite(errors)]


def _residuals(log: Log, tag: str) -> FloatArray:
    anchors, ranges, _ = epochs(log, tag)
    distance = np.linalg.norm(anchors - _tag_place(log, tag), axis=1)
    residuals: FloatArray = ranges - distance
    return residuals


def _same_room(a: Log, b: Log) -> bool:
    return all(np.array_equal(a["anchors"][key], b["anchors"][key]) for key in a["anchors"])
