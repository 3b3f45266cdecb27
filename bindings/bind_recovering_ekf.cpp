// SPDX-License-Identifier: Apache-2.0
#include "bindings.hpp"
#include "locfuse/estimators/recovering_ekf.hpp"

namespace py = pybind11;
using locfuse::RecoveringEkf;

void bind_recovering_ekf(py::module_& m) {
  using Config = RecoveringEkf::Config;
  py::class_<Config>(m, "RecoveringEkfConfig", "Filter, start and alarm of a RecoveringEkf.")
      .def(py::init<>())
      .def_readwrite("estimator", &Config::estimator)
      .def_readwrite("start", &Config::start)
      .def_readwrite("measurements_per_false_alarm", &Config::measurements_per_false_alarm,
                     "Mean number of measurements before a false alarm is at least this, if as "
                     "many are wrong as `start.wrong_share` says, each by itself.");
  py::class_<RecoveringEkf>(m, "RecoveringEkf",
                            R"(A PoseEkf that starts by itself, notices when it was carried away,
and starts anew (docs/start.md).

While it is lost, landmarks seen together, ranges, fixes and poses start hypotheses until one wins.

Parameters
----------
config : RecoveringEkfConfig
anchors : AnchorMap, optional
tags : list of Tag, optional
matcher : ScanMatcher, optional
    With it, scans on the map tell the heading while it is lost.
landmarks : LandmarkSight, optional

Raises
------
ValueError
    If a config is out of range.

Examples
--------
>>> from locfuse import *
>>> posts = LandmarkMap([Landmark(0, [3, 0]), Landmark(1, [0, 4]), Landmark(2, [-2, 1])])
>>> ekf = RecoveringEkf(RecoveringEkfConfig(), landmarks=LandmarkSight(posts))
>>> ekf.is_lost
True
>>> _ = ekf.on_joint([RangeBearing(0, None, 3.0, 0.0), RangeBearing(0, None, 4.0, 1.5708),
...                   RangeBearing(0, None, 2.2361, 2.6779)])
>>> ekf.is_lost, abs(round(ekf.state().hypotheses[0].estimate.pose.x, 2))
(False, 0.0)
)")
      .def(py::init([](const Config& config,
                       const std::optional<std::shared_ptr<locfuse::AnchorMap>>& anchors,
                       std::vector<locfuse::Tag> tags,
                       const std::optional<std::shared_ptr<locfuse::ScanMatcher>>& matcher,
                       const std::optional<locfuse::LandmarkSight>& landmarks) {
             return RecoveringEkf(config,
                                  anchors ? *anchors : std::make_shared<locfuse::AnchorMap>(),
                                  std::move(tags), matcher.value_or(nullptr),
                                  landmarks.value_or(locfuse::LandmarkSight{}));
           }),
           py::arg("config"), py::arg("anchors") = py::none(),
           py::arg("tags") = std::vector<locfuse::Tag>{}, py::arg("matcher") = py::none(),
           py::arg("landmarks") = py::none())
      .def("start_at", &RecoveringEkf::start_at, py::arg("start"),
           "Tracks from a PoseEstimate on.\n\nRaises\n------\nValueError\n    As a PoseEkf does.")
      .def("on", py::overload_cast<const locfuse::Velocity&>(&RecoveringEkf::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::Increment&>(&RecoveringEkf::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::Range&>(&RecoveringEkf::on), py::arg("message"))
      .def("on", py::overload_cast<const locfuse::PositionFix&>(&RecoveringEkf::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::PoseObservation&>(&RecoveringEkf::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::RangeBearing&>(&RecoveringEkf::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::LaserScan&>(&RecoveringEkf::on),
           py::arg("message"), py::call_guard<py::gil_scoped_release>(),
           "Takes one message. While lost its outcome is IGNORED: it weighs hypotheses.")
      .def("on_joint", &RecoveringEkf::on_joint, py::arg("sightings"),
           py::arg_v("association", locfuse::Association::kJoint, "Association.JOINT"),
           "Takes sightings of one stamp. Returns an outcome for each.")
      .def("state", &RecoveringEkf::state,
           "READY while it tracks; otherwise how far the start has come, with its hypotheses.")
      .def_property_readonly("is_lost", &RecoveringEkf::is_lost)
      .def_property_readonly("alarms", &RecoveringEkf::alarms,
                             "How often it noticed that it was lost.")
      .def(
          "estimator",
          [](const RecoveringEkf& ekf) {
            return ekf.estimator() == nullptr ? std::nullopt : std::optional(*ekf.estimator());
          },
          "A snapshot of the PoseEkf that tracks, or None.")
      .def("__repr__", [](const RecoveringEkf& ekf) {
        return "RecoveringEkf(" + std::string(ekf.is_lost() ? "lost" : "tracking") + ", " +
               std::to_string(ekf.alarms()) + " alarms)";
      });
}
