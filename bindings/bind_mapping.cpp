// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <optional>
#include <vector>

#include "bindings.hpp"
#include "columns.hpp"
#include "locfuse/frontends/grid_drawing.hpp"
#include "locfuse/smoothing/pose_graph.hpp"
#include "locfuse/smoothing/scan_mapper.hpp"
#include "progress.hpp"
#include "shared_log.hpp"

namespace py = pybind11;
using locfuse::OccupancyGrid;
using locfuse::PlacedScan;
using locfuse::Pose2;
using locfuse::PoseRelation;
using locfuse::ScanLoop;
using locfuse::ScanMapperConfig;
using locfuse::ScanMapping;
using locfuse::SolvedPoseGraph;
using Unlocked = py::call_guard<py::gil_scoped_release>;

namespace {

ScanMapping map_scans(const locfuse::ScanOdometryConfig& scans,
                      const locfuse::OdometryMotion::Config& odometry, SharedLog& log,
                      const locfuse::PoseEstimate& start, double resolution_m,
                      const std::optional<std::shared_ptr<OccupancyGrid>>& onto,
                      const std::optional<locfuse::ScanMapperProgress>& progress) {
  const Use use(log, Use::Kind::kRead);
  const ScanMapperConfig config{{scans, odometry}, {}, resolution_m, start, onto.value_or(nullptr)};
  const py::gil_scoped_release release;
  return locfuse::map_scans(config, messages_of(log.log), with_gil(progress));
}

void bind_pose_graph(py::module_& m) {
  py::class_<PoseRelation>(m, "PoseRelation", R"(How one pose of a graph lies to another.

Parameters
----------
from_pose, to_pose : int
    Numbers of the poses.
motion : Pose2
    T_from_to.
information : array, shape (3, 3)
    Inverse covariance of (x, y, heading) of `motion`, in the axes of `from_pose` [1/m^2, 1/rad^2];
    zero along what is not known.
may_be_wrong : bool
    Whether it is rejected where it contradicts others.
)")
      .def(py::init([](std::size_t from_pose, std::size_t to_pose, const Pose2& motion,
                       const locfuse::Matrix<3, 3>& information, bool may_be_wrong) {
             return PoseRelation{from_pose, to_pose, motion, information, may_be_wrong};
           }),
           py::arg("from_pose"), py::arg("to_pose"), py::arg("motion"), py::arg("information"),
           py::arg("may_be_wrong") = false)
      .def_readonly("from_pose", &PoseRelation::from)
      .def_readonly("to_pose", &PoseRelation::to)
      .def_readonly("motion", &PoseRelation::motion)
      .def_readonly("information", &PoseRelation::information)
      .def_readonly("may_be_wrong", &PoseRelation::may_be_wrong);
  py::class_<SolvedPoseGraph>(m, "SolvedPoseGraph", "The likeliest poses of a graph.")
      .def_readonly("poses", &SolvedPoseGraph::poses, "List of Pose2; the first one stays.")
      .def_readonly("kept", &SolvedPoseGraph::kept, "Of each relation whether it is not rejected.")
      .def_readonly("cost", &SolvedPoseGraph::cost,
                    "Half the sum of squared errors in sigmas of the relations kept.")
      .def_readonly("iterations", &SolvedPoseGraph::iterations)
      .def_readonly("converged", &SolvedPoseGraph::converged)
      .def_readonly("termination", &SolvedPoseGraph::termination, "What the solver said last.");
  const locfuse::PoseGraphConfig d;
  m.def(
      "solve_pose_graph",
      [](const std::vector<Pose2>& guess, const std::vector<PoseRelation>& relations,
         double wrong_probability, int max_iterations) {
        return locfuse::solve_pose_graph(guess, relations, {wrong_probability, max_iterations});
      },
      py::arg("guess"), py::arg("relations"), py::arg("wrong_probability") = d.wrong_probability,
      py::arg("max_iterations") = d.max_iterations, Unlocked(),
      R"(Find the likeliest poses of a graph, and which relations are wrong (docs/map.md).

Parameters
----------
guess : list of Pose2
    Where to begin; the first pose stays.
relations : list of PoseRelation
    Those that cannot be wrong, as odometry, connect all poses.
wrong_probability : float
    Of rejecting a right one.
max_iterations : int
    Of the solver, each time it is called.

Raises
------
ValueError
    If a pose or relation is not valid, or a pose is not connected.
NumericalError
    If the solver fails.

Examples
--------
A square of 1 m, whose last side says 10 cm too much, and a loop that closes it:

>>> import numpy as np
>>> from locfuse.core import Pose2, PoseRelation, solve_pose_graph
>>> ahead, sure = Pose2(1.0, 0.0, np.pi / 2), 100.0 * np.eye(3)
>>> sides = [PoseRelation(i, i + 1, ahead, sure) for i in range(3)]
>>> sides += [PoseRelation(3, 4, Pose2(1.1, 0.0, np.pi / 2), sure)]
>>> loop = PoseRelation(4, 0, Pose2(), sure, may_be_wrong=True)
>>> guess = [Pose2(), Pose2(1, 0, 1.6), Pose2(1, 1, 3.1), Pose2(0, 1, -1.6), Pose2(0, 0, 0)]
>>> solved = solve_pose_graph(guess, [*sides, loop])
>>> all(solved.kept), bool(np.hypot(solved.poses[4].x, solved.poses[4].y) < 0.05)
(True, True)
)");
}

}  // namespace

void bind_mapping(py::module_& m) {
  bind_pose_graph(m);
  m.def(
      "draw_grid",
      [](const std::vector<std::pair<locfuse::LaserScan, Pose2>>& scans, double resolution_m,
         const std::optional<std::shared_ptr<OccupancyGrid>>& onto) {
        std::vector<PlacedScan> placed;
        for (const auto& [scan, pose] : scans) {
          placed.push_back({scan, pose});
        }
        return std::make_shared<OccupancyGrid>(
            locfuse::draw_grid(placed, resolution_m, onto.value_or(nullptr)));
      },
      py::arg("scans"), py::arg("resolution_m") = 0.05, py::arg("onto") = py::none(), Unlocked(),
      R"(Draw the map that scans at known poses show (docs/map.md).

Parameters
----------
scans : list of (LaserScan, Pose2)
    Scans and their poses T_world_body.
resolution_m : float
    Metres per cell; not used with `onto`.
onto : OccupancyGrid, optional
    A map that stays where no beam reaches.

Raises
------
ValueError
    If a scan, pose or the resolution is not valid, there is nothing to draw, or too much.
)");
  py::class_<ScanLoop>(m, "ScanLoop", "A place that was seen again.")
      .def_readonly("from_ns", &ScanLoop::from,
                    "Stamp of the earlier scan, if it is not on an old map.")
      .def_readonly("to_ns", &ScanLoop::to)
      .def_readonly("motion", &ScanLoop::motion, "T_from_to.")
      .def_readonly("explained", &ScanLoop::explained,
                    "Fraction of the returns that lie on what was seen before.")
      .def_readonly("agreement", &ScanLoop::agreement,
                    "Fraction of the ends around both that do not contradict each other.")
      .def_readonly("kept", &ScanLoop::kept, "Whether it agrees with all others.")
      .def_readonly("is_on_map", &ScanLoop::is_on_map,
                    "Whether the old map was seen; `motion` is then T_world_to.");
  py::class_<ScanMapping> bound(m, "ScanMapping", "A map, and the drive that it was made of.");
  bind_estimate_columns(
      bound, [](const ScanMapping& made) -> const auto& { return made.poses; });
  bound
      .def_property_readonly(
          "grid",
          [](const ScanMapping& made) { return std::make_shared<OccupancyGrid>(made.grid); },
          "OccupancyGrid.")
      .def_readonly("loops", &ScanMapping::loops, "List of ScanLoop.")
      .def_readonly("scans", &ScanMapping::scans, "Number of scans that were used.")
      .def_readonly("keys", &ScanMapping::keys, "Of those, that the map is drawn of.")
      .def_readonly("unmatched", &ScanMapping::unmatched,
                    "Of those, that fitted nothing before: there the wheels led.")
      .def_readonly(
          "weak", &ScanMapping::weak,
          "Of all scans, that left a direction open, as along a corridor, where no wheels "
          "led.");
  m.def("map_scans", &map_scans, py::arg("scans"), py::arg("odometry"), py::arg("log"),
        py::arg("start"), py::arg("resolution_m") = ScanMapperConfig{}.resolution_m,
        py::arg("onto") = py::none(), py::arg("progress") = py::none(),
        R"(Make a map of the scans of a log and, if it has any, its odometry (docs/map.md).

Parameters
----------
scans : ScanOdometryConfig
odometry : OdometryConfig
    Noise of the wheels.
log : MessageLog
start : PoseEstimate
    Of the first scan, in the frame of the map.
resolution_m : float
    Metres per cell.
onto : OccupancyGrid, optional
    A map that is continued, in its resolution and axes; the start's covariance says how well it is
    known there.
progress : callable, optional
    Called with the fraction that is done.

Raises
------
ValueError
    If a setting is out of bounds, or no scan has a return.
)");
}
