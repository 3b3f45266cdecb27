// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "bindings.hpp"
#include "locfuse/recovery/pose_watch.hpp"

namespace py = pybind11;
using locfuse::PoseWatch;
using locfuse::WatchReason;
using locfuse::WatchReport;

void bind_pose_watch(py::module_& m) {
  py::native_enum<WatchReason>(m, "WatchReason", "enum.Enum",
                               "Reason why watched poses are not OK.")
      .value("NONE", WatchReason::kNone)
      .value("NO_ESTIMATE", WatchReason::kNoEstimate, "No estimate to judge them by yet.")
      .value("NO_POSE", WatchReason::kNoPose, "No pose received yet.")
      .value("FAR_OFF", WatchReason::kFarOff, "Too far from the estimate.")
      .value("CONTRADICTED", WatchReason::kContradicted,
             "Measurements contradict the place on which both agree.")
      .value("JUMPED", WatchReason::kJumped, "Moved as odometry did not.")
      .value("SIGMAS_TOO_SMALL", WatchReason::kSigmasTooSmall,
             "Near, but farther off than their covariance says.")
      .value("SILENT", WatchReason::kSilent, "No pose for some time, though the robot moved.")
      .value("UNVERIFIED", WatchReason::kUnverified,
             "The estimate is too vague, or lost somewhere else.")
      .finalize();
  py::class_<WatchReport>(m, "WatchReport", "How far watched poses may be trusted.")
      .def(py::init<>(), "INITIALIZING: there is no estimate yet.")
      .def_readonly("stamp", &WatchReport::stamp, "[ns].")
      .def_readonly("state", &WatchReport::state, "HealthState.")
      .def_readonly("reason", &WatchReport::reason, "WatchReason.")
      .def_readonly("judged", &WatchReport::judged, "Stamp of the last pose judged [ns], or None.")
      .def_readonly("wrong", &WatchReport::wrong, "1 - within.")
      .def_readonly("within", &WatchReport::within,
                    "Probability that position and heading errors are below their limits.")
      .def_readonly("error", &WatchReport::error,
                    "The last pose, carried on by odometry, less the estimate: x [m], y [m], "
                    "heading [rad], (3,); NaN without both.")
      .def_readonly("protection", &WatchReport::protection,
                    "Protection levels of x [m], y [m] and heading [rad], (3,): |error| exceeds "
                    "them at most with probability `risk`; infinite if no bound is known.")
      .def("__repr__", [](const WatchReport& r) {
        return "WatchReport(" + std::string(py::str(py::cast(r.state).attr("name"))) + ", within " +
               std::to_string(r.within) + ")";
      });
  using Config = PoseWatch::Config;
  py::class_<Config>(m, "PoseWatchConfig", "Limits and models of a PoseWatch.")
      .def(py::init<>())
      .def_readwrite("health", &Config::health, "HealthConfig: limits and probabilities.")
      .def_readwrite("pose", &Config::pose, "PoseConfig: sigmas of the poses.")
      .def_readwrite("odometry", &Config::odometry, "OdometryConfig.")
      .def_readwrite("limits", &Config::limits, "Limits.")
      .def_readwrite("hold_s", &Config::hold_s, "Odometry timeout [s].");
  py::class_<PoseWatch>(m, "PoseWatch",
                        R"(Judges the poses of another localizer by an estimate without them.

Derivation: docs/watch.md.

Raises
------
ValueError
    If a setting is out of range.)")
      .def(py::init<const Config&>(), py::arg("config"))
      .def_property_readonly_static(
          "max_heading_error", [](const py::object&) { return PoseWatch::kMaxHeadingError; },
          "Limit of the heading's error [rad].")
      .def("on", py::overload_cast<const locfuse::Velocity&>(&PoseWatch::on), py::arg("u"),
           "Takes odometry that the estimator has taken.")
      .def("on", py::overload_cast<const locfuse::Increment&>(&PoseWatch::on), py::arg("u"))
      .def("on",
           py::overload_cast<const locfuse::PoseObservation&, const locfuse::PoseEstimate&,
                             const locfuse::HealthReport&>(&PoseWatch::on),
           py::arg("z"), py::arg("estimate"), py::arg("health"),
           "Takes a pose, with the PoseEstimate at its stamp and the HealthReport of that. Returns "
           "an Outcome: IGNORED, WATCHED, with the numbers of its innovation.")
      .def("report", &PoseWatch::report, py::arg("estimate"), py::arg("health"),
           "WatchReport at the stamp of a PoseEstimate.");
}
