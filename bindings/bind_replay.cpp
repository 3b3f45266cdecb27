// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include <algorithm>
#include <tuple>

#include "alone.hpp"
#include "bindings.hpp"
#include "columns.hpp"
#include "locfuse/replay/localize.hpp"
#include "locfuse/replay/replay.hpp"
#include "locfuse/replay/start.hpp"
#include "numpy.hpp"
#include "shared_log.hpp"

namespace py = pybind11;
using locfuse::AirEstimate;
using locfuse::LocalizeRun;
using locfuse::Outcome;
using locfuse::PoseEkf;
using locfuse::PoseEstimate;
using locfuse::RecoveringEkf;
using locfuse::RunLog;
using locfuse::Stamp;

namespace {

std::vector<PoseEstimate> estimates_of(const LocalizeRun& run) {
  std::vector<PoseEstimate> estimates;
  estimates.reserve(run.steps.size());
  for (const LocalizeRun::Step& step : run.steps) {
    estimates.push_back(step.estimate);
  }
  return estimates;
}

/// A part of each estimate in space, of that shape, where it has one.
template <int... Shape, class Part>
py::array_t<double> in_space(const RunLog& run, const Part& part) {
  constexpr std::size_t kSize = (std::size_t{Shape} * ...);
  std::vector<double> rows;
  rows.reserve(kSize * run.in_space.size());
  for (const AirEstimate& estimate : run.in_space) {
    if (const double* values = part(estimate)) {
      rows.insert(rows.end(), values, values + kSize);
    }
  }
  const auto n = static_cast<py::ssize_t>(rows.size() / kSize);
  return to_numpy(std::move(rows), {n, Shape...});
}

/// Binds the columns of health reports: `items_of` gives the rows of a run, `health_of` the report
/// of each row.
template <class Run, class ItemsOf, class HealthOf>
void bind_health_columns(py::class_<Run>& bound, const ItemsOf& items_of,
                         const HealthOf& health_of) {
  const auto column = [&](const char* name, const auto& value_of, const char* doc) {
    using Value = std::decay_t<decltype(value_of(std::declval<const locfuse::HealthReport&>()))>;
    bound.def_property_readonly(
        name,
        [=](const Run& r) {
          return column_of<Value>(items_of(r),
                                  [&](const auto& item) { return value_of(health_of(item)); });
        },
        doc);
  };
  column(
      "health_stamp_ns", [](const auto& h) { return h.stamp; },
      "Stamps of the health reports, (k,).");
  column(
      "health_state", [](const auto& h) { return static_cast<std::uint8_t>(h.state); },
      "Index into HealthState, (k,).");
  column(
      "health_reason", [](const auto& h) { return static_cast<std::uint8_t>(h.reason); },
      "Index into HealthReason, (k,).");
  column(
      "wrong", [](const auto& h) { return h.wrong; }, "Probability that the pose is wrong, (k,).");
  column(
      "within", [](const auto& h) { return h.within; },
      "Probability that the position error is below the limit, (k,).");
  bound
      .def_property_readonly(
          "health_source",
          [=](const Run& r) {
            std::vector<std::optional<locfuse::NamedSource>> sources;
            sources.reserve(items_of(r).size());
            for (const auto& item : items_of(r)) {
              sources.push_back(health_of(item).source);
            }
            return sources;
          },
          "Source that the reason refers to, or None; k items.")
      .def_property_readonly(
          "protection",
          [=](const Run& r) {
            std::vector<double> rows;
            rows.reserve(3 * items_of(r).size());
            for (const auto& item : items_of(r)) {
              const auto& levels = health_of(item).protection;
              rows.insert(rows.end(), levels.data(), levels.data() + 3);
            }
            return to_numpy(std::move(rows), {static_cast<py::ssize_t>(items_of(r).size()), 3});
          },
          "Protection levels of x, y [m] and heading [rad], (k, 3).");
}

/// Progress callback: number of processed messages, and a function that returns a copy of the run.
template <class Run>
using Progress = std::optional<std::function<void(std::size_t, std::function<Run()>)>>;

/// Wraps `progress` in a callback that acquires the GIL; empty if there is none.
template <class Run>
std::function<void(std::size_t, const Run&)> progress_of(const Progress<Run>& report) {
  if (!report) {
    return {};
  }
  return [&report](std::size_t done, const Run& so_far) {
    const py::gil_scoped_acquire acquire;
    // Python may keep the copy function longer than the run exists.
    const auto lent = std::make_shared<const Run*>(&so_far);
    struct TakeBack {
      const Run** lent;
      ~TakeBack() { *lent = nullptr; }
    } const take_back{lent.get()};
    (*report)(done, [lent]() -> Run {
      if (*lent == nullptr) {
        throw std::runtime_error(
            "a copy of the run was requested after the progress callback had returned");
      }
      return **lent;
    });
  };
}

using Switches = std::vector<std::tuple<Stamp, locfuse::Source, bool>>;

template <class Estimator>
RunLog run(const Estimator& start, SharedLog& log, Stamp history, bool record,
           const Progress<RunLog>& progress, std::optional<Stamp> used_until,
           locfuse::ClockJump clock_jump, std::size_t max_messages, const Switches& switches) {
  locfuse::ReplayOptions options;
  options.timeline.clock_jump = clock_jump;
  options.timeline.max_messages = max_messages;
  options.switches.reserve(switches.size());
  for (const auto& [arrival, source, enabled] : switches) {
    options.switches.push_back({arrival, source, enabled});
  }
  std::stable_sort(options.switches.begin(), options.switches.end(),
                   [](const auto& a, const auto& b) { return a.arrival < b.arrival; });
  options.used_until = used_until.value_or(options.used_until);
  options.history = history;
  options.record = record;
  options.progress = progress_of<RunLog>(progress);
  const Use use(log, Use::Kind::kRead);
  const Estimator from = start;  // a copy, as other threads may use it
  const py::gil_scoped_release release;
  return locfuse::replay(from, log.log, options);
}

}  // namespace

void bind_replay(py::module_& m) {
  py::class_<RunLog> run_log(m, "RunLog", "Result of a replay, as columns.");
  bind_health_columns(
      run_log, [](const RunLog& r) -> const auto& { return r.health; },
      [](const locfuse::HealthReport& h) -> const auto& { return h; });
  bind_outcome_columns(run_log);
  bind_estimate_columns(
      run_log, [](const RunLog& r) -> const auto& { return r.estimates; });
  run_log
      .def_property_readonly(
          "heights",
          [](const RunLog& r) {
            return column_of<double>(r.in_space, [](const auto& e) { return e.height; });
          },
          "Heights of the estimates of an AirEkf [m], (n,); else empty.")
      .def_property_readonly(
          "covariances_in_space",
          [](const RunLog& r) {
            return in_space<4, 4>(r, [](const AirEstimate& e) { return e.covariance.data(); });
          },
          "Of (x, y, heading, height), (n, 4, 4); else empty.")
      .def_property_readonly(
          "orientations",
          [](const RunLog& r) {
            return in_space<4>(r, [](const AirEstimate& e) {
              return e.attitude ? e.attitude->quaternion.data() : nullptr;
            });
          },
          "Unit quaternions (w, x, y, z) from body to world of an inertial AirEkf, (n, 4); else "
          "empty.")
      .def_property_readonly(
          "orientation_covariances",
          [](const RunLog& r) {
            return in_space<3, 3>(r, [](const AirEstimate& e) {
              return e.attitude ? e.attitude->covariance.data() : nullptr;
            });
          },
          "Of their errors, rotations about the axes of the world [rad^2], (n, 3, 3); else empty.")
      .def_property_readonly(
          "interventions",
          [](const RunLog& r) {
            return column_of<std::int64_t>(r.outcomes,
                                           [](const Outcome& o) { return o.interventions; });
          },
          "Number of variances clamped to their bounds, per message.")
      .def_readonly("jumps", &RunLog::jumps,
                    "Number of backward clock jumps; the estimates are those after the last.")
      .def_readonly("dropped_messages", &RunLog::dropped_messages,
                    "Messages inside the history that were dropped because there were too many.")
      .def_readonly("last", &RunLog::last, "The estimate at the end of the log.")
      .def_readonly("errors", &RunLog::errors,
                    "A CalibratedError for each error that is a state, at the end of the log.")
      .def_readonly("landmarks", &RunLog::landmarks,
                    "The map of a LandmarkEkf, a LandmarkEstimate each, at the end of the log.")
      .def(
          "noise_factor",
          [](const RunLog& r, locfuse::Source source) { return r.adaptive.factor(source); },
          py::arg("source"),
          "Factor on the variances of a Source at the end of the log; 1 unless adaptive.")
      .def_readonly("watched", &RunLog::watched,
                    "A WatchReport with each health report where poses are watched; else empty.")
      .def_readonly("sources", &RunLog::sources,
                    "One SourceStatus per source, at the end of the log.")
      .def_readonly("alarms", &RunLog::alarms, "Number of times the estimate was declared lost.")
      .def_readonly("restarts", &RunLog::restarts, "Number of relocalizations.")
      .def("__repr__", [](const RunLog& r) {
        return "RunLog(" + std::to_string(r.outcomes.size()) + " messages, " +
               std::to_string(r.estimates.size()) + " estimates)";
      });
  using Step = locfuse::StartRun::Step;
  py::class_<Step>(m, "StartStep", "Change of state during initialization.")
      .def_readonly("stamp", &Step::stamp, "[ns].")
      .def_readonly("state", &Step::state);
  py::class_<locfuse::StartRun>(m, "StartRun", "Course of an initialization.")
      .def_readonly("used_until", &locfuse::StartRun::used_until,
                    "Messages that take effect up to this stamp [ns] were used.")
      .def_readonly("steps", &locfuse::StartRun::steps,
                    "One step per change of status or of the number of hypotheses.");
  m.def(
      "find_start",
      [](locfuse::Initializer& initializer, SharedLog& log,
         const std::vector<locfuse::LaserScan>& scans) {
        const Use use(log, Use::Kind::kRead);
        const Alone alone(&initializer);
        return locfuse::find_start(initializer, log.log, scans);
      },
      py::arg("initializer"), py::arg("log"), py::arg("scans"),
      "Feeds a sorted log and scans to an Initializer until it is READY or both end.");
  using Report = LocalizeRun::Report;
  py::class_<Report>(m, "LocalizeReport", "Pose after the turn of a scan, as a robot has it.")
      .def_property_readonly(
          "arrival",
          [](const Report& r) -> std::optional<Stamp> {
            return r.arrival == LocalizeRun::kAtEnd ? std::nullopt : std::optional(r.arrival);
          },
          "Of the message that gave the scan its turn [ns]; None if the log ended first.")
      .def_readonly("estimate", &Report::estimate, "PoseEstimate.")
      .def_readonly("ready", &Report::ready, "Whether one cluster was almost certain.");
  py::class_<LocalizeRun> localize_run(m, "LocalizeRun",
                                       "Result of a localization on a map, as columns.");
  bind_health_columns(
      localize_run, [](const LocalizeRun& r) -> const auto& { return r.steps; },
      [](const LocalizeRun::Step& step) -> const auto& { return step.health; });
  bind_outcome_columns(localize_run);
  localize_run
      .def_property_readonly(
          "scan_verdict", [](const LocalizeRun& r) { return verdicts_of(r.scan_outcomes); },
          "Index into Verdict, one per scan.")
      .def_property_readonly(
          "scan_reason", [](const LocalizeRun& r) { return reasons_of(r.scan_outcomes); },
          "Index into Reason, one per scan.")
      .def_property_readonly(
          "stamp_ns",
          [](const LocalizeRun& r) {
            return column_of<Stamp>(r.steps, [](const auto& s) { return s.estimate.stamp; });
          },
          "Stamps of the estimates, (n,).")
      .def_property_readonly(
          "poses", [](const LocalizeRun& r) { return poses_of(estimates_of(r)); },
          "x, y, heading, (n, 3).")
      .def_property_readonly(
          "covariances", [](const LocalizeRun& r) { return covariances_of(estimates_of(r)); },
          "(n, 3, 3).")
      .def_property_readonly(
          "probability",
          [](const LocalizeRun& r) {
            return column_of<double>(r.steps, [](const auto& s) { return s.probability; });
          },
          "Probability of the likeliest hypothesis, (n,).")
      .def_property_readonly(
          "explained",
          [](const LocalizeRun& r) {
            return column_of<double>(r.steps, [](const auto& s) { return s.explained; });
          },
          "Fraction of the scan's returns that end at a wall, (n,).")
      .def_property_readonly(
          "particles",
          [](const LocalizeRun& r) {
            return column_of<std::int64_t>(r.steps, [](const auto& s) { return s.particles; });
          },
          "Number of particles, (n,).")
      .def_property_readonly(
          "sigma",
          [](const LocalizeRun& r) {
            return column_of<double>(r.steps, [](const auto& s) { return s.sigma; });
          },
          "Standard deviation of all particles along the worst direction [m], (n,).")
      .def_property_readonly(
          "ready",
          [](const LocalizeRun& r) {
            return column_of<bool>(r.steps, [](const auto& s) { return s.ready; });
          },
          "(n,).")
      .def_property_readonly(
          "watched",
          [](const LocalizeRun& r) {
            std::vector<locfuse::WatchReport> watched;
            for (const LocalizeRun::Step& step : r.steps) {
              if (step.watched) {
                watched.push_back(*step.watched);
              }
            }
            return watched;
          },
          "A WatchReport for each estimate where poses are watched; else empty.")
      .def_readonly("reports", &LocalizeRun::reports,
                    "A LocalizeReport for each scan that was not STALE, in order of turns.")
      .def("__repr__", [](const LocalizeRun& r) {
        return "LocalizeRun(" + std::to_string(r.outcomes.size()) + " messages, " +
               std::to_string(r.scan_outcomes.size()) + " scans)";
      });
  m.def(
      "localize",
      [](locfuse::LiveMcl& mcl, SharedLog& log, const std::vector<locfuse::LaserScan>& scans,
         const std::vector<Stamp>& scan_arrivals, const Progress<LocalizeRun>& progress) {
        const Use use(log, Use::Kind::kRead);
        const Alone alone(&mcl);
        return locfuse::localize(mcl, log.log, scans, scan_arrivals,
                                 progress_of<LocalizeRun>(progress));
      },
      py::arg("mcl"), py::arg("log"), py::arg("scans"),
      py::arg("scan_arrivals") = std::vector<Stamp>{}, py::arg("progress") = py::none(),
      R"(Feeds a log and scans to an Mcl in order of arrival, as they would come live.

Parameters
----------
mcl : LiveMcl
log : MessageLog
scans : list of LaserScan
scan_arrivals : list of int
    When each scan arrives [ns]; if empty at its stamp.
progress : callable, optional
    Called after each scan with the number of messages and scans processed and a function that
    returns a copy of the run during the call; it may read `mcl`. Items not processed yet have the
    verdict IGNORED.

Raises
------
ValueError
    If there are other than 0 or as many arrivals as scans.
)");
  m.def("replay", &run<PoseEkf>, py::arg("start"), py::arg("log"),
        py::arg("history") = locfuse::ReplayOptions{}.history, py::arg("record") = true,
        py::arg("progress") = py::none(), py::arg("used_until") = py::none(),
        py::arg_v("clock_jump", locfuse::ClockJump::kRefuse, "ClockJump.REFUSE"),
        py::arg("max_messages") = locfuse::TimelineOptions{}.max_messages,
        py::arg("switches") = Switches{});
  m.def("replay", &run<RecoveringEkf>, py::arg("start"), py::arg("log"),
        py::arg("history") = locfuse::ReplayOptions{}.history, py::arg("record") = true,
        py::arg("progress") = py::none(), py::arg("used_until") = py::none(),
        py::arg_v("clock_jump", locfuse::ClockJump::kRefuse, "ClockJump.REFUSE"),
        py::arg("max_messages") = locfuse::TimelineOptions{}.max_messages,
        py::arg("switches") = Switches{},
        R"(Feeds a sorted log to a copy of an estimator; late messages are fused at their stamp.

Parameters
----------
start : PoseEkf or RecoveringEkf
    A RecoveringEkf must have started.
log : MessageLog
history : int
    Maximum delay of a message [ns]; older ones are STALE.
record : bool
    Whether to keep outcomes and estimates, or only the last estimate.
progress : callable, optional
    Called from time to time with the number of messages processed and a function that returns a
    copy of the run during the call: outcomes, which late messages may still change, and estimates.
used_until : int, optional
    Messages that take effect up to this stamp [ns] were used for the initialization and are
    IGNORED.
clock_jump : ClockJump
    Reaction to a backward jump of the message clock.
max_messages : int
    Maximum number of messages kept for reordering, at least 512; `dropped_messages` counts the dropped.
switches : list of (int, Source, bool)
    Disables (False) or enables (True) a source from this arrival [ns].
)");
}
