// SPDX-License-Identifier: Apache-2.0
#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/replay/live.hpp"
#include "locfuse/replay/live_mcl.hpp"
#include "particles.hpp"

namespace py = pybind11;
using locfuse::Live;
using locfuse::LiveMcl;

namespace {

/// Estimates after the scans whose turn it has been, other than stale ones.
class Estimates {
 public:
  explicit Estimates(const LiveMcl& mcl) : mcl_(mcl) {
    observer_.scanned = [this](const locfuse::LaserScan& /*scan*/,
                               const locfuse::Outcome& outcome) {
      if (outcome.verdict != locfuse::Verdict::kStale) {
        all_.push_back(mcl_.estimate());
      }
    };
  }
  Estimates(const Estimates&) = delete;
  Estimates& operator=(const Estimates&) = delete;
  ~Estimates() = default;
  [[nodiscard]] const LiveMcl::Observer& observer() const { return observer_; }
  [[nodiscard]] std::vector<locfuse::PoseEstimate> all() const { return all_; }

 private:
  const LiveMcl& mcl_;
  std::vector<locfuse::PoseEstimate> all_;
  LiveMcl::Observer observer_;
};

template <class Estimator>
void bind_construction(py::class_<LiveMcl>& bound) {
  bound.def(py::init([](const Estimator& mcl, locfuse::Stamp history, locfuse::ClockJump clock_jump,
                        std::size_t max_messages) {
              LiveMcl::Options options;
              options.history = history;
              options.timeline.clock_jump = clock_jump;
              options.timeline.max_messages = max_messages;
              return LiveMcl(mcl, options);
            }),
            py::arg("mcl"), py::arg("history") = LiveMcl::Options{}.history,
            py::arg_v("clock_jump", locfuse::ClockJump::kRefuse, "ClockJump.REFUSE"),
            py::arg("max_messages") = locfuse::TimelineOptions{}.max_messages);
}

void bind_live_mcl(py::module_& m) {
  py::class_<LiveMcl> bound(m, "LiveMcl", R"(Mcl fed with live messages and scans as they arrive.

They wait until odometry has come that far, at most 0.25 s or as late as scans have been; what is
later still is fused at its stamp, to the same bits as if it had been in time.

Parameters
----------
mcl : Mcl or SwitchingMcl
    Copied.
history : int
    Maximum delay of a message [ns]; older ones are STALE.
clock_jump : ClockJump
    Reaction to a backward jump of the message clock.
max_messages : int
    Maximum number of messages kept for reordering, at least 512.

Raises
------
ValueError
    If an option is out of range.

Examples
--------
>>> import numpy as np
>>> from locfuse.core import *
>>> cells = np.zeros((40, 40), dtype=np.int8)
>>> cells[[0, -1], :] = cells[:, [0, -1]] = 100
>>> live = LiveMcl(Mcl(MclConfig(), World(grid=OccupancyGrid(cells, resolution=0.05))))
>>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
>>> live.on(Velocity(0, 0.0, 0.0)), live.on(LaserScan(5 * 10**7, around, [0.9, 0.9, 0.9, 0.9]))
([], [])
>>> len(live.on(Velocity(10**8, 0.0, 0.0)))  # the scan had waited for that
1
)");
  bind_construction<locfuse::Mcl>(bound);
  bind_construction<locfuse::SwitchingMcl>(bound);
  bind_state(bound, [](const LiveMcl& live) -> const locfuse::Mcl& { return live.mcl(); });
  bound
      .def(
          "on",
          [](LiveMcl& live, const locfuse::Message& message) {
            const Alone alone(&live);
            const Estimates estimates(live);
            live.on(message, estimates.observer());
            return estimates.all();
          },
          py::arg("message"),
          R"(Takes a message or a scan; returns a PoseEstimate for each scan whose turn it is now.

Raises
------
ValueError
    If the message is not valid; it is discarded.
)")
      .def(
          "on",
          [](LiveMcl& live, const std::vector<locfuse::MadeMotion>& motions) {
            const Alone alone(&live);
            const Estimates estimates(live);
            live.on(motions, estimates.observer());
            return estimates.all();
          },
          py::arg("motions"),
          "Takes the motions that one message changed, of an OdometryTimeline; returns as above.")
      .def(
          "finish",
          [](LiveMcl& live) {
            const Alone alone(&live);
            const Estimates estimates(live);
            live.finish(estimates.observer());
            return estimates.all();
          },
          "Uses all messages that wait, and returns as `on` does.")
      .def(
          "go_on_from",
          [](LiveMcl& live, const LiveMcl& before) {
            const LiveMcl from = before;  // a copy, as other threads may use it
            const Alone alone(&live);
            const Estimates estimates(live);
            live.go_on_from(from, estimates.observer());
            return estimates.all();
          },
          py::arg("before"),
          "Takes the messages that wait in another, whose pose this one has; returns as `on` does.")
      .def_property_readonly(
          "injections",
          [](const LiveMcl& live) {
            const locfuse::SwitchingMcl* both = live.switching();
            return both != nullptr ? both->injections()
                                   : std::vector<locfuse::SwitchingMcl::Injection>{};
          },
          "List of Injection, one per takeover by UWB.")
      .def_property_readonly("jumps", &LiveMcl::jumps,
                             "Number of backward clock jumps handled by RESET or CONTINUE.")
      .def_property_readonly(
          "dropped_messages", &LiveMcl::dropped_messages,
          "Messages inside the history that were dropped because there were too many.")
      .def("__repr__", [](const LiveMcl& live) {
        return "LiveMcl(" + std::to_string(live.mcl().belief().size) + " particles, " +
               std::to_string(live.waiting()) + " messages waiting)";
      });
}

}  // namespace

void bind_live(py::module_& m) {
  bind_live_mcl(m);
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
>>> live = Live(RecoveringEkf(RecoveringEkfConfig(), World()))
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
      .def("on", unlocked_on<Live, std::vector<locfuse::MadeMotion>>(), py::arg("motions"),
           "Processes the motions that one message changed, of an OdometryTimeline; returns the "
           "Outcome of the first. STALE where one that is made again is no longer kept.")
      .def("on", unlocked_on<Live, locfuse::Message>(), py::arg("message"),
           R"(Processes a message and returns its Outcome.

IGNORED while searching, from a disabled source and of a scan, which only the search uses; STALE if
too late.

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
      .def(
          "watched", [](const Live& live) { return live.estimator().watched(); },
          "WatchReport of the poses that it watches, or None unless it watches poses.")
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
