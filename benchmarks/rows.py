# SPDX-License-Identifier: Apache-2.0
"""Rows of the benchmark table: comparisons and requirements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Row:
    """One line of the table; `figure` is a ratio, a rate or a time that `required` bounds."""

    what: str
    ours: str
    peer: str = ""
    figure: float | None = None
    unit: str = ""
    required: str = ""
    met: bool | None = None


@dataclass
class Measured:
    """Per benchmark: seconds per item (a message, an epoch, a scan, a run) and its counters."""

    seconds: dict[str, float] = field(default_factory=dict)
    counted: dict[str, dict[str, float]] = field(default_factory=dict)

    def __getitem__(self, name: str) -> float:
        return self.seconds[name]

    def __contains__(self, name: str) -> bool:
        return name in self.seconds


def all_rows(m: Measured) -> list[Row]:
    """Return every row; those of missing peers say so."""
    return [*filter_rows(m), *evaluation_rows(m), *range_rows(m), *scan_rows(m), *map_rows(m),
            *cylinder_rows(m), *particle_rows(m), *landmark_rows(m), *tag_rows(m),
            *inertial_rows(m), *lap_rows(m), *live_rows(m), *bag_rows(m)]  # fmt: skip


def filter_rows(m: Measured) -> Iterator[Row]:
    """Compare one prediction and five ranges on three states."""
    reference, ours = m["bench/reference_joseph"], m["bench/pose_ekf_on"]
    yield _at_most("C++, a step: models, filter / Joseph reference", m["bench/models_and_filter"],
                   reference, 1.1)  # fmt: skip
    yield _at_most("C++, a step: PoseEkf::on / Joseph reference", ours, reference, 2.0)
    yield _at_most("C++, a step: errors correlated / independent, PoseEkf::on",
                   m["bench/correlated_on"], ours, 2.0)  # fmt: skip
    yield _faster("C++, a step: Orocos BFL / PoseEkf::on", m, "bench/pose_ekf_on",
                  "bench/orocos_bfl", 15.0)  # fmt: skip
    for what, name in (("with health: RecoveringEkf", "recovering_ekf"),
                       ("five offsets as states: PoseEkf", "offsets"),
                       ("five that wander: PoseEkf", "wandering")):  # fmt: skip
        extended = m[f"bench/{name}_on"]
        yield Row(f"- {what} / PoseEkf", _time(extended), _time(ours), extended / ours, "x")
    allocations = m.counted["bench/pose_ekf_on"]["allocations_per_message"]
    bfl = m.counted.get("bench/orocos_bfl", {}).get("allocations_per_message")
    yield Row("C++, PoseEkf::on: heap allocations per message", f"{allocations:g}",
              "" if bfl is None else f"BFL {bfl:.1f}", allocations, "", "0",
              allocations == 0.0)  # fmt: skip
    yield _rate("Python, a message: columns to last estimate", m["replay"], 3e6)
    yield _rate("Python, a message: columns to outcomes, estimates", m["replay_recorded"], 1e6)
    yield _within("Python, one call per epoch: motion and 5 ranges", m["epoch_call"], 3e-6)
    yield _faster("Python, a message, recorded: filterpy / ours", m, "replay_short", "filterpy",
                  150.0)  # fmt: skip


def landmark_rows(m: Measured) -> Iterator[Row]:
    """Compare landmarks as states with memory traffic, and known ones with hand-written Eigen."""
    for states in (403, 1003):
        yield _at_most(f"landmarks, an update of {states} states / its memory traffic",
                       m[f"update_one/of_{states}_states"], m[f"traffic/of_{states}_states"],
                       2.0)  # fmt: skip
    yield _plain("- of 403: dense Eigen by hand / ours", m, "update_one/of_403_states",
                 "dense_eigen_of_403_states")  # fmt: skip
    yield _within("landmarks, 8 sightings of 50: association and fusion", m["joint_8_of_50"], 2e-3)
    yield _within("- association where all eight match several", m["joint_compatibility_8_of_50"],
                  2e-3)  # fmt: skip
    yield _at_most("known landmarks, a step: PoseEkf::on / Eigen by hand",
                   m["known_map_pose_ekf"], m["known_map_fixed_size_eigen"], 2.0)  # fmt: skip
    yield _at_most("- with health: RecoveringEkf / PoseEkf", m["known_map_recovering_ekf"],
                   m["known_map_pose_ekf"], 1.5)  # fmt: skip
    yield _within("landmarks, constellations of 500 without ids", m["constellations_of/500"],
                  2e-3)  # fmt: skip
    for peer in ("gtsam", "stonesoup"):
        yield _faster(f"Python, known landmarks, a step of a log: {peer} / ours", m, "known_replay",
                      f"known_{peer}", 100.0)  # fmt: skip
        yield _plain(f"- message by message: {peer} / ours", m, "known_calls", f"known_{peer}")
    yield _plain("Python, mapping, message by message: gtsam / ours", m, "mapping_calls",
                 "mapping_gtsam")  # fmt: skip


def tag_rows(m: Measured) -> Iterator[Row]:
    """Compare a prediction and 15 rows on twelve states of three tags with hand-written Eigen."""
    by_hand = m["tags_fixed_size_eigen"]
    yield _at_most("three tags, a step of 15 rows: TagTriangleEkf::on / Eigen by hand",
                   m["tags_ekf_of_the_paper"], by_hand, 3.0)  # fmt: skip
    yield _at_most("- with the Jacobian of the heading", m["tags_ekf"], by_hand, 3.0)


def inertial_rows(m: Measured) -> Iterator[Row]:
    """Compare a prediction and five ranges on fifteen states with hand-written Eigen."""
    ours, by_hand = m["inertial_ekf"], m["inertial_fixed_size_eigen"]
    yield _at_most("an inertial body, a step: AirEkf::on / Eigen by hand", ours, by_hand, 1.3)
    yield _at_most("- errors correlated / independent", m["inertial_ekf_correlated"], ours, 2.0)


def lap_rows(m: Measured) -> Iterator[Row]:
    """Compare the duration of a lap of 15 minutes with that of its replay, on one core."""
    for name, what in (("lidar", "Python, a lap of celan2017, Mcl of 2,000: driven / replayed"),
                       ("covered_switch", "- half a laser, UWB by a switch")):  # fmt: skip
        driven_s = m.counted[f"lap[{name}]"]["seconds_driven"]
        yield _at_least(what, m[f"lap[{name}]"], driven_s, 100.0)


def live_rows(m: Measured) -> Iterator[Row]:
    """Compare 10 s of a robot with the time in its adapter, on one core, without middleware."""
    driven_s = m.counted["through_the_adapter"]["seconds_driven"]
    yield _at_least( "Python, 24 anchors, odometry at 100 Hz by the adapter: driven / processed",
                    m["through_the_adapter"], driven_s, 10.0)  # fmt: skip
    yield _plain("- the adapter / locfuse.run on the log", m, "by_run", "through_the_adapter")
    health_step_s = m["bench/recovering_ekf_on"] - m["bench/pose_ekf_on"]  # a step of five ranges
    health_s = m.counted["by_run"]["ranges"] / 5.0 * health_step_s
    share = 100.0 * health_s / m["by_run"]
    yield Row("- health in locfuse.run on the log", _time(health_s), _time(m["by_run"]), share, "%",
              "< 3", share < 3.0)  # fmt: skip


def bag_rows(m: Measured) -> Iterator[Row]:
    """Compare reading bags as logs with unpacking their messages, and writing with a target rate.

    One second has 100 messages of odometry, 50 of four ranges each, 40 scans of 360 beams.
    """
    for kind, of in (("bag", "ROS 1"), ("mcap", "ROS 2")):
        yield _rate(f"Python, a message of a .{kind} ({of}) to a log", m[f"read_bag[{kind}]"], 2e4)
        yield _plain("- rosbags, which only unpacks / ours", m, f"read_bag[{kind}]",
                     f"unpack_bag[{kind}]")  # fmt: skip
        yield _rate(f"- of a log to a .{kind}, transforms besides", m[f"write_bag[{kind}]"], 2e4)


def evaluation_rows(m: Measured) -> Iterator[Row]:
    """Compare reading, associating, aligning and scoring 100,000 poses.

    evo runs only as a program; its time for three poses, the start-up, is subtracted.
    """
    what = "100,000 poses: evo without its start / ours"
    if "evo_program" not in m:
        yield Row(what, _time(m["evaluation"]), "skipped: not installed")
        return
    work = m["evo_program"] - m["evo_start"]
    yield _at_least(what, m["evaluation"], work, 30.0)
    yield _plain("- evo_ape / locfuse evaluate, start included", m, "evaluation_program",
                 "evo_program")  # fmt: skip
    yield _plain(
        "- the start of each: the same for three poses", m, "evaluation_start", "evo_start"
    )


def range_rows(m: Measured) -> Iterator[Row]:
    """Compare positions from ranges alone, anchors known."""
    for name, size, limit in (("plane", "2D, 5 anchors", 0.8e-6), ("space", "3D, 8", 1.4e-6)):
        what = f"C++, {size}: SR-LS and ML; ceres::TinySolver"
        yield _within(what, m[f"{name}_fast"], limit, m[f"{name}_tiny_solver"])
    worst = max(m[f"plane_ceres_{loss}"] for loss in ("huber", "cauchy", "one_sided"))
    yield _within("C++, 2D, 5: the Ceres problem with a loss; its defaults", worst, 15e-6,
                  m["plane_ceres_autodiff"])  # fmt: skip
    yield _within("C++, 2D, 5: an epoch of 10,000, dispatched", m["plane_batch"], 0.1e-6)
    yield _within("C++, 2D, 5: an epoch of 10,000, portable", m["portable/plane_batch"], 0.2e-6)
    yield _within("Python, 2D, 5: one call", m["locate_call"], 3e-6)
    yield _within("Python, 2D, 5: an epoch of 10,000", m["locate_batch"], 0.25e-6)
    for peer in ("gtsam", "scipy"):
        yield _faster(f"Python, an epoch of 10,000: {peer} / ours", m, "locate_batch",
                      f"locate_{peer}", 500.0)  # fmt: skip
        yield _plain(f"- one call each: {peer} / ours", m, "locate_call", f"locate_{peer}")
    for name, limit in (("2-200", 0.0002), ("3-201", 0.0005)):
        wrong = m.counted[f"random_layouts[{name}]"]["wrong"]
        yield Row(f"{name[0]}D, 10,000 random layouts of 5: wrong minima", f"{wrong:.2%}",
                  required=f"<= {limit:.2%}", met=wrong <= limit)  # fmt: skip


def scan_rows(m: Measured) -> Iterator[Row]:
    """Compare scans of 360 beams on a map of 400 x 400 cells."""
    yield _within("C++, 36 headings by look-up; by PCL's kd-tree", m["heading/lookup"], 30e-6,
                  m["heading/pcl_kdtree"])  # fmt: skip
    yield _within("C++, registration by look-up; PCL ICP", m["refine/lookup"], 40e-6,
                  m["registration/pcl_icp"])  # fmt: skip
    yield _faster("- PCL ICP / ours", m, "refine/lookup", "registration/pcl_icp", 100.0)
    yield _within("C++, registration with exact neighbours", m["refine/exact"], 0.3e-3)
    yield _within("C++, scan to scan, no map, exact neighbours", m["scan_to_scan"], 0.3e-3)
    yield Row("- scan odometry on a local map of ten", _time(m["scan_odometry"]))
    yield _faster("Python, registration: small_gicp / ours", m, "refine_call", "refine_small_gicp",
                  25.0)  # fmt: skip
    for what, ours, peer in (
        ("C++, registration: RMSE of PCL ICP / ours", "refine/lookup", "registration/pcl_icp"),
        ("Python, registration: RMSE of small_gicp / ours", "refine_call", "refine_small_gicp"),
    ):
        if peer in m:
            mine, theirs = m.counted[ours]["rmse_m"], m.counted[peer]["rmse_m"]
            yield Row(what, f"{1e3 * mine:.2f} mm", f"{1e3 * theirs:.2f} mm", theirs / mine, "x",
                      ">= 1", theirs >= mine)  # fmt: skip
    yield _within("C++, global initialization: search, refine, covariance", m["power_up"], 5e-3)
    yield _within("C++, preparing the map", m["prepare"], 30e-3)
    for what, name in (("36 headings", "heading"), ("registration", "refine")):
        yield Row(f"- {what} by look-up, portable", _time(m[f"portable/{name}/lookup"]))


def map_rows(m: Measured) -> Iterator[Row]:
    """Check the cost of maps: one of 10,000 x 7,000 cells, ray casting on one of 400 x 400."""
    yield _within("C++, distances on 10,000 x 7,000 cells", m["distance_field"], 3.0)
    peak_mb = m.counted["distance_field"]["peak_mb"]
    yield Row("- peak memory, with the map", f"{peak_mb:.0f} MB", required="<= 600 MB",
              met=peak_mb <= 600.0)  # fmt: skip
    yield _within("C++, ranges of 360 beams on a map", m["ray_scan"], 60e-6)


def cylinder_rows(m: Measured) -> Iterator[Row]:
    """Check the detection of four cylinders in 360 beams."""
    for what, name in (("known radius", "radius_known"), ("free radius", "radius_free")):
        yield _within(f"C++, cylinders in 360 beams, {what}", m[f"detect/{name}"], 50e-6)
        yield _within("- with walls around them", m[f"detect/{name}_walls"], 50e-6)


def particle_rows(m: Measured) -> Iterator[Row]:
    """Compare a step of Monte Carlo localization with the same step as plain loops."""
    for size, limit, portable in (("2000/60", 0.2e-3, 0.3e-3), ("20000/180", 5e-3, 9.5e-3)):
        what = f"C++, Mcl, {size.replace('/', ' x ')}: predict, weight, resample"
        step, plain = f"mcl/step/{size}/1/real_time", m[f"mcl/plain/{size}/real_time"]
        yield _within(f"{what}; plain loops", m[step], limit, plain)
        yield _within("- portable", m[f"portable/{step}"], portable, plain)
        yield _at_most("- portable / plain loops", m[f"portable/{step}"], plain, 1.25)
    yield _within("- on two threads", m["mcl/step/20000/180/2/real_time"], 3e-3)
    for size in ("200/60/1", "2000/60/1"):
        what = f"C++, Mcl, {size[:-5]} particles with scan-matching proposal / with odometry"
        yield _at_most(what, m[f"mcl/refined/{size}/real_time"], m[f"mcl/step/{size}/real_time"],
                       4.0)  # fmt: skip
        what = f"C++, Mcl, {size[:-5]} particles as messages arrive / in order"
        yield _at_most(what, m[f"mcl/live/{size}/real_time"], m[f"mcl/step/{size}/real_time"], 1.3)


def _at_most(what: str, ours: float, peer: float, limit: float) -> Row:
    ratio = ours / peer
    return Row(what, _time(ours), _time(peer), ratio, "x", f"<= {limit:g}", ratio <= limit)


def _at_least(what: str, ours: float, peer: float, minimum: float) -> Row:
    ratio = peer / ours
    return Row(what, _time(ours), _time(peer), ratio, "x", f">= {minimum:g}", ratio >= minimum)


def _faster(what: str, m: Measured, ours: str, peer: str, minimum: float) -> Row:
    if peer not in m:
        return Row(what, _time(m[ours]), "skipped: not installed")
    return _at_least(what, m[ours], m[peer], minimum)


def _within(what: str, ours: float, limit: float, peer: float | None = None) -> Row:
    ratio = None if peer is None else peer / ours
    return Row(what, _time(ours), "" if peer is None else _time(peer), ratio, "x" if peer else "",
               f"<= {_time(limit)}", ours <= limit)  # fmt: skip


def _plain(what: str, m: Measured, ours: str, peer: str) -> Row:
    if peer not in m:
        return Row(what, _time(m[ours]), "skipped: not installed")
    return Row(what, _time(m[ours]), _time(m[peer]), m[peer] / m[ours], "x")


def _rate(what: str, seconds: float, minimum: float) -> Row:
    return Row(what, _time(seconds), "", 1.0 / seconds, "/s", f">= {minimum:,.0f}",
               1.0 / seconds >= minimum)  # fmt: skip


def _time(seconds: float) -> str:
    scale, unit = (1.0, "s") if seconds >= 1.0 else (1e3, "ms") if seconds >= 1e-3 else (1e6, "us")
    return f"{short(seconds * scale)} {unit}"


def short(value: float) -> str:
    """Return a number with three digits, or all digits before the point."""
    return f"{value:,.0f}" if value >= 1000.0 else f"{value:.3g}"
