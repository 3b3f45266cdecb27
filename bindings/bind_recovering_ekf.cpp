// SPDX-License-Identifier: Apache-2.0
#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/recovery/recovering_ekf.hpp"

namespace py = pybind11;
using locfuse::RecoveringEkf;

void bind_recovering_ekf(py::module_& m) {
  using Config = RecoveringEkf::Config;
  py::class_<Config>(m, "RecoveringEkfConfig",
                     "Filter, initialization and health of a RecoveringEkf.")
      .def(py::init<>())
      .def_readwrite("start", &Config::start,
                     "InitializerConfig of the search, with the PoseEkfConfig of the filter.")
      .def_readwrite(
          "tracker", &Config::tracker,
          "LandmarkEkfConfig, TagTriangleEkfConfig or AirEkfConfig of another filter, or "
          "None.")
      .def_readwrite("start_height", &Config::start_height, "Height at which an AirEkf begins [m].")
      .def_readwrite("sigma_start_height", &Config::sigma_start_height, "Its sigma [m].")
      .def_readwrite("health", &Config::health)
      .def_readwrite("restart", &Config::restart, "Whether to relocalize while lost.");
  py::class_<RecoveringEkf>(
      m, "RecoveringEkf",
      R"(Filter that initializes itself, detects when it is lost, and relocalizes
(docs/health.md): a PoseEkf, or what `RecoveringEkfConfig.tracker` asks for.

During initialization and while lost, landmark observations of one stamp, ranges, fixes and poses
start hypotheses until a single one remains.

Parameters
----------
config : RecoveringEkfConfig
world : World
    With a matcher, scans give the heading during a search.

Raises
------
ValueError
    If a config is out of range.

Examples
--------
>>> from locfuse import *
>>> posts = LandmarkMap([Landmark(0, [3, 0]), Landmark(1, [0, 4]), Landmark(2, [-2, 1])])
>>> ekf = RecoveringEkf(RecoveringEkfConfig(), World(landmarks=LandmarkSensor(posts)))
>>> ekf.is_lost
True
>>> _ = ekf.on_joint([RangeBearing(0, None, 3.0, 0.0), RangeBearing(0, None, 4.0, 1.5708),
...                   RangeBearing(0, None, 2.2361, 2.6779)])
>>> ekf.is_lost, abs(round(ekf.state().hypotheses[0].estimate.pose.x, 2))
(False, 0.0)
)")
      .def(py::init<const Config&, const locfuse::World&>(), py::arg("config"), py::arg("world"))
      .def_property_readonly("config", &RecoveringEkf::config)
      .def_property_readonly("world", &RecoveringEkf::world)
      .def("start_at", &RecoveringEkf::start_at, py::arg("start"),
           "Tracks from a PoseEstimate.\n\nRaises\n------\nValueError\n    As a PoseEkf does.")
      .def(
          "start_with",
          [](RecoveringEkf& ekf, const locfuse::PoseEkf& started) { ekf.start_with(started); },
          py::arg("ekf"), "Tracks with a PoseEkf that is already initialized.")
      .def("start_from", &RecoveringEkf::start_from, py::arg("found"),
           "Tracks from the pose that an Initializer has found.\n\nRaises\n------\nValueError\n"
           "    Unless it is READY.")
      .def("on", on_message<RecoveringEkf, locfuse::LaserScan>(), py::arg("message"),
           "Processes one message. Its outcome is IGNORED until tracking starts.")
      .def("on_joint", &RecoveringEkf::on_joint, py::arg("sightings"),
           py::arg_v("association", locfuse::Association::kJoint, "Association.JOINT"),
           "Processes landmark observations of one stamp. Returns one Outcome each.")
      .def("current", &RecoveringEkf::current,
           "PoseEstimate at the stamp of the belief. Raises RuntimeError until it has started.")
      .def(
          "estimate", &RecoveringEkf::estimate,
          "PoseEstimate propagated to the end of the latest odometry. Raises RuntimeError until it "
          "has started.")
      .def("state", &RecoveringEkf::state,
           "READY while tracking; otherwise the progress of the search with its hypotheses.")
      .def_property_readonly("is_lost", &RecoveringEkf::is_lost,
                             "Whether there is no trustworthy estimate.")
      .def("health", &RecoveringEkf::health, "HealthReport of the estimate.")
      .def("watched", &RecoveringEkf::watched,
           "WatchReport of the poses that it watches, or None unless it watches poses.")
      .def_property_readonly("sources", &RecoveringEkf::sources, "One SourceStatus per source.")
      .def_property_readonly("restarts", &RecoveringEkf::restarts, "Number of relocalizations.")
      .def_property_readonly("alarms", &RecoveringEkf::alarms,
                             "Number of times the estimate was declared lost.")
      .def(
          "estimator",
          [](const RecoveringEkf& ekf) {
            return ekf.estimator() == nullptr ? std::nullopt : std::optional(*ekf.estimator());
          },
          "Copy of the PoseEkf, or None before the first start and with another tracker. While "
          "lost, the filter at the previous pose.")
      .def(
          "tracker",
          [](const RecoveringEkf& ekf) {
            return ekf.has_started() ? std::optional(*ekf.tracker()) : std::nullopt;
          },
          "Copy of the filter of any kind, or None before the first start.")
      .def("__repr__", [](const RecoveringEkf& ekf) {
        return "RecoveringEkf(" + std::string(ekf.is_lost() ? "lost" : "tracking") + ", " +
               std::to_string(ekf.alarms()) + " alarms)";
      });
}
