// SPDX-License-Identifier: Apache-2.0
#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/replay/live.hpp"

namespace py = pybind11;
using locfuse::Live;

void bind_live(py::module_& m) {
  py::class_<Live>(m, "Live",
                   R"(RecoveringEkf fed with live messages in order of arrival.

It searches until a single hypothesis remains; from then on late messages are fused at their stamp.
A log fed in order of arrival gives the estimates of `find_start` and `replay` bit for bit, if no
message was later than `patience` during the search.

Parameters
----------
estimator : RecoveringEkf
    If it has started, tracking begins at once.
history : int
    Maximum delay of a message while tracking [ns].
clock_jump : ClockJump
    Reaction to a backward jump of the message clock.
max_messages : int
    Maximum number of messages kept for reordering, at least 512.
patience : int
    Maximum delay of a message while searching [ns].

Raises
------
ValueError
    If an option is out of range.

Examples
--------
>>> import numpy as np
>>> from locfuse import *
>>> live = Live(RecoveringEkf(RecoveringEkfConfig()))
>>> live.start_at(PoseEstimate(0, Pose2(1, 2, 0), 0.01 * np.eye(3)))
>>> live.on(PositionFix(0, [1.05, 2.0], 0.01 * np.eye(2))).verdict.name
'FUSED'
>>> live.current().stamp
0
)")
      .def(py::init([](const locfuse::RecoveringEkf& estimator, locfuse::Stamp history,
                       locfuse::ClockJump clock_jump, std::size_t max_messages,
                       locfuse::Stamp patience) {
             Live::Options options;
             options.history = history;
             options.timeline.clock_jump = clock_jump;
             options.timeline.max_messages = max_messages;
             options.patience = patience;
             return Live(estimator, options);
           }),
           py::arg("estimator"), py::arg("history") = Live::Options{}.history,
           py::arg_v("clock_jump", locfuse::ClockJump::kRefuse, "ClockJump.REFUSE"),
           py::arg("max_messages") = locfuse::TimelineOptions{}.max_messages,
           py::arg("patience") = Live::Options{}.patience)
      .def("on", unlocked_on<Live, locfuse::LaserScan>(), py::arg("scan"),
           "Processes a scan, which is used only while searching.")
      .def("on", unlocked_on<Live, locfuse::Message>(), py::arg("message"),
           R"(Processes a message and returns its Outcome.

IGNORED while searching or from a disabled source, STALE if too late.

Raises
------
ValueError
    If the message is not valid; it is discarded.
)")
      .def("start_at", &Live::start_at, py::arg("start"),
           "Discards the current state and tracks from a PoseEstimate.")
      .def("relocalize", &Live::relocalize, "Discards the pose and searches again.")
      .def("reset", &Live::reset, "Restores the state after construction.")
      .def("enable", &Live::enable, py::arg("source"), py::arg("enabled"),
           "Enables or disables a Source; messages of a disabled source are IGNORED.")
      .def_property_readonly("is_tracking", &Live::is_tracking)
      .def(
          "current", [](const Live& live) { return live.estimator().current(); },
          "PoseEstimate at the stamp of the last message. Raises RuntimeError while searching.")
      .def(
          "estimate", [](const Live& live) { return live.estimator().estimate(); },
          "PoseEstimate propagated to the end of the latest odometry. Raises RuntimeError while "
          "searching.")
      .def(
          "current_in_space", [](const Live& live) { return live.estimator().current_in_space(); },
          "AirEstimate at the stamp of the last message, or None of a filter in the plane. Raises "
          "RuntimeError while searching.")
      .def(
          "estimate_in_space",
          [](const Live& live) { return live.estimator().estimate_in_space(); },
          "The same propagated to the end of the latest odometry.")
      .def(
          "health", [](const Live& live) { return live.estimator().health(); },
          "HealthReport of the estimate.")
      .def_property_readonly(
          "sources", [](const Live& live) { return live.estimator().sources(); },
          "One SourceStatus per source.")
      .def("search", &Live::search, "Progress of the search with its hypotheses.")
      .def_property_readonly(
          "errors",
          [](const Live& live) {
            const locfuse::PoseEkf* ekf = live.estimator().estimator();
            return ekf != nullptr ? ekf->errors() : std::vector<locfuse::CalibratedError>{};
          },
          "A CalibratedError for each error that is a state of a PoseEkf.")
      .def_property_readonly(
          "landmarks",
          [](const Live& live) {
            const auto* ekf = std::get_if<locfuse::LandmarkEkf>(live.estimator().tracker());
            return ekf != nullptr ? ekf->landmarks() : std::vector<locfuse::LandmarkEstimate>{};
          },
          "The map of a LandmarkEkf: one LandmarkEstimate per landmark.")
      .def_property_readonly(
          "restarts", [](const Live& live) { return live.estimator().restarts(); },
          "Number of relocalizations after being lost.")
      .def_property_readonly("jumps", &Live::jumps,
                             "Number of backward clock jumps handled by RESET or CONTINUE.")
      .def_property_readonly(
          "dropped_messages", &Live::dropped_messages,
          "Messages inside the history that were dropped because there were too many.")
      .def("__repr__", [](const Live& live) {
        return std::string("Live(") + (live.is_tracking() ? "tracking" : "searching") + ")";
      });
}
