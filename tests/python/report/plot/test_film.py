# SPDX-License-Identifier: Apache-2.0
"""The film of a localization: it shows what the run did, and shows it small."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from locfuse.config.load import parse_config
from locfuse.report.plot.film import record, write_film
from locfuse.run.run import run
from locfuse.types import ConfigError, RunResult
from support_results import make_result

FLOOR = {
    "room_m": [8, 6],
    "map": {"generate": "rooms", "seed": 2},
    "path": {"shape": "roam", "speed_mps": 0.5},
    "duration_s": 8.0,
    "laser": {"range_max_m": 8.0, "rate_hz": 2},
    "ranges": None,
    "poses": None,
}
CONFIG = parse_config({"simulation": FLOOR, "mcl": {"max_particles": 2000}})


@pytest.fixture(scope="module")
def result() -> RunResult:
    return run(CONFIG, seed=4)


def test_frames_are_those_of_the_run(result: RunResult) -> None:
    frames = record(CONFIG.model_copy(update={"seed": 4}), result)
    count = len(frames)
    assert 12 <= count < len(result.estimate)  # two a second, for six seconds
    assert [frame.stamp_ns for frame in frames] == result.estimate.stamp_ns[:count].tolist()
    poses = np.array([frame.pose for frame in frames])
    assert poses[:, :2].tobytes() == result.estimate.position[:count].tobytes()
    assert any(frame.ready for frame in frames)
    for frame in frames:
        assert frame.particles.shape[1] == 4
        assert 0 < len(frame.particles) <= 2000


def test_a_film_is_an_animation_of_little_size(result: RunResult, tmp_path: Path) -> None:
    path = write_film(result, tmp_path / "films" / "film.gif")
    assert path.stat().st_size < 1_000_000
    with Image.open(path) as film:
        assert film.format == "GIF"
        assert film.n_frames > 10  # type: ignore[attr-defined]
        first = np.asarray(film.convert("RGB"))
        film.seek(8)
        later = np.asarray(film.convert("RGB"))
    assert 0.0 < np.mean(np.any(first != later, axis=-1)) < 0.2


def test_a_run_without_particles_has_no_film(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="mcl"):
        write_film(make_result(config={}), tmp_path / "film.gif")
