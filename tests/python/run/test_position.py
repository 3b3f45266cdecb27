# SPDX-License-Identifier: Apache-2.0
"""Positions from a file of ranges: epochs are what was measured together, and nothing is hidden."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.io.log_folder import read_log
from locfuse.run.messages import truth_of
from locfuse.run.position import Epochs, Fix, in_one_plane, positions, read_epochs, write_fixes
from locfuse.types import ConfigError, FloatArray, LogError
from papers.datasets import convert
from support_runs import Said, locfuse, recording, rows_of

# Distances from (3, 4): 3-4-5 and its like, all at the height of the tag.
PLANE = "anchor,x_m,y_m,z_m\nA,0,0,1\nB,6,0,1\nC,3,0,1\nD,0,4,1\n"
MEASURED = "stamp_s,tag,anchor,range_m\n0,t,A,5\n0,t,B,5\n0,t,C,4\n0,t,D,3\n"
# Not in one plane; the tag is at (2, 3, 6).
SPACE = "anchor,x_m,y_m,z_m\nA,0,0,0\nB,2,3,0\nC,2,0,6\nD,0,3,6\nE,9,3,6\n"
MEASURED_IN_SPACE = (
    "stamp_s,tag,anchor,range_m\n0,t,A,7\n0,t,B,6\n0,t,C,3\n0,t,D,2\n0,t,E,7\n"
)  # fmt: skip


def files(folder: Path, ranges: str = MEASURED, anchors: str = PLANE) -> tuple[Path, Path]:
    (folder / "anchors.csv").write_text(anchors)
    (folder / "ranges.csv").write_text(ranges)
    return folder / "anchors.csv", folder / "ranges.csv"


def ranges_at(*rows: tuple[float, str, str]) -> str:
    lines = [f"{stamp},{tag},{anchor},5\n" for stamp, tag, anchor in rows]
    return "".join(["stamp_s,tag,anchor,range_m\n", *lines])


def anchors_of(epochs: Epochs) -> list[tuple[float, str, str]]:
    """Return stamp, tag and the measured anchors of each epoch."""
    return [
        (stamp / 1e9, str(tag), "".join(np.array(epochs.names)[~np.isnan(ranges)]))
        for stamp, tag, ranges in zip(epochs.stamp_ns, epochs.tag, epochs.ranges, strict=True)
    ]


# Epochs --------------------------------------------------------------------------------------


def test_ranges_of_one_stamp_and_tag_are_an_epoch(tmp_path: Path) -> None:
    ranges = ranges_at((1, "t", "A"), (1, "u", "A"), (1, "t", "C"), (2, "t", "B"), (1, "u", "D"))
    epochs = read_epochs(*files(tmp_path, ranges))
    assert anchors_of(epochs) == [(1.0, "t", "AC"), (1.0, "u", "AD"), (2.0, "t", "B")]


def test_an_epoch_takes_what_follows_within_its_length(tmp_path: Path) -> None:
    ranges = ranges_at((0.0, "t", "A"), (0.02, "t", "B"), (0.05, "t", "C"), (0.051, "t", "D"))
    epochs = read_epochs(*files(tmp_path, ranges), epoch_s=0.05)
    assert anchors_of(epochs) == [(0.0, "t", "ABC"), (0.051, "t", "D")]


def test_an_anchor_that_is_measured_again_begins_another_epoch(tmp_path: Path) -> None:
    ranges = ranges_at((0, "t", "A"), (0.1, "t", "B"), (0.2, "u", "A"), (0.3, "t", "A"))
    epochs = read_epochs(*files(tmp_path, ranges), epoch_s=1.0)
    assert anchors_of(epochs) == [(0.0, "t", "AB"), (0.2, "u", "A"), (0.3, "t", "A")]


def test_ranges_are_grouped_by_stamp_whenever_they_arrived(tmp_path: Path) -> None:
    ranges = (
        "stamp_s,tag,anchor,range_m,arrival_s\n1,t,A,5,1.1\n2,t,A,5,2.1\n1,t,B,5,2.2\n2,t,C,5,2.3\n"
    )
    epochs = read_epochs(*files(tmp_path, ranges))
    assert anchors_of(epochs) == [(1.0, "t", "AB"), (2.0, "t", "AC")]


def test_a_sigma_of_the_file_goes_before_that_of_the_caller(tmp_path: Path) -> None:
    stated = "stamp_s,tag,anchor,range_m,sigma_m\n0,t,A,5,0.3\n0,t,C,5,0.2\n"
    np.testing.assert_array_equal(
        read_epochs(*files(tmp_path, stated), sigma_m=0.7).sigma, [[0.3, np.nan, 0.2, np.nan]]
    )
    assert (read_epochs(*files(tmp_path), sigma_m=0.7).sigma == 0.7).all()


def test_a_file_without_a_range_has_no_epoch(tmp_path: Path) -> None:
    epochs = read_epochs(*files(tmp_path, ranges_at()))
    assert len(epochs) == 0
    assert positions(epochs, height=1.0) == []


REFUSED: dict[str, tuple[str, str]] = {
    "zero": (
        MEASURED.replace("C,4", "C,0"),
        r"the range to anchor C at 0\.0+ s is 0, expected > 0",
    ),
    "negative": (MEASURED.replace("C,4", "C,-4"), "line 4: a range is negative"),
    "nan": (MEASURED.replace("C,4", "C,nan"), "line 4: column 4"),
    "twice": (MEASURED.replace("C,4", "B,5"), r"tag t has two ranges to anchor B at 0\.0+ s"),
    "unknown anchor": (
        MEASURED.replace("C,4", "AA,4"),
        "anchor 'AA' has no place; did you mean 'A'",
    ),
    "column": (MEASURED.replace("range_m", "range"), "unknown column 'range'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_ranges_that_cannot_be_used_are_named(case: str, tmp_path: Path) -> None:
    text, expected = REFUSED[case]
    with pytest.raises(LogError, match=expected) as caught:
        read_epochs(*files(tmp_path, text))
    assert "ranges.csv" in str(caught.value)


def test_anchors_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"anchors\.csv, line 3: anchor is listed twice: A"):
        read_epochs(*files(tmp_path, anchors=PLANE.replace("\nB", "\nA")))
    with pytest.raises(LogError, match="no such file"):
        read_epochs(tmp_path / "absent.csv", tmp_path / "ranges.csv")


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"sigma_m": 0.0}, "sigma is 0.0, expected > 0"),
        ({"sigma_m": float("nan")}, "sigma is nan"),
        ({"epoch_s": -1.0}, "epoch is -1.0, expected"),
    ],
)
def test_options_of_reading_are_checked(
    options: dict[str, Any], expected: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=expected):
        read_epochs(*files(tmp_path), **options)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"solver": "slrs"}, "solver is 'slrs'; did you mean 'srls'"),
        ({"loss": "hubert"}, "loss is 'hubert'; did you mean 'huber'"),
        ({"height": float("inf")}, "height is inf, expected a finite number"),
    ],
)
def test_options_of_positions_are_checked(
    options: dict[str, Any], expected: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=expected):
        positions(read_epochs(*files(tmp_path)), **options)


def test_a_plane_is_seen_wherever_it_lies(tmp_path: Path) -> None:
    assert in_one_plane(read_epochs(*files(tmp_path)))
    assert not in_one_plane(read_epochs(*files(tmp_path, MEASURED_IN_SPACE, SPACE)))
    slanted = "anchor,x_m,y_m,z_m\nA,0,0,0\nB,1,0,1\nC,0,1,1\nD,1,1,2\n"
    assert in_one_plane(read_epochs(*files(tmp_path, anchors=slanted)))
    three = "anchor,x_m,y_m,z_m\nA,0,0,0\nB,1,0,1\nC,0,1,4\n"
    assert in_one_plane(read_epochs(*files(tmp_path, ranges_at((0, "t", "A")), three)))


# The file ------------------------------------------------------------------------------------


def fix(**changes: Any) -> Fix:
    values: dict[str, Any] = {
        "stamp_ns": 1_500_000_000,
        "tag": "t",
        "status": "ambiguous",
        "reason": 'two, or "more", fit',
        "position": np.array([[1.0, 2.0], [3.0, 4.0]]),
        "covariance": np.array([[[0.01, 0.002], [0.002, 0.04]], np.eye(2)]),
        "cost": np.array([1.25, 2.5]),
        "agree": True,
        "difference": 0.5,
        "residual": np.array([[0.3, np.nan, -0.4], [1.0, np.nan, 1.0]]),
        "culprit": "",
        "culprit_test": float("nan"),
    }
    return Fix(**{**values, **changes})


NOTHING = {
    "status": "underdetermined",
    "position": np.zeros((0, 2)),
    "covariance": np.zeros((0, 2, 2)),
    "cost": np.zeros(0),
    "residual": np.zeros((0, 3)),
    "agree": None,
    "difference": float("nan"),
}


def test_every_position_that_fits_has_a_row(tmp_path: Path) -> None:
    write_fixes([fix(ml_distance=0.25), fix(**NOTHING)], ["A", "B", "C"], tmp_path / "out.csv")

    first, second, third = rows_of(tmp_path / "out.csv")
    assert first == {
        "stamp_s": "1.500000000", "tag": "t", "status": "ambiguous",
        "reason": "two; or 'more'; fit", "agree": "yes", "difference": "0.5", "culprit": "",
        "culprit_test": "", "explained": "", "ml_distance_m": "0.25", "ml_sigmas": "",
        "hypothesis": "1", "hypotheses": "2", "cost": "1.25",
        "residual_rms_m": repr(float(np.sqrt(0.125))), "x_m": "1.0", "y_m": "2.0",
        "cov_x_x": "0.01", "cov_x_y": "0.002", "cov_y_y": "0.04",
        "residual_A_m": "0.3", "residual_B_m": "", "residual_C_m": "-0.4",
    }  # fmt: skip
    assert (second["hypothesis"], second["x_m"], second["residual_rms_m"]) == ("2", "3.0", "1.0")
    assert (third["status"], third["hypotheses"], third["agree"]) == ("underdetermined", "0", "")
    assert {third[key] for key in ("x_m", "cov_x_x", "cost", "residual_A_m")} == {""}


def test_a_file_of_no_fix_has_its_header(tmp_path: Path) -> None:
    write_fixes([], ["A"], tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text().startswith("stamp_s,tag,status,")


def test_a_fix_without_a_position_has_no_error_and_no_residual() -> None:
    assert np.isnan([fix(**NOTHING).sigma, fix(**NOTHING).residual_rms]).all()
    assert fix().sigma == pytest.approx(np.sqrt(0.05))


# Positions -----------------------------------------------------------------------------------


@pytest.mark.parametrize("ml", ["newton", "ceres", "both"])
def test_ml_names_whose_minimum_is_returned(ml: str, tmp_path: Path) -> None:
    ranges = MEASURED.replace("A,5", "A,5.3").replace("C,4", "C,3.8")
    epochs = read_epochs(*files(tmp_path, ranges), sigma_m=0.3)
    (one,) = positions(epochs, height=1.0, ml=ml)
    alone = {name: positions(epochs, height=1.0, solver=name)[0] for name in ("newton", "ceres")}
    mine, other = (alone["ceres"], alone["newton"]) if ml == "ceres" else alone.values()
    np.testing.assert_allclose(one.position, mine.position, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(one.covariance, mine.covariance, rtol=1e-12)
    apart = float(np.linalg.norm(mine.position - other.position))
    assert 1e-11 < apart < 1e-4  # else nobody could see the two differ
    if ml == "both":
        assert one.ml_distance == pytest.approx(apart, rel=1e-3)
        at = mine.position[0] - other.position[0]
        sigmas = np.sqrt(at @ np.linalg.solve(mine.covariance[0], at))
        assert one.ml_sigmas == pytest.approx(sigmas, rel=1e-3)
    else:
        assert math.isnan(one.ml_distance)
        assert math.isnan(one.ml_sigmas)


def test_the_command_says_how_far_newton_and_ceres_are_apart(tmp_path: Path) -> None:
    ranges = MEASURED.replace("A,5", "A,5.3")
    said = said_of(tmp_path, ranges, "--height", 1, "--ml", "both", "--out", tmp_path / "out.csv")
    (row,) = rows_of(tmp_path / "out.csv")
    apart, sigmas = float(row["ml_distance_m"]), float(row["ml_sigmas"])
    assert f"Newton and Ceres end up to {apart:.2g} m apart, {sigmas:.2g} sigma" in said.out
    assert "Ceres" not in said_of(tmp_path, ranges, "--height", 1).out


def located(tmp_path: Path, ranges: str, anchors: str = PLANE, **options: Any) -> list[Fix]:
    return positions(read_epochs(*files(tmp_path, ranges, anchors)), **options)


@pytest.mark.parametrize("solver", ["both", "newton", "ceres", "srls", "srwls"])
def test_exact_ranges_give_the_position_in_the_plane(solver: str, tmp_path: Path) -> None:
    (one,) = located(tmp_path, MEASURED, height=1.0, solver=solver)

    assert one.status == "unique"
    np.testing.assert_allclose(one.position, [[3.0, 4.0]], atol=1e-9)
    np.testing.assert_allclose(one.residual, np.zeros((1, 4)), atol=1e-9)
    assert one.residual_rms < 1e-9
    assert (one.agree, one.culprit) == (True if solver == "both" else None, "")


@pytest.mark.parametrize("solver", ["both", "newton", "ceres", "srls", "srwls"])
def test_exact_ranges_give_the_position_in_space(solver: str, tmp_path: Path) -> None:
    (one,) = located(tmp_path, MEASURED_IN_SPACE, SPACE, solver=solver)

    assert one.status == "unique"
    np.testing.assert_allclose(one.position, [[2.0, 3.0, 6.0]], atol=1e-9)
    assert one.covariance.shape == (1, 3, 3)


# 12 m above or below the plane of the anchors.
ABOVE = "stamp_s,tag,anchor,range_m\n0,t,A,13\n0,t,B,13\n0,t,C,12.649110640673518\n0,t,D,12.36931687685298\n"  # noqa: E501


def test_over_anchors_in_one_plane_both_sides_fit_until_a_height_decides(tmp_path: Path) -> None:
    (both,) = located(tmp_path, ABOVE)
    (one,) = located(tmp_path, ABOVE, height=13.0)

    assert both.status == "ambiguous"
    assert both.reason
    sides = both.position[np.argsort(both.position[:, 2])]
    np.testing.assert_allclose(sides, [[3.0, 4.0, -11.0], [3.0, 4.0, 13.0]], atol=1e-6)
    assert one.status == "unique"
    np.testing.assert_allclose(one.position, [[3.0, 4.0]], atol=1e-6)


def test_two_ranges_leave_two_positions_and_one_leaves_none(tmp_path: Path) -> None:
    two = "stamp_s,tag,anchor,range_m\n0,t,A,5\n0,t,B,5\n1,t,A,5\n"
    first, second = located(tmp_path, two, height=1.0)

    assert first.status == "ambiguous"
    found = first.position[np.argsort(first.position[:, 1])]
    np.testing.assert_allclose(found, [[3.0, -4.0], [3.0, 4.0]], atol=1e-9)
    assert second.status == "underdetermined"
    assert second.reason


SIX = "anchor,x_m,y_m,z_m\n" + "".join(
    f"{name},{x},{y},1\n"
    for name, x, y in zip("ABCDEF", (0, 10, 10, 0, 5, 1), (0, 0, 10, 10, 1, 5), strict=True)
)


def six_ranges(wrong: str = "", by: float = 0.0) -> str:
    lines = ["stamp_s,tag,anchor,range_m\n"]
    for row in SIX.splitlines()[1:]:
        name, x, y, _ = row.split(",")
        distance = math.hypot(float(x) - 4.0, float(y) - 6.0) + (by if name == wrong else 0.0)
        lines.append(f"0,t,{name},{distance!r}\n")
    return "".join(lines)


@pytest.mark.parametrize("wrong", list("ABCDEF"))
def test_an_anchor_that_reads_a_metre_long_is_named(wrong: str, tmp_path: Path) -> None:
    silent = SIX.replace("\nA,", "\nZ,3,3,1\nA,")
    epochs = read_epochs(*files(tmp_path, six_ranges(wrong, 1.0), silent), sigma_m=0.05)
    (one,) = positions(epochs, height=1.0)

    assert one.status == "inconsistent"
    assert (one.culprit, one.explained) == (wrong, True)
    assert one.culprit_test > 10.0


def test_ranges_a_hundred_metres_wrong_are_no_unique_position(tmp_path: Path) -> None:
    (one,) = located(tmp_path, six_ranges("C", 100.0), SIX, height=1.0)
    assert one.status != "unique"
    assert np.isfinite(one.position).all()


def test_anchors_far_from_the_origin_lose_no_accuracy(tmp_path: Path) -> None:
    far = PLANE.replace("A,0,0", "A,10000000,10000000").replace("B,6,0", "B,10000006,10000000")
    far = far.replace("C,3,0", "C,10000003,10000000").replace("D,0,4", "D,10000000,10000004")
    (one,) = located(tmp_path, MEASURED, far, height=1.0)
    np.testing.assert_allclose(one.position, [[10000003.0, 10000004.0]], atol=1e-8)


def test_anchors_in_one_point_fix_nothing(tmp_path: Path) -> None:
    point = "anchor,x_m,y_m,z_m\nA,1,1,1\nB,1,1,1\nC,1,1,1\nD,1,1,1\n"
    (one,) = located(tmp_path, ranges_at(*((0, "t", name) for name in "ABCD")), point, height=1.0)
    assert one.status == "underdetermined"
    assert not np.isnan(one.position).any()


# The command ---------------------------------------------------------------------------------


def said_of(tmp_path: Path, ranges: str, *options: object, anchors: str = PLANE) -> Said:
    places, measured = files(tmp_path, ranges, anchors)
    return locfuse("position", "--anchors", places, "--ranges", measured, *options)


def test_the_command_shows_every_position_and_writes_the_file(tmp_path: Path) -> None:
    out = tmp_path / "fixes.csv"
    two = MEASURED + "1,t,A,5\n1,t,B,5\n"
    said = said_of(tmp_path, two, "--height", 1, "--out", out)

    assert said.status == 0
    lines = said.out.splitlines()
    heading = next(line.split() for line in lines if "stamp" in line)
    assert heading == ["stamp", "tag", "x", "y", "sigma", "status", "agree", "rms", "culprit"]
    first = next(line for line in lines if line.strip().startswith("0.000"))
    assert first.split() == ["0.000", "t", "3.000", "4.000", *first.split()[4:]]
    assert "unique" in first
    other = next(line for line in lines if line.split()[:1] == ["or"])
    assert sorted(abs(float(word)) for word in other.split()[1:]) == [3.0, 4.0]
    assert "unique 1, ambiguous 1" in said.out
    rows = rows_of(out)
    assert [row["hypothesis"] for row in rows] == ["1", "1", "2"]
    assert float(rows[0]["x_m"]) == pytest.approx(3.0, abs=1e-9)
    assert "z_m" not in rows[0]


def test_without_a_height_the_command_says_what_a_plane_leaves_open(tmp_path: Path) -> None:
    said = said_of(tmp_path, ABOVE)
    assert "ambiguous 1" in said.out
    assert "all anchors lie in one plane" in said.out
    assert "…" not in said.out  # three coordinates fit into 80 columns
    assert "-11.000" in said.out
    assert "--height" in said.out
    assert "one plane" not in said_of(tmp_path, ABOVE, "--height", 13).out
    assert "one plane" not in said_of(tmp_path, MEASURED_IN_SPACE, anchors=SPACE).out


def test_a_long_table_says_that_it_is_cut(tmp_path: Path) -> None:
    many = [(float(k), "t", anchor) for k in range(60) for anchor in "ABCD"]
    said = said_of(tmp_path, ranges_at(*many), "--height", 1)
    assert "first 50 of 60 epochs" in said.out


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--solver", "gps"], "solver is 'gps'; expected both, newton"),
        (["--ml", "seres"], "ml is 'seres'; did you mean 'ceres'"),
        (["--ml", "ceres", "--solver", "srls"], "ml is 'ceres', which solver srls alone"),
        (["--loss", "cauchi"], "did you mean 'cauchy'"),
        (["--sigma", "0"], "sigma is 0.0, expected > 0"),
        (["--height", "nan"], "height is nan"),
    ],
)
def test_wrong_options_are_one_sentence(options: list[str], expected: str, tmp_path: Path) -> None:
    assert expected in said_of(tmp_path, MEASURED, *options).sentence()


def test_an_unknown_anchor_is_one_sentence(tmp_path: Path) -> None:
    sentence = said_of(tmp_path, MEASURED.replace("t,C", "t,CC")).sentence()
    assert "anchor 'CC' has no place; did you mean 'C'" in sentence


# Recordings ----------------------------------------------------------------------------------


def errors_of(dataset: str, folder: str, height: float, out: Path, loss: str) -> FloatArray:
    """Return the distance of each epoch's position from the tag's true place, metres."""
    errors = []
    for path in convert(dataset, recording(folder), out):
        if path.name == "fast":  # of lias: not at rest
            continue
        log = read_log(path)
        at = truth_of(log)
        assert at is not None
        c, s = (1.0, 0.0) if at.heading is None else (np.cos(at.heading[0]), np.sin(at.heading[0]))
        tag = {
            name: at.position[0] + [c * x - s * y, s * x + c * y]
            for name, (x, y, _) in log.tags.items()
        }
        epochs = read_epochs(path / "anchors.csv", path / "ranges.csv")
        fixes = positions(epochs, height=height, solver="newton", loss=loss)
        errors += [np.hypot(*(f.position[0] - tag[f.tag])) for f in fixes if len(f.position)]
    return np.array(errors)


def test_behind_metal_only_a_one_sided_loss_keeps_the_median_below_11_cm(tmp_path: Path) -> None:
    medians = {
        loss: float(np.median(errors_of("ghent", "ghent-iiot", 1.5, tmp_path / loss, loss)))
        for loss in ("none", "huber", "one_sided")
    }
    assert medians["one_sided"] <= 0.11
    assert medians["huber"] > 0.11
    assert medians["none"] > 0.17


def test_a_tag_at_rest_among_eight_anchors_is_within_16_cm(tmp_path: Path) -> None:
    errors = errors_of("lias", "lias-planar", 0.97, tmp_path, "none")
    assert len(errors) > 40_000
    assert float(np.median(errors)) <= 0.16
