// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "alone.hpp"
#include "bindings.hpp"
#include "columns.hpp"
#include "locfuse/replay/odometry_timeline.hpp"
#include "locfuse/replay/replay.hpp"
#include "numpy.hpp"
#include "shared_log.hpp"

namespace py = pybind11;
using locfuse::ArrivedMotion;
using locfuse::MadeMotion;
using locfuse::OdometryTimeline;
using locfuse::Stamp;

namespace {

/// What is made of a log.
struct MadeOdometry {
  std::vector<ArrivedMotion> motions;
};

template <class T, class Field>
auto made_column(const Field& field) {
  return [field](const MadeOdometry& made) {
    return column_of<T>(made.motions, [&](const ArrivedMotion& m) { return field(m); });
  };
}

template <class Field>
auto made_rows(const Field& field) {
  return [field](const MadeOdometry& made) {
    std::vector<double> rows;
    rows.reserve(3 * made.motions.size());
    for (const ArrivedMotion& m : made.motions) {
      const locfuse::Vector<3> row = field(m.made.increment);
      rows.insert(rows.end(), row.data(), row.data() + 3);
    }
    return to_numpy(std::move(rows), {static_cast<py::ssize_t>(made.motions.size()), 3});
  };
}

}  // namespace

void bind_odometry_timeline(py::module_& m) {
  py::class_<MadeMotion>(m, "MadeMotion", "Motion that an OdometryTimeline made.")
      .def_readonly("origin", &MadeMotion::origin,
                    "Number of the message that ended it, in order of arrival.")
      .def_readonly("again", &MadeMotion::again,
                    "Whether it is in place of an earlier one of that origin.")
      .def_readonly("slipped", &MadeMotion::slipped, "Whether gyro and wheels contradict.")
      .def_readonly("increment", &MadeMotion::increment);
  py::class_<MadeOdometry>(m, "MadeOdometry", "Motions made of a log, as columns.")
      .def("__len__", [](const MadeOdometry& made) { return made.motions.size(); })
      .def_property_readonly("arrival_ns",
                             made_column<Stamp>([](const auto& one) { return one.arrival; }),
                             "When they were made, (n,).")
      .def_property_readonly(
          "begin_ns", made_column<Stamp>([](const auto& one) { return one.made.increment.begin; }),
          "(n,).")
      .def_property_readonly(
          "stamp_ns", made_column<Stamp>([](const auto& one) { return one.made.increment.stamp; }),
          "Where they end, (n,).")
      .def_property_readonly("motion", made_rows([](const locfuse::Increment& u) {
                               return locfuse::Vector<3>(u.motion.x, u.motion.y, u.motion.heading);
                             }),
                             "dx, dy [m], dheading [rad], (n, 3).")
      .def_property_readonly("variance", made_rows([](const locfuse::Increment& u) {
                               constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
                               return u.variance.value_or(locfuse::Vector<3>::Constant(kNone));
                             }),
                             "Of the motion, (n, 3); NaN where the model's noise holds.")
      .def_property_readonly("slipped",
                             made_column<bool>([](const auto& one) { return one.made.slipped; }),
                             "Whether gyro and wheels contradict, (n,).")
      .def_property_readonly("origin", made_column<std::int64_t>([](const auto& one) {
                               return static_cast<std::int64_t>(one.made.origin);
                             }),
                             "Place in the log of the message that ended each, (n,).")
      .def_property_readonly("again",
                             made_column<bool>([](const auto& one) { return one.made.again; }),
                             "Whether a row is in place of an earlier one of that origin, (n,).");
  py::class_<OdometryTimeline>(
      m, "OdometryTimeline",
      R"(Odometry of wheels with a gyro, of a laser's scans, or of both, from messages as they arrive.

They count in order of stamps: after a late message the motions from it on are made again.

Parameters
----------
gyro : GyroOdometryConfig, optional
    A turn is by the gyro, too.
scans : ScanOdometryConfig, optional
    Scans make the odometry; wheels only show where each fit begins.
odometry : OdometryConfig
    Noise of the wheels beside scans.
history : int
    Maximum delay of a message [ns].
clock_jump : ClockJump
    Reaction to a backward jump of the clock; after CONTINUE the odometry starts anew.
max_messages : int
    Maximum number of messages kept for reordering, at least 512.

Raises
------
ValueError
    If there is neither a gyro nor scans, or an option is out of range.

Examples
--------
>>> from locfuse import Pose2
>>> from locfuse.core import GyroOdometryConfig, Imu, Increment, OdometryTimeline
>>> timeline = OdometryTimeline(gyro=GyroOdometryConfig())
>>> timeline.on(Imu(0, [0.0, 0.0, 0.2]))
[]
>>> [made.again for made in timeline.on(Increment(0, 10**8, Pose2(0.1, 0.0, 0.02)))]
[False]
>>> [made.again for made in timeline.on(Imu(5 * 10**7, [0.0, 0.0, 0.3]))]  # it comes late
[True]
)")
      .def(py::init([](const std::optional<locfuse::GyroOdometry::Config>& gyro,
                       const std::optional<locfuse::ScanOdometryConfig>& scans,
                       const locfuse::OdometryMotion::Config& odometry, Stamp history,
                       locfuse::ClockJump clock_jump, std::size_t max_messages) {
             locfuse::Odometer::Config config;
             config.gyro = gyro;
             if (scans) {
               config.scans = locfuse::ScanDrive::Config{*scans, odometry};
             }
             locfuse::TimelineOptions options;
             options.clock_jump = clock_jump;
             options.max_messages = max_messages;
             return OdometryTimeline(locfuse::Odometer(config), history, options);
           }),
           py::arg("gyro") = py::none(), py::arg("scans") = py::none(),
           py::arg_v("odometry", locfuse::OdometryMotion::Config{}, "OdometryConfig()"),
           py::arg("history") = locfuse::ReplayOptions{}.history,
           py::arg_v("clock_jump", locfuse::ClockJump::kRefuse, "ClockJump.REFUSE"),
           py::arg("max_messages") = locfuse::TimelineOptions{}.max_messages)
      .def(
          "on",
          [](OdometryTimeline& timeline, const locfuse::Message& message) {
            const Alone alone(&timeline);
            return std::vector<MadeMotion>(timeline.on(message));
          },
          py::arg("message"),
          R"(Takes a message; returns the MadeMotion that it ends, if it does, and those made again.

Raises
------
ValueError
    If the message is not valid; it is discarded.
)")
      .def_property_readonly(
          "outcome", [](const OdometryTimeline& timeline) { return timeline.outcome(); },
          "Outcome of the last message: FUSED, IGNORED if it waits or is of no use, STALE if it "
          "was "
          "too late.")
      .def("__copy__", [](const OdometryTimeline& timeline) { return timeline; })
      .def(
          "of_log",
          [](OdometryTimeline& timeline, SharedLog& log) {
            const Use use(log, Use::Kind::kRead);
            const Alone alone(&timeline);
            return MadeOdometry{locfuse::odometry_of(timeline, log.log)};
          },
          py::arg("log"), "Takes a sorted log; returns the MadeOdometry of it.");
}
