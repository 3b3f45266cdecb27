// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>

#include "bindings.hpp"
#include "columns.hpp"
#include "locfuse/replay/replay.hpp"
#include "locfuse/smoothing/smoother.hpp"
#include "shared_log.hpp"

namespace py = pybind11;
using locfuse::Smoothed;

namespace {

/// One more than the place of the last odometry that takes effect up to a stamp; 0 without any.
std::size_t odometry_at(const locfuse::MessageLog& log, const std::vector<bool>& replaced,
                        locfuse::Stamp stamp) {
  std::size_t found = 0;
  locfuse::Stamp latest = std::numeric_limits<locfuse::Stamp>::min();
  for (std::size_t i = 0; i < log.arrivals().size(); ++i) {
    const locfuse::Message& message = log.arrivals()[i].message;
    const bool counts = replaced.empty() || !replaced[i];
    if (counts && source_of(message) == locfuse::Source::kOdometry &&
        effective_stamp(message) <= stamp && effective_stamp(message) >= latest) {
      latest = effective_stamp(message);
      found = i + 1;
    }
  }
  return found;
}

Smoothed smooth(const locfuse::PoseEkf::Config& config, const locfuse::World& world,
                const locfuse::PoseEstimate& start, SharedLog& log,
                std::optional<locfuse::Stamp> used_until, double keyframe_s, int max_iterations) {
  const Use use(log, Use::Kind::kRead);
  const locfuse::SmootherConfig settings{config, keyframe_s, max_iterations};
  const py::gil_scoped_release release;
  std::vector<locfuse::Message> messages;
  std::vector<std::size_t> places;  // of them in the log
  messages.reserve(log.log.arrivals().size());
  const std::vector<bool> replaced = log.log.replaced();
  const std::size_t under_way = used_until ? odometry_at(log.log, replaced, *used_until) : 0;
  for (std::size_t i = 0; i < log.log.arrivals().size(); ++i) {
    if (!replaced.empty() && replaced[i]) {
      continue;
    }
    locfuse::Message message = log.log.arrivals()[i].message;
    if (used_until && i + 1 == under_way) {
      if (auto* velocity = std::get_if<locfuse::Velocity>(&message)) {
        velocity->stamp = std::max(velocity->stamp, start.stamp);
      }
      messages.push_back(message);
      places.push_back(i);
    } else if (!used_until || effective_stamp(message) > *used_until) {
      messages.push_back(message);
      places.push_back(i);
    }
  }
  Smoothed found = locfuse::smooth(settings, world, start, messages);
  std::vector<locfuse::Outcome> outcomes(log.log.arrivals().size());  // kIgnored
  for (std::size_t i = 0; i < replaced.size(); ++i) {
    outcomes[i].reason = replaced[i] ? locfuse::Reason::kReplaced : locfuse::Reason::kNone;
  }
  for (std::size_t k = 0; k < places.size(); ++k) {
    outcomes[places[k]] = found.outcomes[k];
  }
  found.outcomes = std::move(outcomes);
  return found;
}

/// The run of a filter with what the smoother says in place of its estimates and outcomes.
locfuse::RunLog in_place_of(const Smoothed& smoothed, locfuse::RunLog run) {
  run.outcomes = smoothed.outcomes;
  run.estimates = smoothed.poses;
  run.last = smoothed.poses.back();
  run.errors = smoothed.errors;
  return run;
}

}  // namespace

void bind_smoothing(py::module_& m) {
  py::class_<Smoothed> bound(m, "Smoothed", "What all messages of a log together say.");
  bind_outcome_columns(bound);
  bind_estimate_columns(
      bound, [](const Smoothed& s) -> const auto& { return s.poses; });
  bound.def_readonly("errors", &Smoothed::errors, "A CalibratedError per offset of an anchor.")
      .def_readonly("initial_cost", &Smoothed::initial_cost)
      .def_readonly("cost", &Smoothed::cost, "Half the sum of squared residuals in sigmas.")
      .def_readonly("iterations", &Smoothed::iterations)
      .def_readonly("converged", &Smoothed::converged)
      .def_readonly("termination", &Smoothed::termination, "What the solver said last.")
      .def("in_place_of", &in_place_of, py::arg("run"),
           "RunLog of a filter with these estimates and outcomes instead of its own.")
      .def("__repr__", [](const Smoothed& s) {
        return "Smoothed(" + std::to_string(s.poses.size()) + " poses, cost " +
               std::to_string(s.cost) + ")";
      });
  m.def("smooth", &smooth, py::arg("config"), py::arg("world"), py::arg("start"), py::arg("log"),
        py::arg("used_until") = py::none(),
        py::arg("keyframe_s") = locfuse::SmootherConfig{}.keyframe_s,
        py::arg("max_iterations") = locfuse::SmootherConfig{}.max_iterations,
        R"(Find all poses of a log at once, by all of its messages (docs/smoothing.md).

Parameters
----------
config : PoseEkfConfig
    Models, gates and noise.
world : World
start : PoseEstimate
log : MessageLog
used_until : int, optional
    Messages that take effect up to this stamp were used for the start and stay IGNORED [ns].
keyframe_s : float
    Without measurements there is a pose at least so often [s].
max_iterations : int
    Of the solver, each time it is called.

Returns
-------
Smoothed
    Poses at the stamps of measurements, and between.

Raises
------
ValueError
    If the config is out of range, or nothing was measured after the start.
NumericalError
    If the solver fails.

Examples
--------
>>> import numpy as np
>>> from locfuse.core import *
>>> log = MessageLog()
>>> log.add_velocities([0], [1.0], [0.0])
>>> log.add_positions([2 * 10**9], [[2.2, 0.0]], [0.1])
>>> start = PoseEstimate(0, Pose2(0, 0, 0), 0.01 * np.eye(3))
>>> batch = smooth(PoseEkfConfig(), World(), start, log)
>>> bool(batch.poses[0, 0] > 0.0 and batch.poses[-1, 0] > 2.0)
True
)");
}
