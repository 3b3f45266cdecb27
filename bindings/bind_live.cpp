// SPDX-License-Identifier: Apache-2.0
#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/replay/live.hpp"

namespace py = pybind11;
using locfuse::Live;

void bind_live(py::module_& m) {
  py::class_<Live>(m, "Live",
                   R"(A RecoveringEkf on a robot: messages as they arrive, from the first one on.

It searches until one place is left; from there late messages are fused where they belong. Fed with
a log in its order of arrival it gives the estimates of `find_start` and `replay`, bit for bit, if
none came later than `patience` while it searched.

Parameters
----------
estimator : RecoveringEkf
    It tracks from the beginning if this one has started.
history : int
    How late a message may be once it tracks, nanoseconds.
clock_jump : ClockJump
    What to do when the clock of all messages goes back.
most_messages : int
    Held for late ones, at least 512.
patience : int
    How late a message may be while it searches, nanoseconds.

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
                       locfuse::ClockJump clock_jump, std::size_t most_messages,
                       locfuse::Stamp patience) {
             Live::Options options;
             options.history = history;
             options.timeline.clock_jump = clock_jump;
             options.timeline.most_messages = most_messages;
             options.patience = patience;
             return Live(estimator, options);
           }),
           py::arg("estimator"), py::arg("history") = Live::Options{}.history,
           py::arg_v("clock_jump", locfuse::ClockJump::kRefuse, "ClockJump.REFUSE"),
           py::arg("most_messages") = locfuse::TimelineOptions{}.most_messages,
           py::arg("patience") = Live::Options{}.patience)
      .def("on", unlocked_on<Live, locfuse::LaserScan>(), py::arg("scan"),
           "Takes a scan, which is of use while it searches.")
      .def("on", unlocked_on<Live, locfuse::Message>(), py::arg("message"),
           R"(Takes a message and returns its Outcome.

IGNORED while it searches and from a source that is off, STALE if it is too late.

Raises
------
ValueError
    If the message is not valid; it is forgotten.
)")
      .def("start_at", &Live::start_at, py::arg("start"),
           "Tracks from a PoseEstimate on, whatever was known before.")
      .def("relocalize", &Live::relocalize, "Forgets the pose and searches anew.")
      .def("reset", &Live::reset, "As it was made.")
      .def("enable", &Live::enable, py::arg("source"), py::arg("enabled"),
           "Switches a Source off, or on again: while it is off its messages are IGNORED.")
      .def_property_readonly("is_tracking", &Live::is_tracking)
      .def(
          "current", [](const Live& live) { return live.estimator().current(); },
          "The PoseEstimate at the stamp of the last message. Raises RuntimeError while it "
          "searches.")
      .def(
          "estimate", [](const Live& live) { return live.estimator().estimate(); },
          "Likewise, carried to the end of odometry.")
      .def(
          "health", [](const Live& live) { return live.estimator().health(); },
          "A HealthReport: how far its estimate may be trusted.")
      .def_property_readonly(
          "sources", [](const Live& live) { return live.estimator().sources(); },
          "A SourceStatus for each.")
      .def("search", &Live::search, "How far the search has come, with its hypotheses.")
      .def_property_readonly(
          "errors",
          [](const Live& live) {
            return live.is_tracking() ? live.estimator().estimator()->errors()
                                      : std::vector<locfuse::CalibratedError>{};
          },
          "A CalibratedError for each error that is a state, as learnt by now.")
      .def_property_readonly(
          "restarts", [](const Live& live) { return live.estimator().restarts(); },
          "How often it was lost and found another place.")
      .def_property_readonly("jumps", &Live::jumps,
                             "How often the clock went back and it started anew or went on.")
      .def_property_readonly("fallen_out", &Live::fallen_out,
                             "Messages inside the history that were forgotten: too many.")
      .def("__repr__", [](const Live& live) {
        return std::string("Live(") + (live.is_tracking() ? "tracking" : "searching") + ")";
      });
}
