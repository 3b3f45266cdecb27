// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "bindings.hpp"
#include "locfuse/replay/replay.hpp"
#include "locfuse/replay/start.hpp"
#include "numpy.hpp"

namespace py = pybind11;
using locfuse::Id;
using locfuse::Message;
using locfuse::MessageLog;
using locfuse::Outcome;
using locfuse::PoseEkf;
using locfuse::PoseEstimate;
using locfuse::RunLog;
using locfuse::Stamp;
using Stamps = py::array_t<Stamp, py::array::c_style>;  // no cast: seconds as floats are refused

namespace {

// A log that is replayed or grown without the GIL. `uses` changes under the GIL only.
struct SharedLog {
  MessageLog log;
  int uses = 0;  // replays that go on, or -1 while it changes
};

// One use of a log, refused where another use goes on that it would disturb. Made before the GIL is
// released, destroyed after it is back.
class Use {
 public:
  enum class Kind { kRead, kChange };
  Use(SharedLog& log, Kind kind) : log_(log) {
    if (log.uses < 0 || (kind == Kind::kChange && log.uses > 0)) {
      throw std::runtime_error("this MessageLog is in use by another call; wait until it is done");
    }
    log.uses = kind == Kind::kChange ? -1 : log.uses + 1;
  }
  ~Use() { log_.uses = log_.uses < 0 ? 0 : log_.uses - 1; }
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;

 private:
  SharedLog& log_;
};

// Adds one message per row; `arrivals` may be absent.
template <class Make>
void add_rows(SharedLog& log, const Stamps& stamps, const std::optional<Stamps>& arrivals,
              const Make& make) {
  const py::ssize_t n = stamps.size();
  expect_shape("stamp_ns", stamps, n);
  if (arrivals) {
    expect_shape("arrival_ns", *arrivals, n);
  }
  const Stamp* arrival = arrivals ? arrivals->data() : nullptr;
  const Use use(log, Use::Kind::kChange);
  const py::gil_scoped_release release;
  log.log.add_rows(static_cast<std::size_t>(n), [&](std::size_t row) -> MessageLog::Arrival {
    const Message message = make(static_cast<py::ssize_t>(row));
    return {arrival != nullptr ? arrival[row] : effective_stamp(message), message};
  });
}

double checked_sigma(const char* what, double sigma) {
  if (!(std::isfinite(sigma) && sigma > 0.0)) {
    throw std::invalid_argument(std::string(what) + " is " + std::to_string(sigma) +
                                ", expected a finite number > 0");
  }
  return sigma;
}

template <class Field>
py::array_t<double> numbers_of(const std::vector<Outcome>& outcomes, const Field& field) {
  std::vector<double> column;
  column.reserve(outcomes.size());
  for (const Outcome& outcome : outcomes) {
    column.push_back(field(outcome));
  }
  const auto n = static_cast<py::ssize_t>(column.size());
  return to_numpy(std::move(column), {n});
}

py::array_t<double> poses_of(const std::vector<PoseEstimate>& estimates) {
  std::vector<double> rows;
  rows.reserve(3 * estimates.size());
  for (const PoseEstimate& e : estimates) {
    rows.insert(rows.end(), {e.pose.x, e.pose.y, e.pose.heading});
  }
  return to_numpy(std::move(rows), {static_cast<py::ssize_t>(estimates.size()), 3});
}

py::array_t<double> covariances_of(const std::vector<PoseEstimate>& estimates) {
  std::vector<double> rows;
  rows.reserve(9 * estimates.size());
  for (const PoseEstimate& e : estimates) {
    rows.insert(rows.end(), e.covariance.data(), e.covariance.data() + 9);
  }
  return to_numpy(std::move(rows), {static_cast<py::ssize_t>(estimates.size()), 3, 3});
}

template <class T, class Items, class Field>
py::array_t<T> column_of(const Items& items, const Field& field) {
  std::vector<T> column;
  column.reserve(items.size());
  for (const auto& item : items) {
    column.push_back(field(item));
  }
  const auto n = static_cast<py::ssize_t>(column.size());
  return to_numpy(std::move(column), {n});
}

RunLog run(PoseEkf start, SharedLog& log, Stamp history, bool record,
           const std::optional<std::function<void(std::size_t)>>& progress, std::size_t first) {
  locfuse::ReplayOptions options;
  options.first = first;
  options.history = history;
  options.record = record;
  if (progress) {
    options.progress = [&](std::size_t done) {
      const py::gil_scoped_acquire acquire;
      (*progress)(done);
    };
  }
  const Use use(log, Use::Kind::kRead);
  const py::gil_scoped_release release;
  return locfuse::replay(start, log.log, options);
}

}  // namespace

void bind_replay(py::module_& m) {
  const auto no_arrival = py::arg("arrival_ns") = py::none();
  py::class_<SharedLog>(m, "MessageLog", R"(Recorded messages, added as columns.

Every `add_...` takes arrays of equal length; `arrival_ns`, where given, is when each message
reaches the estimator, otherwise it arrives when it takes effect. A row that is not valid raises
ValueError, names the row, and nothing is added. A log that another thread adds to, sorts or
replays raises RuntimeError; several threads may replay it at once.
)")
      .def(py::init<>())
      .def("__len__",
           [](SharedLog& log) {
             const Use use(log, Use::Kind::kRead);
             return log.log.arrivals().size();
           })
      .def(
          "add_velocities",
          [](SharedLog& log, const Stamps& stamp, const Column<double>& forward,
             const Column<double>& turn_rate, const std::optional<Stamps>& arrival) {
            expect_shape("forward", forward, stamp.size());
            expect_shape("turn_rate", turn_rate, stamp.size());
            add_rows(log, stamp, arrival,
                     [&, t = stamp.data(), v = forward.data(),
                      w = turn_rate.data()](py::ssize_t i) -> Message {
                       return locfuse::Velocity{t[i], v[i], w[i]};
                     });
          },
          py::arg("stamp_ns"), py::arg("forward"), py::arg("turn_rate"), no_arrival)
      .def(
          "add_increments",
          [](SharedLog& log, const Stamps& begin, const Stamps& stamp, const Column<double>& motion,
             const std::optional<Stamps>& arrival) {
            expect_shape("begin_ns", begin, stamp.size());
            expect_shape("motion", motion, stamp.size(), 3);
            add_rows(
                log, stamp, arrival,
                [&, b = begin.data(), t = stamp.data(),
                 u = motion.data()](py::ssize_t i) -> Message {
                  return locfuse::Increment{b[i], t[i], {u[3 * i], u[3 * i + 1], u[3 * i + 2]}};
                });
          },
          py::arg("begin_ns"), py::arg("stamp_ns"), py::arg("motion"), no_arrival,
          "Motions (n, 3): dx, dy [m], dheading [rad] from begin_ns to stamp_ns.")
      .def(
          "add_ranges",
          [](SharedLog& log, const Stamps& stamp, const Column<Id>& tag, const Column<Id>& anchor,
             const Column<double>& range, const std::optional<Column<double>>& sigma,
             const std::optional<Stamps>& arrival) {
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
          [](SharedLog& log, const Stamps& stamp, const Column<double>& position,
             const Column<double>& sigma, const std::optional<Stamps>& arrival) {
            expect_shape("position", position, stamp.size(), 2);
            expect_shape("sigma", sigma, stamp.size());
            add_rows(log, stamp, arrival,
                     [t = stamp.data(), p = position.data(),
                      s = sigma.data()](py::ssize_t i) -> Message {
                       const double sd = checked_sigma("PositionFix.sigma [m]", s[i]);
                       return locfuse::PositionFix{t[i],
                                                   {p[2 * i], p[2 * i + 1]},
                                                   sd * sd * locfuse::Matrix<2, 2>::Identity()};
                     });
          },
          py::arg("stamp_ns"), py::arg("position"), py::arg("sigma"), no_arrival,
          "Positions (n, 2) [m] with one sigma [m] each.")
      .def(
          "add_poses",
          [](SharedLog& log, const Stamps& stamp, const Column<double>& pose,
             const Column<double>& sigma_xy, const Column<double>& sigma_heading,
             const std::optional<Stamps>& arrival) {
            expect_shape("pose", pose, stamp.size(), 3);
            expect_shape("sigma_xy", sigma_xy, stamp.size());
            expect_shape("sigma_heading", sigma_heading, stamp.size());
            add_rows(log, stamp, arrival,
                     [t = stamp.data(), p = pose.data(), xy = sigma_xy.data(),
                      h = sigma_heading.data()](py::ssize_t i) -> Message {
                       const double sd = checked_sigma("PoseObservation.sigma_xy [m]", xy[i]);
                       const double sd_heading =
                           checked_sigma("PoseObservation.sigma_heading [rad]", h[i]);
                       const locfuse::Vector<3> sigma(sd, sd, sd_heading);
                       return locfuse::PoseObservation{t[i],
                                                       {p[3 * i], p[3 * i + 1], p[3 * i + 2]},
                                                       sigma.cwiseAbs2().asDiagonal()};
                     });
          },
          py::arg("stamp_ns"), py::arg("pose"), py::arg("sigma_xy"), py::arg("sigma_heading"),
          no_arrival, "Poses (n, 3): x, y [m], heading [rad], with their sigmas.")
      .def(
          "sort",
          [](SharedLog& log) {
            const Use use(log, Use::Kind::kChange);
            const py::gil_scoped_release release;
            log.log.sort();
          },
          "Sorts by arrival; messages of one instant stay in the order they were added in.");

  py::class_<RunLog>(m, "RunLog", "What a replay leaves behind, as columns.")
      .def_property_readonly(
          "stamp_ns",
          [](const RunLog& r) {
            return column_of<Stamp>(r.estimates, [](const auto& e) { return e.stamp; });
          },
          "Stamps of the estimates, (n,).")
      .def_property_readonly(
          "poses", [](const RunLog& r) { return poses_of(r.estimates); }, "x, y, heading, (n, 3).")
      .def_property_readonly(
          "covariances", [](const RunLog& r) { return covariances_of(r.estimates); }, "(n, 3, 3).")
      .def_property_readonly(
          "verdict",
          [](const RunLog& r) {
            return column_of<std::uint8_t>(
                r.outcomes, [](const Outcome& o) { return static_cast<std::uint8_t>(o.verdict); });
          },
          "Index into Verdict, one per message in order of arrival.")
      .def_property_readonly("dof",
                             [](const RunLog& r) {
                               return column_of<std::int64_t>(
                                   r.outcomes, [](const Outcome& o) { return o.dof; });
                             })
      .def_property_readonly("nis",
                             [](const RunLog& r) {
                               return numbers_of(r.outcomes, [](const auto& o) { return o.nis; });
                             })
      .def_property_readonly("residual",
                             [](const RunLog& r) {
                               return numbers_of(r.outcomes,
                                                 [](const auto& o) { return o.residual; });
                             })
      .def_property_readonly("log_likelihood",
                             [](const RunLog& r) {
                               return numbers_of(r.outcomes,
                                                 [](const auto& o) { return o.log_likelihood(); });
                             })
      .def_readonly("last", &RunLog::last, "The estimate at the end of the log.")
      .def("__repr__", [](const RunLog& r) {
        return "RunLog(" + std::to_string(r.outcomes.size()) + " messages, " +
               std::to_string(r.estimates.size()) + " estimates)";
      });
  using Step = locfuse::StartRun::Step;
  py::class_<Step>(m, "StartStep", "A change on the way to a start.")
      .def_readonly("stamp", &Step::stamp, "[ns].")
      .def_readonly("state", &Step::state);
  py::class_<locfuse::StartRun>(m, "StartRun", "How a start went.")
      .def_readonly("consumed", &locfuse::StartRun::consumed, "Messages used.")
      .def_readonly("steps", &locfuse::StartRun::steps,
                    "Whenever status or number of hypotheses changed.");
  m.def(
      "find_start",
      [](locfuse::Initializer& initializer, SharedLog& log,
         const std::vector<locfuse::LaserScan>& scans) {
        const Use use(log, Use::Kind::kRead);
        const py::gil_scoped_release release;
        return locfuse::find_start(initializer, log.log, scans);
      },
      py::arg("initializer"), py::arg("log"), py::arg("scans"),
      "Feeds a sorted log and scans until the initializer is ready or both end.");
  m.def("replay", &run, py::arg("start"), py::arg("log"),
        py::arg("history") = locfuse::ReplayOptions{}.history, py::arg("record") = true,
        py::arg("progress") = py::none(), py::arg("first") = 0,
        R"(Feeds a sorted log to a copy of an estimator; late messages are fused where they belong.

Parameters
----------
start : PoseEkf
log : MessageLog
history : int
    How late a message may be, nanoseconds; older ones are stale.
record : bool
    Keep outcomes and estimates, or only the last estimate.
progress : callable, optional
    Told the number of messages done, now and then.
first : int
    Messages before it were used for the start: they keep the verdict IGNORED.
)");
}
