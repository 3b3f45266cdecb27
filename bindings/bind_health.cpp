// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include <variant>

#include "bindings.hpp"
#include "locfuse/estimators/health.hpp"

namespace py = pybind11;
using locfuse::Health;
using locfuse::HealthClue;
using locfuse::HealthReport;
using locfuse::HealthState;
using locfuse::NamedSource;
using locfuse::SourceStatus;

namespace {

using Measurement = std::variant<locfuse::Range, locfuse::PositionFix, locfuse::PoseObservation,
                                 locfuse::RangeBearing>;

void bind_enums(py::module_& m) {
  py::native_enum<HealthState>(m, "HealthState", "enum.Enum", "How far an estimate may be trusted.")
      .value("INITIALIZING", HealthState::kInitializing, "There is no estimate yet.")
      .value("OK", HealthState::kOk, "Every source agrees.")
      .value("DEGRADED", HealthState::kDegraded,
             "Right, but a source is silent or wrong, or noise is larger than believed.")
      .value("AMBIGUOUS", HealthState::kAmbiguous, "Several poses fit, and none is chosen yet.")
      .value("DEAD_RECKONING", HealthState::kDeadReckoning, "Nothing but odometry for some time.")
      .value("LOST", HealthState::kLost, "Likely wrong, or without aid for too long.")
      .finalize();
  py::native_enum<HealthClue>(m, "HealthClue", "enum.Enum", "Why a state is not OK.")
      .value("NONE", HealthClue::kNone)
      .value("NO_ESTIMATE", HealthClue::kNoEstimate, "Never started.")
      .value("SEVERAL_PLACES", HealthClue::kSeveralPlaces, "Several poses fit.")
      .value("MEASUREMENTS", HealthClue::kMeasurements, "Measurements speak against the pose.")
      .value("SILENCE", HealthClue::kSilence, "Nothing was fused for some time.")
      .value("SOURCE_IS_WRONG", HealthClue::kSourceIsWrong, "One source says what the others deny.")
      .value("SOURCE_IS_SILENT", HealthClue::kSourceIsSilent,
             "One kind of source says nothing any more.")
      .value("NOISE_IS_LARGER", HealthClue::kNoiseIsLarger,
             "Innovations are larger than their covariance.")
      .value("POSITION_IS_VAGUE", HealthClue::kPositionIsVague,
             "The covariance alone leaves the limit.")
      .value("SCANS_DO_NOT_FIT", HealthClue::kScansDoNotFit, "Scans speak against the pose.")
      .value("LASER_IS_COVERED", HealthClue::kLaserIsCovered,
             "A laser sees something right before it.")
      .finalize();
}

}  // namespace

void bind_health(py::module_& m) {
  bind_enums(m);
  py::class_<NamedSource>(m, "NamedSource", "Where measurements come from.")
      .def_readonly("kind", &NamedSource::kind)
      .def_property_readonly(
          "name",
          [](const NamedSource& s) {
            return s.name == NamedSource::kNameless ? std::nullopt : std::optional(s.name);
          },
          "Of the anchor, the tag or the landmark; None without one.");
  py::class_<SourceStatus>(m, "SourceStatus", "What became of one source's messages.")
      .def_readonly("source", &SourceStatus::source)
      .def_readonly("heard", &SourceStatus::heard, "Last [ns].")
      .def_readonly("fused", &SourceStatus::fused, "Last [ns], or None.")
      .def_readonly("interval", &SourceStatus::interval, "Between messages, mean [s].")
      .def_readonly("residual", &SourceStatus::residual, "Last innovation's first row.")
      .def_readonly("sigma", &SourceStatus::sigma, "Of that innovation.")
      .def_readonly("test_ratio", &SourceStatus::test_ratio,
                    "Last NIS over the gate's limit: above 1 it was gated.")
      .def_readonly("accepted", &SourceStatus::accepted,
                    "Share of the last 32 or so that was fused.")
      .def_readonly("nis", &SourceStatus::nis,
                    "Mean NIS per degree of freedom of what was no outlier.")
      .def_readonly("faulty", &SourceStatus::faulty,
                    "Probability that it is wrong as a whole, if the pose is right.");
  py::class_<HealthReport>(m, "HealthReport", "How far an estimate may be trusted, in numbers.")
      .def_readonly("stamp", &HealthReport::stamp, "[ns].")
      .def_readonly("state", &HealthReport::state)
      .def_readonly("clue", &HealthReport::clue)
      .def_readonly("source", &HealthReport::source, "That the clue names, or None.")
      .def_readonly("wrong", &HealthReport::wrong, "Probability that the robot is somewhere else.")
      .def_readonly("within", &HealthReport::within,
                    "Probability that the position error is below the limit.")
      .def_readonly("inflation", &HealthReport::inflation,
                    "Of the covariance, by innovations larger than believed.")
      .def_readonly("protection", &HealthReport::protection,
                    "|error| in x [m], y [m] and heading [rad] exceeds these with the stated risk "
                    "at most, (3,); infinite where that cannot be said.")
      .def("__repr__", [](const HealthReport& r) {
        return "HealthReport(" + std::string(py::str(py::cast(r.state).attr("name"))) +
               ", within " + std::to_string(r.within) + ")";
      });
  using Config = Health::Config;
  py::class_<Config>(m, "HealthConfig", "What a Health believes of robots and sources.")
      .def(py::init<>())
      .def_readwrite("limit_m", &Config::limit_m, "Position error that `within` asks about [m].")
      .def_readwrite("risk", &Config::risk, "That an error exceeds its protection level.")
      .def_readwrite("mean_s_between_losses", &Config::mean_s_between_losses,
                     "How rarely a robot loses its place [s].")
      .def_readwrite("wrong_share", &Config::wrong_share,
                     "Of measurements that say nothing, each by itself.")
      .def_readwrite("wrong_span_m", &Config::wrong_span_m,
                     "What is wrong is wrong by anything up to this [m].")
      .def_readwrite("chance_share", &Config::chance_share,
                     "Of measurements that fit a pose that is wrong.")
      .def_readwrite("faulty_share", &Config::faulty_share,
                     "Of the time that a source is wrong as a whole.")
      .def_readwrite("faulty_share_unnamed", &Config::faulty_share_unnamed,
                     "Likewise of a sensor of landmarks without names.")
      .def_readwrite("faulty_s", &Config::faulty_s, "How long it is, on average [s].")
      .def_readwrite("exclude_above", &Config::exclude_above,
                     "A range's source more likely wrong than this is not fused.")
      .def_readwrite("probability_lost", &Config::probability_lost,
                     "Of being wrong, from which on it is lost.")
      .def_readwrite("probability_found", &Config::probability_found,
                     "Of being wrong, below which it is not any more.")
      .def_readwrite("doubt_s", &Config::doubt_s,
                     "For which it must have been that likely wrong, to be lost [s].")
      .def_readwrite("aiding_lost_s", &Config::aiding_lost_s,
                     "Without anything fused: dead reckoning [s].")
      .def_readwrite("invalid_s", &Config::invalid_s, "Likewise: lost [s].");
  py::class_<Health>(m, "Health",
                     R"(Says how far an estimate may be trusted, from what becomes of measurements.

One bit says whether the pose is right, one bit for every source whether it is: a hidden Markov
model (docs/health.md). A RecoveringEkf has one inside; any other estimator may be listened to.

Parameters
----------
config : HealthConfig

Raises
------
ValueError
    If a config is out of range.

Examples
--------
>>> import numpy as np
>>> from locfuse import *
>>> anchors = AnchorMap([Anchor(1, [0, 0, 0]), Anchor(2, [8, 0, 0]), Anchor(3, [4, 6, 0])])
>>> start = PoseEstimate(0, Pose2(3, 2, 0), 0.01 * np.eye(3))
>>> ekf = PoseEkf(PoseEkfConfig(), anchors, [Tag(0, [0, 0, 0])], start)
>>> health = Health(HealthConfig())
>>> gate = Gate(PoseEkfConfig().gate_range)
>>> for k in range(30):  # ranges that fit nowhere near
...     z = Range(k * 100_000_000, 0, 1 + k % 3, 0.1)
...     health.hear(z, ekf.on(z), gate)
>>> health.is_lost
True
)")
      .def(py::init<const Config&>(), py::arg("config"))
      .def("start", &Health::start, py::arg("stamp"), py::arg("wrong") = 0.0,
           "The pose is wrong with that probability at `stamp` [ns], and nothing is known of the "
           "sources.")
      .def(
          "hear",
          [](Health& health, const Measurement& z, const locfuse::Outcome& outcome,
             const locfuse::Gate& gate) {
            std::visit(
                [&](const auto& message) {
                  health.hear(named_source_of(message), message.stamp, outcome,
                              outcome.dof > 0 ? gate.limit(outcome.dof) : 1.0,
                              health.breadth_of(message));
                },
                z);
          },
          py::arg("message"), py::arg("outcome"), py::arg("gate"),
          "Takes what became of a measurement that `gate` judged.")
      .def("advance", &Health::advance, py::arg("stamp"), "Time passes: trust runs out.")
      .def("report", &Health::report, py::arg("estimate"),
           "How far a PoseEstimate, which the measurements heard belong to, may be trusted.")
      .def_property_readonly("wrong", &Health::wrong, "Probability that the pose is wrong.")
      .def_property_readonly("is_lost", &Health::is_lost)
      .def_property_readonly("sources", &Health::sources, "A SourceStatus for each.");
}
