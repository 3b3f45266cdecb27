// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include <cmath>

#include "bindings.hpp"
#include "locfuse/replay/clock_jump.hpp"
#include "numpy.hpp"
#include "shared_log.hpp"

namespace py = pybind11;
using locfuse::Id;
using locfuse::Message;
using locfuse::MessageLog;
using locfuse::Stamp;
using Stamps = Integers<Stamp>;
using Ids = Integers<Id>;

namespace {

Column<Stamp> checked_stamps(const char* name, const Stamps& stamps) {
  return checked(name, stamps, "64-bit nanoseconds");
}

Column<Id> checked_ids(const char* name, const Ids& ids) {
  return checked(name, ids, "a 32-bit id");
}

// Adds one message per row; `arrivals` may be absent.
template <class Make>
void add_rows(SharedLog& log, const Column<Stamp>& stamps, const std::optional<Stamps>& arrivals,
              const Make& make) {
  const py::ssize_t n = stamps.size();
  expect_shape("stamp_ns", stamps, n);
  std::optional<Column<Stamp>> arrival_ns;
  if (arrivals) {
    arrival_ns = checked_stamps("arrival_ns", *arrivals);
    expect_shape("arrival_ns", *arrival_ns, n);
  }
  const Stamp* arrival = arrival_ns ? arrival_ns->data() : nullptr;
  const Use use(log, Use::Kind::kChange);
  const py::gil_scoped_release release;
  log.log.add_rows(static_cast<std::size_t>(n), [&](std::size_t row) -> MessageLog::Arrival {
    const Message message = make(static_cast<py::ssize_t>(row));
    return {arrival != nullptr ? arrival[row] : effective_stamp(message), message};
  });
}

/// Variance of a reported sigma; -1 and 0 mean that it is unknown.
double reported_variance(double sigma) { return sigma * std::abs(sigma); }

double checked_sigma(const char* what, double sigma) {
  if (!(std::isfinite(sigma) && sigma > 0.0)) {
    throw std::invalid_argument(std::string(what) + " is " + std::to_string(sigma) +
                                ", expected a finite number > 0");
  }
  return sigma;
}

}  // namespace

void bind_message_log(py::module_& m) {
  using locfuse::ClockJump;
  py::native_enum<ClockJump>(m, "ClockJump", "enum.Enum",
                             "Reaction to a backward jump of the message clock.")
      .value("REFUSE", ClockJump::kRefuse, "Messages are STALE until the clock has caught up.")
      .value("RESET", ClockJump::kReset, "Restart with the initial estimator.")
      .value("CONTINUE", ClockJump::kContinue, "Continue from the same pose at the new time.")
      .finalize();
  const auto no_arrival = py::arg("arrival_ns") = py::none();
  py::class_<SharedLog>(m, "MessageLog", R"(Recorded messages, added column by column.

Every `add_...` takes arrays of equal length; `arrival_ns`, where given, is when each message
reaches the estimator, otherwise it arrives when it takes effect. A row that is not valid raises
ValueError, names the row, and nothing is added; ids and stamps that are not integers raise
TypeError. A log that another thread adds to, sorts or replays raises RuntimeError; several threads
may replay it at once.
)")
      .def(py::init<>())
      .def("__len__",
           [](SharedLog& log) {
             const Use use(log, Use::Kind::kRead);
             return log.log.arrivals().size();
           })
      .def(
          "add_velocities",
          [](SharedLog& log, const Stamps& stamps, const Column<double>& forward,
             const Column<double>& turn_rate, const std::optional<Stamps>& arrival,
             const std::optional<Column<double>>& left) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            expect_shape("forward", forward, stamp.size());
            expect_shape("turn_rate", turn_rate, stamp.size());
            if (left) {
              expect_shape("left", *left, stamp.size());
            }
            add_rows(log, stamp, arrival,
                     [&, t = stamp.data(), v = forward.data(), w = turn_rate.data(),
                      sideways = left ? left->data() : nullptr](py::ssize_t i) -> Message {
                       return locfuse::Velocity{t[i], v[i], w[i],
                                                sideways != nullptr ? sideways[i] : 0.0};
                     });
          },
          py::arg("stamp_ns"), py::arg("forward"), py::arg("turn_rate"), no_arrival,
          py::arg("left") = py::none())
      .def(
          "add_increments",
          [](SharedLog& log, const Stamps& begins, const Stamps& stamps,
             const Column<double>& motion, const std::optional<Stamps>& arrival,
             const std::optional<Column<double>>& variance,
             const std::optional<Column<std::int64_t>>& origin,
             const std::optional<Column<bool>>& again) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            const Column<Stamp> begin = checked_stamps("begin_ns", begins);
            expect_shape("begin_ns", begin, stamp.size());
            expect_shape("motion", motion, stamp.size(), 3);
            if (variance) {
              expect_shape("variance", *variance, stamp.size(), 3);
            }
            const bool is_made = origin && again;
            if (is_made) {
              expect_shape("origin", *origin, stamp.size());
              expect_shape("again", *again, stamp.size());
            }
            add_rows(log, stamp, arrival,
                     [&, b = begin.data(), t = stamp.data(), u = motion.data(),
                      s = variance ? variance->data() : nullptr](py::ssize_t i) -> Message {
                       locfuse::Increment motion_of_row{
                           b[i], t[i], {u[3 * i], u[3 * i + 1], u[3 * i + 2]}};
                       if (s != nullptr && !std::isnan(s[3 * i])) {
                         motion_of_row.variance = Eigen::Map<const locfuse::Vector<3>>(s + 3 * i);
                       }
                       if (is_made) {
                         motion_of_row.origin = static_cast<std::size_t>(origin->data()[i]);
                         motion_of_row.again = again->data()[i];
                       }
                       return motion_of_row;
                     });
          },
          py::arg("begin_ns"), py::arg("stamp_ns"), py::arg("motion"), no_arrival,
          py::arg("variance") = py::none(), py::arg("origin") = py::none(),
          py::arg("again") = py::none(),
          "Motions (n, 3) from begin_ns to stamp_ns: dx, dy [m], dheading [rad] in the body frame "
          "at begin_ns; their variances (n, 3), or those of a row of NaN, default to those of the "
          "model. `origin` and `again` as of MadeOdometry.")
      .def(
          "add_samples",
          [](SharedLog& log, const Stamps& stamps, const Column<double>& rate,
             const std::optional<Column<double>>& force, const std::optional<Stamps>& arrival) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            expect_shape("angular_rate", rate, stamp.size(), 3);
            if (force) {
              expect_shape("specific_force", *force, stamp.size(), 3);
            }
            const double* a = force ? force->data() : nullptr;
            add_rows(log, stamp, arrival, [=, t = stamp.data(), w = rate.data()](py::ssize_t i) {
              locfuse::Imu z{t[i], Eigen::Map<const locfuse::Vector<3>>(w + 3 * i)};
              if (a != nullptr) {
                z.specific_force = Eigen::Map<const locfuse::Vector<3>>(a + 3 * i);
              }
              return Message(z);
            });
          },
          py::arg("stamp_ns"), py::arg("angular_rate"), py::arg("specific_force") = py::none(),
          no_arrival, "Of an inertial sensor: (n,), (n, 3) [rad/s] and (n, 3) [m/s^2].")
      .def(
          "add_scans",
          [](SharedLog& log, const std::vector<locfuse::LaserScan>& scans,
             const std::optional<Stamps>& arrivals) {
            std::optional<Column<Stamp>> arrival;
            if (arrivals) {
              arrival = checked_stamps("arrival_ns", *arrivals);
              expect_shape("arrival_ns", *arrival, static_cast<py::ssize_t>(scans.size()));
            }
            const Use use(log, Use::Kind::kChange);
            log.log.add_rows(scans.size(), [&](std::size_t i) -> MessageLog::Arrival {
              return {arrival ? arrival->data()[i] : scans[i].stamp, scans[i]};
            });
          },
          py::arg("scans"), no_arrival)
      .def(
          "add_ranges",
          [](SharedLog& log, const Stamps& stamps, const Ids& tags, const Ids& anchors,
             const Column<double>& range, const std::optional<Column<double>>& sigma,
             const std::optional<Stamps>& arrival) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            const Column<Id> tag = checked_ids("tag", tags);
            const Column<Id> anchor = checked_ids("anchor", anchors);
            expect_shape("tag", tag, stamp.size());
            expect_shape("anchor", anchor, stamp.size());
            expect_shape("range", range, stamp.size());
            if (sigma) {
              expect_shape("sigma", *sigma, stamp.size());
            }
            const double* s = sigma ? sigma->data() : nullptr;
            add_rows(log, stamp, arrival,
                     [t = stamp.data(), g = tag.data(), a = anchor.data(), r = range.data(),
                      s](py::ssize_t i) -> Message {
                       return locfuse::Range{t[i], g[i], a[i], r[i],
                                             s != nullptr ? std::optional(s[i]) : std::nullopt};
                     });
          },
          py::arg("stamp_ns"), py::arg("tag"), py::arg("anchor"), py::arg("range"),
          py::arg("sigma") = py::none(), no_arrival)
      .def(
          "add_positions",
          [](SharedLog& log, const Stamps& stamps, const Column<double>& position,
             const Column<double>& sigma, const std::optional<Stamps>& arrival,
             const std::optional<Ids>& tags) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            std::optional<Column<Id>> tag;
            if (tags) {
              tag = checked_ids("tag", *tags);
              expect_shape("tag", *tag, stamp.size());
            }
            expect_shape("position", position, stamp.size(), 2);
            expect_shape("sigma", sigma, stamp.size());
            add_rows(log, stamp, arrival,
                     [t = stamp.data(), p = position.data(), s = sigma.data(),
                      g = tag ? tag->data() : nullptr](py::ssize_t i) -> Message {
                       const bool has_tag = g != nullptr && g[i] >= 0;
                       return locfuse::PositionFix{
                           t[i],
                           {p[2 * i], p[2 * i + 1]},
                           reported_variance(s[i]) * locfuse::Matrix<2, 2>::Identity(),
                           has_tag ? std::optional(g[i]) : std::nullopt};
                     });
          },
          py::arg("stamp_ns"), py::arg("position"), py::arg("sigma"), no_arrival,
          py::arg("tag") = py::none(),
          "Positions (n, 2) [m] in world with one sigma (n,) [m] each, of the antenna or of the "
          "tags with ids (n,); a negative id is the antenna. Sigma -1 or 0: unknown; 1000 and "
          "more: not measured.")
      .def(
          "add_poses",
          [](SharedLog& log, const Stamps& stamps, const Column<double>& pose,
             const Column<double>& sigma_xy, const Column<double>& sigma_heading,
             const std::optional<Stamps>& arrival) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            expect_shape("pose", pose, stamp.size(), 3);
            expect_shape("sigma_xy", sigma_xy, stamp.size());
            expect_shape("sigma_heading", sigma_heading, stamp.size());
            add_rows(log, stamp, arrival,
                     [t = stamp.data(), p = pose.data(), xy = sigma_xy.data(),
                      h = sigma_heading.data()](py::ssize_t i) -> Message {
                       const locfuse::Vector<3> variances(reported_variance(xy[i]),
                                                          reported_variance(xy[i]),
                                                          reported_variance(h[i]));
                       return locfuse::PoseObservation{
                           t[i], {p[3 * i], p[3 * i + 1], p[3 * i + 2]}, variances.asDiagonal()};
                     });
          },
          py::arg("stamp_ns"), py::arg("pose"), py::arg("sigma_xy"), py::arg("sigma_heading"),
          no_arrival,
          "Poses (n, 3): x, y [m], heading [rad], with their sigmas. Both -1 or both 0: unknown; "
          "1000 and more: not measured.")
      .def(
          "add_sightings",
          [](SharedLog& log, const Stamps& stamps, const Ids& landmarks,
             const Column<double>& range, const Column<double>& bearing,
             const std::optional<Column<double>>& sigma_range,
             const std::optional<Column<double>>& sigma_bearing,
             const std::optional<Stamps>& arrival, const std::optional<Column<double>>& elevation,
             const std::optional<Column<double>>& sigma_elevation) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            const Column<Id> landmark = checked_ids("landmark", landmarks);
            expect_shape("landmark", landmark, stamp.size());
            expect_shape("range", range, stamp.size());
            expect_shape("bearing", bearing, stamp.size());
            if (sigma_range.has_value() != sigma_bearing.has_value()) {
              throw std::invalid_argument(
                  "only one of sigma_range and sigma_bearing is given, expected both or none");
            }
            if (sigma_range) {
              expect_shape("sigma_range", *sigma_range, stamp.size());
              expect_shape("sigma_bearing", *sigma_bearing, stamp.size());
            }
            for (const auto& [name, column] : {std::pair("elevation", &elevation),
                                               std::pair("sigma_elevation", &sigma_elevation)}) {
              if (*column) {
                expect_shape(name, **column, stamp.size());
              }
            }
            const double* sr = sigma_range ? sigma_range->data() : nullptr;
            const double* sb = sigma_bearing ? sigma_bearing->data() : nullptr;
            const double* e = elevation ? elevation->data() : nullptr;
            const double* se = sigma_elevation ? sigma_elevation->data() : nullptr;
            add_rows(log, stamp, arrival,
                     [t = stamp.data(), l = landmark.data(), r = range.data(), b = bearing.data(),
                      sr, sb, e, se](py::ssize_t i) -> Message {
                       locfuse::RangeBearing z{t[i], {}, {}, {}, {}};
                       if (l[i] >= 0) {
                         z.landmark = l[i];
                       }
                       if (!std::isnan(r[i])) {
                         z.range = r[i];
                       }
                       if (!std::isnan(b[i])) {
                         z.bearing = b[i];
                       }
                       if (sr != nullptr) {
                         const locfuse::Vector<2> sigma(
                             checked_sigma("RangeBearing.sigma_range [m]", sr[i]),
                             checked_sigma("RangeBearing.sigma_bearing [rad]", sb[i]));
                         z.covariance = locfuse::Matrix<2, 2>(sigma.cwiseAbs2().asDiagonal());
                       }
                       if (e != nullptr && !std::isnan(e[i])) {
                         z.elevation = e[i];
                         if (se != nullptr) {
                           z.sigma_elevation = se[i];
                         }
                       }
                       return z;
                     });
          },
          py::arg("stamp_ns"), py::arg("landmark"), py::arg("range"), py::arg("bearing"),
          py::arg("sigma_range") = py::none(), py::arg("sigma_bearing") = py::none(), no_arrival,
          py::arg("elevation") = py::none(), py::arg("sigma_elevation") = py::none(),
          "Landmark observations: id (-1: unknown), range [m], bearing and, from a body that "
          "flies, "
          "elevation [rad] (NaN: not measured), with their sigmas.")
      .def(
          "add_altitudes",
          [](SharedLog& log, const Stamps& stamps, const Column<double>& height,
             const std::optional<Column<double>>& sigma, const std::optional<Stamps>& arrival) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            expect_shape("height", height, stamp.size());
            if (sigma) {
              expect_shape("sigma", *sigma, stamp.size());
            }
            const double* s = sigma ? sigma->data() : nullptr;
            add_rows(log, stamp, arrival,
                     [t = stamp.data(), h = height.data(), s](py::ssize_t i) -> Message {
                       return locfuse::Altitude{t[i], h[i],
                                                s != nullptr ? std::optional(s[i]) : std::nullopt};
                     });
          },
          py::arg("stamp_ns"), py::arg("height"), py::arg("sigma") = py::none(), no_arrival,
          "Heights (n,) [m] of an altimeter above z = 0 of the world.")
      .def(
          "add_headings",
          [](SharedLog& log, const Stamps& stamps, const Column<double>& heading,
             const std::optional<Column<double>>& sigma, const std::optional<Column<bool>>& course,
             const std::optional<Stamps>& arrival) {
            const Column<Stamp> stamp = checked_stamps("stamp_ns", stamps);
            expect_shape("heading", heading, stamp.size());
            if (sigma) {
              expect_shape("sigma", *sigma, stamp.size());
            }
            if (course) {
              expect_shape("is_course", *course, stamp.size());
            }
            const double* s = sigma ? sigma->data() : nullptr;
            const bool* c = course ? course->data() : nullptr;
            add_rows(log, stamp, arrival,
                     [t = stamp.data(), h = heading.data(), s, c](py::ssize_t i) -> Message {
                       const bool has_sigma = s != nullptr && !std::isnan(s[i]);
                       return locfuse::Heading{t[i], h[i],
                                               has_sigma ? std::optional(s[i]) : std::nullopt,
                                               c != nullptr && c[i]};
                     });
          },
          py::arg("stamp_ns"), py::arg("heading"), py::arg("sigma") = py::none(),
          py::arg("is_course") = py::none(), no_arrival,
          "Headings (n,) [rad] of the body in world, or courses of its antenna.")
      .def(
          "sort",
          [](SharedLog& log) {
            const Use use(log, Use::Kind::kChange);
            const py::gil_scoped_release release;
            log.log.sort();
          },
          "Sorts by arrival; the sort is stable.");
}
