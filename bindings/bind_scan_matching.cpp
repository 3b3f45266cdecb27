// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "bindings.hpp"
#include "locfuse/frontends/scan_matcher.hpp"
#include "numpy.hpp"

namespace py = pybind11;
using locfuse::HeadingSearch;
using locfuse::LaserScan;
using locfuse::Matrix;
using locfuse::OccupancyGrid;
using locfuse::Pose2;
using locfuse::ScanHypothesis;
using locfuse::ScanMatch;
using locfuse::ScanMatcher;
using locfuse::ScanMatcherConfig;
using locfuse::ScanSearch;
using locfuse::Vector;
using Unlocked = py::call_guard<py::gil_scoped_release>;

namespace {

void bind_results(py::module_& m) {
  py::native_enum<HeadingSearch::Reason>(m, "HeadingSearchReason", "enum.Enum",
                                         "Result of a heading search.")
      .value("FOUND", HeadingSearch::Reason::kFound)
      .value("NO_RETURNS", HeadingSearch::Reason::kNoReturns)
      .value("OUTSIDE_MAP", HeadingSearch::Reason::kOutsideMap)
      .finalize();
  py::class_<HeadingSearch>(m, "HeadingSearch", "Result of the heading search of ekim2020.")
      .def_readonly(
          "heading", &HeadingSearch::heading,
          "Heading of the body in world [rad], a multiple of ten degrees; None unless found.")
      .def_property_readonly(
          "sums", [](const HeadingSearch& h) { return py::array_t<double>(36, h.sums.data()); },
          "Sums (36,) [m] of nearest distances with the body at 0, 10, ..., 350 degrees.")
      .def_readonly("returns", &HeadingSearch::returns, "Number of beams that each sum is of.")
      .def_readonly("rms_range", &HeadingSearch::rms_range, "RMS of their ranges [m].")
      .def_readonly("reason", &HeadingSearch::reason);

  py::native_enum<ScanMatch::Reason>(m, "ScanMatchReason", "enum.Enum", "How a refinement ended.")
      .value("CONVERGED", ScanMatch::Reason::kConverged)
      .value("NO_RETURNS", ScanMatch::Reason::kNoReturns)
      .value("OUTSIDE_MAP", ScanMatch::Reason::kOutsideMap)
      .value("TOO_FEW_MATCHES", ScanMatch::Reason::kTooFewMatches)
      .value("NO_CONVERGENCE", ScanMatch::Reason::kNoConvergence)
      .finalize();
  py::class_<ScanMatch>(m, "ScanMatch", "Fit of a scan to the map near a guess.")
      .def_readonly("pose", &ScanMatch::pose, "T_world_body; the guess unless `converged`.")
      .def_readonly("converged", &ScanMatch::converged,
                    "If False, only `reason` and `iterations` are valid.")
      .def_readonly("reason", &ScanMatch::reason)
      .def_readonly("iterations", &ScanMatch::iterations)
      .def_readonly("explained", &ScanMatch::explained,
                    "Fraction of the returns that end at a wall.")
      .def_readonly("rms", &ScanMatch::rms, "RMS distance of those returns to the wall lines [m].")
      .def_readonly("information", &ScanMatch::information,
                    "Information matrix of (x, y, heading) from the scan alone, shape (3, 3).")
      .def_readonly("covariance", &ScanMatch::covariance,
                    "Covariance of (x, y, heading) from scan and prior, shape (3, 3); None if "
                    "neither determines a direction.")
      .def_readonly("weak_direction", &ScanMatch::weak_direction,
                    "Unobservable change (3,) of (x, y, heading), or None.")
      .def("__repr__", [](const ScanMatch& match) {
        return "ScanMatch(converged=" + std::string(match.converged ? "True" : "False") +
               ", x=" + std::to_string(match.pose.x) + ", y=" + std::to_string(match.pose.y) +
               ", heading=" + std::to_string(match.pose.heading) + ")";
      });
  py::class_<ScanHypothesis>(m, "ScanHypothesis", "Pose hypothesis of a scan search.")
      .def_readonly("match", &ScanHypothesis::match)
      .def_readonly("cost", &ScanHypothesis::cost,
                    "Negative log of likelihood and prior; 0 is a perfect fit.")
      .def_readonly("probability", &ScanHypothesis::probability,
                    "Probability among the hypotheses found.");
  py::native_enum<ScanSearch::Status>(m, "ScanSearchStatus", "enum.Enum",
                                      "Result of a scan search.")
      .value("READY", ScanSearch::Status::kReady)
      .value("AMBIGUOUS", ScanSearch::Status::kAmbiguous)
      .value("NONE", ScanSearch::Status::kNone)
      .finalize();
  py::native_enum<ScanSearch::Reason>(m, "ScanSearchReason", "enum.Enum",
                                      "Reason for a ScanSearchStatus.")
      .value("UNIQUE", ScanSearch::Reason::kUnique)
      .value("SEVERAL_FIT", ScanSearch::Reason::kSeveralFit)
      .value("HEADING_UNOBSERVED", ScanSearch::Reason::kHeadingUnobserved)
      .value("POOR_FIT", ScanSearch::Reason::kPoorFit)
      .value("NO_RETURNS", ScanSearch::Reason::kNoReturns)
      .value("OUTSIDE_MAP", ScanSearch::Reason::kOutsideMap)
      .finalize();
  py::class_<ScanSearch>(m, "ScanSearch", "All poses in a search window at which a scan fits.")
      .def_readonly("status", &ScanSearch::status)
      .def_readonly("reason", &ScanSearch::reason)
      .def_readonly("hypotheses", &ScanSearch::hypotheses, "Likeliest first.");
}

}  // namespace

void bind_scan_matching(py::module_& m) {
  bind_results(m);
  const ScanMatcherConfig d;
  py::class_<ScanMatcherConfig>(m, "ScanMatcherConfig", R"(Settings of a ScanMatcher.

Parameters
----------
sigma_range_m : float
    Range noise of one beam.
outlier_share : float
    Fraction of returns from objects that are not on the map.
no_return_share : float
    Fraction of beams without a return where one is expected.
wrong_probability : float
    Maximum total probability of the other hypotheses when a search is READY.
min_explained : float
    Minimum fraction of the returns that a pose explains.
max_hypotheses : int
    Maximum number of hypotheses of a search.
max_iterations : int
    Maximum number of iterations of one refinement.
exact_neighbours : bool
    Use the nearest cell of each end point instead of that of the cell it lies in.
)")
      .def(py::init([](double sigma_range_m, double outlier_share, double no_return_share,
                       double wrong_probability, double min_explained, int max_hypotheses,
                       int max_iterations, bool exact_neighbours) {
             return ScanMatcherConfig{sigma_range_m,     outlier_share,   no_return_share,
                                      wrong_probability, min_explained,   max_hypotheses,
                                      max_iterations,    exact_neighbours};
           }),
           py::kw_only(), py::arg("sigma_range_m") = d.sigma_range_m,
           py::arg("outlier_share") = d.outlier_share,
           py::arg("no_return_share") = d.no_return_share,
           py::arg("wrong_probability") = d.wrong_probability,
           py::arg("min_explained") = d.min_explained, py::arg("max_hypotheses") = d.max_hypotheses,
           py::arg("max_iterations") = d.max_iterations,
           py::arg("exact_neighbours") = d.exact_neighbours)
      .def_readonly("sigma_range_m", &ScanMatcherConfig::sigma_range_m)
      .def_readonly("outlier_share", &ScanMatcherConfig::outlier_share)
      .def_readonly("no_return_share", &ScanMatcherConfig::no_return_share)
      .def_readonly("wrong_probability", &ScanMatcherConfig::wrong_probability)
      .def_readonly("min_explained", &ScanMatcherConfig::min_explained)
      .def_readonly("max_hypotheses", &ScanMatcherConfig::max_hypotheses)
      .def_readonly("max_iterations", &ScanMatcherConfig::max_iterations)
      .def_readonly("exact_neighbours", &ScanMatcherConfig::exact_neighbours);

  py::class_<ScanMatcher, std::shared_ptr<ScanMatcher>>(
      m, "ScanMatcher", R"(Finds the pose of a body on a map from single laser scans.

Raises
------
ValueError
    If there is no map or it has no occupied cell; from the methods, if a scan or a number is not
    valid.

Examples
--------
>>> import numpy as np
>>> from locfuse import LaserGeometry, LaserScan, OccupancyGrid, Pose2, ScanMatcher
>>> cells = np.full((60, 80), 0, dtype=np.int8)  # a room of 4 x 3 m
>>> cells[[0, -1], :] = cells[:, [0, -1]] = 100
>>> matcher = ScanMatcher(OccupancyGrid(cells, resolution=0.05))
>>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
>>> scan = LaserScan(0, around, [2.45, 1.45, 1.45, 1.45])  # ahead, left, back, right
>>> matcher.heading_search(scan, position=[1.5, 1.5]).heading
0.0
)")
      .def(py::init<std::shared_ptr<OccupancyGrid>, const ScanMatcherConfig&>(), py::arg("grid"),
           py::arg_v("config", d, "ScanMatcherConfig()"))
      .def_property_readonly("config", &ScanMatcher::config)
      .def(
          "nearest_by_kdtree",
          [](const ScanMatcher& matcher, const Vector<2>& point) {
            return matcher.map().nearest_by_kdtree(point);
          },
          py::arg("point"),
          "Distance [m] from a point (2,) in world to the nearest occupied cell's centre.")
      .def(
          "heading_search",
          [](const ScanMatcher& matcher, const LaserScan& scan, const Vector<2>& position) {
            return heading_search(matcher.map(), scan, position);
          },
          py::arg("scan"), py::arg("position"), Unlocked(),
          "Heading search of ekim2020, Table 1, at a position (2,) in world [m]: 36 headings, "
          "nearest cells by a kd-tree.")
      .def(
          "heading_search_by_lookup",
          [](const ScanMatcher& matcher, const LaserScan& scan, const Vector<2>& position) {
            return heading_search_by_lookup(matcher.map(), scan, position);
          },
          py::arg("scan"), py::arg("position"), Unlocked(),
          "Heading search with distances from a lookup table, exact within half a cell diagonal.")
      .def("refine", &ScanMatcher::refine, py::arg("scan"), py::arg("guess"),
           py::arg("covariance") = py::none(), Unlocked(),
           R"(Fit the scan to the map near a guess.

Parameters
----------
scan : LaserScan
guess : Pose2
    T_world_body, within 20 cm and 5 degrees.
covariance : array, shape (3, 3), optional
    Covariance of (x, y, heading) [m, rad]; with it the guess is also a prior.

Returns
-------
ScanMatch
)")
      .def("search", &ScanMatcher::search, py::arg("scan"), py::arg("position"),
           py::arg("covariance"), Unlocked(),
           R"(Find every pose near a position at which the scan fits, at any heading.

Parameters
----------
scan : LaserScan
position : array, shape (2,)
    Position of the body in world [m].
covariance : array, shape (2, 2)
    Covariance of the position [m^2]; the search covers three sigma.

Returns
-------
ScanSearch
)");
}
