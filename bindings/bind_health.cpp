// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include <variant>

#include "bindings.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/recovery/health.hpp"

namespace py = pybind11;
using locfuse::Health;
using locfuse::HealthReason;
using locfuse::HealthReport;
using locfuse::HealthState;
using locfuse::NamedSource;
using locfuse::SourceStatus;

namespace {

using Measurement = std::variant<locfuse::Range, locfuse::PositionFix, locfuse::PoseObservation,
                                 locfuse::RangeBearing, locfuse::Altitude, locfuse::Heading>;

void bind_enums(py::module_& m) {
  py::native_enum<HealthState>(m, "HealthState", "enum.Enum", "Trust in an estimate.")
      .value("INITIALIZING", HealthState::kInitializing, "No estimate yet.")
      .value("OK", HealthState::kOk, "All sources are consistent.")
      .value("DEGRADED", HealthState::kDegraded,
             "The pose is right, but a source timed out or is faulty, or noise exceeds its model.")
      .value("AMBIGUOUS", HealthState::kAmbiguous, "Several hypotheses remain.")
      .value("DEAD_RECKONING", HealthState::kDeadReckoning,
             "Only odometry was fused for some time.")
      .value("LOST", HealthState::kLost,
             "The pose is probably wrong, or dead reckoning took too long.")
      .finalize();
  py::native_enum<HealthReason>(m, "HealthReason", "enum.Enum", "Reason for a state other than OK.")
      .value("NONE", HealthReason::kNone)
      .value("NO_ESTIMATE", HealthReason::kNoEstimate, "Not initialized.")
      .value("SEVERAL_PLACES", HealthReason::kSeveralPlaces, "Several hypotheses remain.")
      .value("MEASUREMENTS", HealthReason::kMeasurements, "Measurements contradict the pose.")
      .value("SILENCE", HealthReason::kSilence, "No measurement was fused for some time.")
      .value("SOURCE_IS_WRONG", HealthReason::kSourceIsWrong, "One source contradicts the others.")
      .value("SOURCE_IS_SILENT", HealthReason::kSourceIsSilent, "One kind of source timed out.")
      .value("NOISE_IS_LARGER", HealthReason::kNoiseIsLarger,
             "Innovations exceed their covariance.")
      .value("POSITION_IS_VAGUE", HealthReason::kPositionIsVague,
             "The covariance alone exceeds the limit.")
      .value("SCANS_DO_NOT_FIT", HealthReason::kScansDoNotFit, "Scans contradict the pose.")
      .value("LASER_IS_COVERED", HealthReason::kLaserIsCovered,
             "A laser is occluded at close range.")
      .finalize();
}

}  // namespace

void bind_health(py::module_& m) {
  bind_enums(m);
  py::class_<NamedSource>(m, "NamedSource", "A measurement source.")
      .def_readonly("kind", &NamedSource::kind)
      .def_property_readonly(
          "name",
          [](const NamedSource& s) {
            return s.name == NamedSource::kUnnamed ? std::nullopt : std::optional(s.name);
          },
          "Id of the anchor, tag or landmark, or None.");
  py::class_<SourceStatus>(m, "SourceStatus", "Statistics of the messages of one source.")
      .def_readonly("source", &SourceStatus::source)
      .def_readonly("last_received", &SourceStatus::last_received,
                    "Stamp of the last message received [ns].")
      .def_readonly("fused", &SourceStatus::fused, "Stamp of the last message fused [ns], or None.")
      .def_readonly("interval", &SourceStatus::interval, "Mean interval between messages [s].")
      .def_readonly("residual", &SourceStatus::residual, "First row of the last innovation.")
      .def_readonly("sigma", &SourceStatus::sigma, "Standard deviation of that innovation.")
      .def_readonly("test_ratio", &SourceStatus::test_ratio,
                    "Last NIS divided by the gate limit; above 1 the message was gated.")
      .def_readonly("accepted", &SourceStatus::accepted,
                    "Fraction of about the last 32 messages that was fused.")
      .def_readonly("nis", &SourceStatus::nis, "Mean NIS per degree of freedom of inliers.")
      .def_readonly("faulty", &SourceStatus::faulty,
                    "Probability that the source is faulty, given that the pose is right.");
  py::class_<HealthReport>(m, "HealthReport",
                           "Health of an estimate: state, probabilities and protection levels.")
      .def_readonly("stamp", &HealthReport::stamp, "[ns].")
      .def_readonly("state", &HealthReport::state)
      .def_readonly("reason", &HealthReport::reason)
      .def_readonly("source", &HealthReport::source, "Source that the reason refers to, or None.")
      .def_readonly("wrong", &HealthReport::wrong, "Probability that the pose is wrong.")
      .def_readonly("within", &HealthReport::within,
                    "Probability that the position error is below the limit.")
      .def_readonly("inflation", &HealthReport::inflation,
                    "Factor on the covariance from innovations larger than modelled.")
      .def_readonly("protection", &HealthReport::protection,
                    "Protection levels of x [m], y [m] and heading [rad], (3,): |error| exceeds "
                    "them at most with probability `risk`; infinite if no bound is known.")
      .def("__repr__", [](const HealthReport& r) {
        return "HealthReport(" + std::string(py::str(py::cast(r.state).attr("name"))) +
               ", within " + std::to_string(r.within) + ")";
      });
  using Config = Health::Config;
  py::class_<Config>(m, "HealthConfig", "Priors and thresholds of a Health.")
      .def(py::init<>())
      .def_readwrite("limit_m", &Config::limit_m, "Position error limit of `within` [m].")
      .def_readwrite("risk", &Config::risk,
                     "Probability that an error exceeds its protection level.")
      .def_readwrite("mean_s_between_losses", &Config::mean_s_between_losses,
                     "Mean time between losses of the pose [s].")
      .def_readwrite("wrong_share", &Config::wrong_share, "Fraction of independent outliers.")
      .def_readwrite("wrong_span_m", &Config::wrong_span_m,
                     "Outliers are uniform over this span [m].")
      .def_readwrite("chance_share", &Config::chance_share,
                     "Fraction of measurements that match a wrong pose by chance.")
      .def_readwrite("faulty_share", &Config::faulty_share,
                     "Fraction of time in which a source is faulty.")
      .def_readwrite("faulty_share_unnamed", &Config::faulty_share_unnamed,
                     "The same for a sensor of landmarks without ids.")
      .def_readwrite("faulty_s", &Config::faulty_s, "Mean duration of a fault [s].")
      .def_readwrite("exclude_above", &Config::exclude_above,
                     "Ranges of a source with a higher fault probability are not fused.")
      .def_readwrite("probability_lost", &Config::probability_lost,
                     "Probability of a wrong pose above which the state becomes LOST.")
      .def_readwrite("probability_found", &Config::probability_found,
                     "Probability of a wrong pose below which LOST is cleared.")
      .def_readwrite("doubt_s", &Config::doubt_s,
                     "Duration above `probability_lost` before the state becomes LOST [s].")
      .def_readwrite("aiding_lost_s", &Config::aiding_lost_s,
                     "Time without a fused measurement until DEAD_RECKONING [s].")
      .def_readwrite("invalid_s", &Config::invalid_s,
                     "Time without a fused measurement until LOST [s].");
  py::class_<Health>(m, "Health",
                     R"(Monitors the trust in an estimate from the outcomes of its measurements.

Hidden Markov model with one bit for the pose (right or wrong) and one per source (docs/health.md).
A RecoveringEkf contains one; feed a separate one with the outcomes of any other estimator.

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
>>> from locfuse.core import *
>>> anchors = AnchorMap([Anchor(1, [0, 0, 0]), Anchor(2, [8, 0, 0]), Anchor(3, [4, 6, 0])])
>>> start = PoseEstimate(0, Pose2(3, 2, 0), 0.01 * np.eye(3))
>>> ekf = PoseEkf(PoseEkfConfig(), World(anchors, [Tag(0, [0, 0, 0])]), start)
>>> health = Health(HealthConfig())
>>> gate = Gate(PoseEkfConfig().range.gate)
>>> for k in range(30):  # ranges that contradict the pose
...     z = Range(k * 100_000_000, 0, 1 + k % 3, 0.1)
...     health.record(z, ekf.on(z), gate)
>>> health.is_lost
True
)")
      .def(py::init<const Config&>(), py::arg("config"))
      .def("start", &Health::start, py::arg("stamp"), py::arg("wrong") = 0.0,
           "Restarts at `stamp` [ns] with probability `wrong` of a wrong pose; source statistics "
           "are cleared.")
      .def(
          "record",
          [](Health& health, const Measurement& z, const locfuse::Outcome& outcome,
             const locfuse::Gate& gate) {
            std::visit(
                [&](const auto& message) {
                  health.record(named_source_of(message), message.stamp, outcome,
                                outcome.dof > 0 ? gate.limit(outcome.dof) : 1.0,
                                health.outlier_volume(message));
                },
                z);
          },
          py::arg("message"), py::arg("outcome"), py::arg("gate"),
          "Records a measurement and its Outcome under `gate`.")
      .def("advance", &Health::advance, py::arg("stamp"),
           "Advances time to `stamp` [ns]; trust decays.")
      .def("report", &Health::report, py::arg("estimate"),
           "HealthReport of the PoseEstimate that the recorded measurements belong to.")
      .def_property_readonly("wrong", &Health::wrong, "Probability that the pose is wrong.")
      .def_property_readonly("is_lost", &Health::is_lost)
      .def_property_readonly("sources", &Health::sources, "One SourceStatus per source.");
}
