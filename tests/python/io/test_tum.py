# SPDX-License-Identifier: Apache-2.0
"""TUM files: exact round trip, projection to the plane, and files that are refused by line."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import numpy as np
import pytest

from locfuse.io.tum import read_tum, write_tum
from locfuse.types import LogError, Trajectory


def path_of(folder: Path, text: str) -> Path:
    path = folder / "path.tum"
    path.write_text(text)
    return path


def test_stamps_and_positions_survive_bit_for_bit_and_headings_to_the_last_digits(
    tmp_path: Path,
) -> None:
    rng = np.random.default_rng(4)
    stamp = 1_700_000_000_000_000_000 + np.cumsum(rng.integers(1, 10**9, 500))
    position, heading = rng.normal(0.0, 100.0, (500, 2)), rng.uniform(-np.pi, np.pi, 500)
    write_tum(tmp_path / "path.tum", Trajectory(stamp, position, heading))

    found = read_tum(tmp_path / "path.tum")

    np.testing.assert_array_equal(found.stamp_ns, stamp)
    np.testing.assert_array_equal(found.position, position)
    assert found.heading is not None
    np.testing.assert_allclose(found.heading, heading, rtol=0.0, atol=1e-15)


def test_a_line_is_stamp_position_and_quaternion(tmp_path: Path) -> None:
    track = Trajectory(np.array([1_500_000_000]), np.array([[1.0, -2.5]]), np.array([math.pi / 2]))
    write_tum(tmp_path / "path.tum", track)
    fields = (tmp_path / "path.tum").read_text().split()
    assert fields[:7] == ["1.500000000", "1.0", "-2.5", "0", "0", "0", fields[6]]
    assert float(fields[6]) == pytest.approx(math.sin(math.pi / 4), abs=1e-15)
    assert float(fields[7]) == pytest.approx(math.cos(math.pi / 4), abs=1e-15)


def test_without_headings_the_quaternion_is_the_identity(tmp_path: Path) -> None:
    write_tum(tmp_path / "path.tum", Trajectory(np.array([0]), np.array([[1.0, 2.0]])))
    assert (tmp_path / "path.tum").read_text().split()[4:] == ["0", "0", "0.0", "1.0"]


def test_a_heading_of_half_a_turn_is_the_negative_one(tmp_path: Path) -> None:
    heading = read_tum(path_of(tmp_path, "0 0 0 0 0 0 1 0\n")).heading
    assert heading is not None
    assert heading.tolist() == [-math.pi]


def test_poses_in_space_are_projected_to_their_yaw(tmp_path: Path) -> None:
    yaw, pitch = 0.7, 0.3  # R = Rz(yaw) Ry(pitch)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    quaternion = f"{-sy * sp!r} {cy * sp!r} {sy * cp!r} {cy * cp!r}"
    track = read_tum(path_of(tmp_path, f"# note\n\n0.25 1 2 3 {quaternion}\n"))
    assert track.heading is not None
    assert track.heading[0] == pytest.approx(yaw, abs=1e-14)
    np.testing.assert_array_equal(track.position, [[1.0, 2.0]])


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("", "no pose"),
        ("# only a note\n", "no pose"),
        ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 1\n", "line 2"),
        ("0 0 0 0 0 0 0 1\n1 0 nan 0 0 0 0 1\n", "line 2"),
        ("1 0 0 0 0 0 0 1\n\n0 0 0 0 0 0 0 1\n", "line 3: stamp 0.000000000 does not come after"),
        ("1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", "line 2"),
        ("0 0 0 0 0 0 0 0\n", "line 1: quaternion of norm 0"),
        ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 1 1\n", "line 2: quaternion of norm 1.41421"),
    ],
)
def test_a_file_that_is_no_trajectory_is_refused_by_line(
    tmp_path: Path, text: str, where: str
) -> None:
    with pytest.raises(LogError, match=r"path\.tum") as caught:
        read_tum(path_of(tmp_path, text))
    assert where in str(caught.value)


def test_of_poses_with_one_stamp_the_first_counts(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = "".join(f"{stamp} {x} 0 0 0 0 0 1\n" for stamp, x in ((1, 0), (2, 1), (2, 5), (3, 2)))
    with caplog.at_level(logging.WARNING):
        track = read_tum(path_of(tmp_path, text))
    assert track.position[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert "1 poses have the stamp of the one before" in caplog.text


def test_a_pose_that_is_not_finite_is_not_written(tmp_path: Path) -> None:
    for position, heading in (([math.nan, 0.0], 0.0), ([0.0, math.inf], 0.0), ([0, 0], math.nan)):
        track = Trajectory(np.array([0]), np.array([position], dtype=float), np.array([heading]))
        with pytest.raises(ValueError, match="pose 0"):
            write_tum(tmp_path / "path.tum", track)
    assert not (tmp_path / "path.tum").exists()
