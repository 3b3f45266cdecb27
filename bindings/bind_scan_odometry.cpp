// SPDX-License-Identifier: Apache-2.0
#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/frontends/scan_odometry.hpp"

namespace py = pybind11;
using locfuse::LaserScan;
using locfuse::LocalMap;
using locfuse::LocalMapConfig;
using locfuse::PlacedScan;
using locfuse::Pose2;
using locfuse::ScanMotion;
using locfuse::ScanOdometry;
using locfuse::ScanOdometryConfig;
using Unlocked = py::call_guard<py::gil_scoped_release>;

namespace {

void bind_local_map(py::module_& m) {
  const LocalMapConfig d;
  py::class_<LocalMapConfig>(m, "LocalMapConfig", R"(Settings of a LocalMap.

Parameters
----------
sigma_range_m : float
    Range noise of one beam.
max_distance_m : float
    Maximum distance between an end point and its match.
trimmed_share : float
    Fraction of the matches, the worst, that is dropped if beyond three sigma.
min_explained : float
    Minimum fraction of explained returns; below it the fit is searched again.
max_iterations : int
    Maximum number of iterations of one fit.
)")
      .def(py::init([](double sigma_range_m, double max_distance_m, double trimmed_share,
                       double min_explained, int max_iterations) {
             return LocalMapConfig{sigma_range_m, max_distance_m, trimmed_share, min_explained,
                                   max_iterations};
           }),
           py::kw_only(), py::arg("sigma_range_m") = d.sigma_range_m,
           py::arg("max_distance_m") = d.max_distance_m, py::arg("trimmed_share") = d.trimmed_share,
           py::arg("min_explained") = d.min_explained, py::arg("max_iterations") = d.max_iterations)
      .def_readonly("sigma_range_m", &LocalMapConfig::sigma_range_m)
      .def_readonly("max_distance_m", &LocalMapConfig::max_distance_m)
      .def_readonly("trimmed_share", &LocalMapConfig::trimmed_share)
      .def_readonly("min_explained", &LocalMapConfig::min_explained)
      .def_readonly("max_iterations", &LocalMapConfig::max_iterations);

  py::class_<LocalMap>(
      m, "LocalMap", R"(Local map of the end points of a few scans, to which another scan is fitted.

Parameters
----------
scans : list of (LaserScan, Pose2)
    Scans and their poses T_map_body; a single one for scan-to-scan matching.
config : LocalMapConfig, optional

Raises
------
ValueError
    If a setting is out of bounds, or a scan, pose or covariance is not valid.

Examples
--------
A room of 8 x 6 m, seen from its middle and from 0.2 m further on:

>>> import numpy as np
>>> from locfuse.core import LaserGeometry, LaserScan, LocalMap, Pose2
>>> angle = np.pi / 180 * (np.arange(360) + 0.5)
>>> around = LaserGeometry(Pose2(), angle[0], np.pi / 180, range_min=0.1, range_max=10.0)
>>> def seen_at(x):
...     ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
...     return LaserScan(0, around, np.minimum(ahead, 3.0 / np.abs(np.sin(angle))))
>>> match = LocalMap([(seen_at(0.0), Pose2())]).match(seen_at(0.2), guess=Pose2(0.1, 0.05, 0.02))
>>> match.converged, round(match.pose.x, 3), match.weak_direction is None
(True, 0.2, True)
)")
      .def(py::init([](const std::vector<std::pair<LaserScan, Pose2>>& scans,
                       const LocalMapConfig& config) {
             std::vector<PlacedScan> placed;
             for (const auto& [scan, pose] : scans) {
               placed.push_back({scan, pose});
             }
             return LocalMap(placed, config);
           }),
           py::arg("scans"), py::arg_v("config", d, "LocalMapConfig()"))
      .def_property_readonly("config", &LocalMap::config)
      .def("match", &LocalMap::match, py::arg("scan"), py::arg("guess"),
           py::arg("covariance") = py::none(), Unlocked(),
           R"(Fit a scan near a guess.

Parameters
----------
scan : LaserScan
guess : Pose2
    T_map_body, within 20 cm and 5 degrees.
covariance : array, shape (3, 3), optional
    Covariance of (x, y, heading) [m, rad]; with it the guess is also a prior. If it exceeds those
    bounds or the fit explains too little, a search over three sigma of the position and all
    headings gives another start.

Returns
-------
ScanMatch
    TOO_FEW_MATCHES on an empty map.

Raises
------
ValueError
    If scan, guess or covariance is not valid.
)");
}

}  // namespace

void bind_scan_odometry(py::module_& m) {
  bind_local_map(m);
  const ScanOdometryConfig d;
  py::class_<ScanOdometryConfig>(m, "ScanOdometryConfig", R"(Settings of a ScanOdometry.

Parameters
----------
map : LocalMapConfig
window_scans : int
    Number of key scans in the local map; 1 is scan-to-scan matching.
window_m : float
    Maximum distance of key scans from the newest one.
key_distance_m, key_turn_rad : float
    Motion since the newest key scan after which a scan becomes a key scan; 0: every scan.
least_sigma_m, least_sigma_rad : float
    Minimum sigmas of odometry, whatever its covariance: it is not sampled at the instant of the
    scan, and a robot that seems to stand may be moving.
)")
      .def(py::init([](const LocalMapConfig& map, int window_scans, double window_m,
                       double key_distance_m, double key_turn_rad, double least_sigma_m,
                       double least_sigma_rad) {
             return ScanOdometryConfig{map,          window_scans,  window_m,       key_distance_m,
                                       key_turn_rad, least_sigma_m, least_sigma_rad};
           }),
           py::kw_only(), py::arg_v("map", d.map, "LocalMapConfig()"),
           py::arg("window_scans") = d.window_scans, py::arg("window_m") = d.window_m,
           py::arg("key_distance_m") = d.key_distance_m, py::arg("key_turn_rad") = d.key_turn_rad,
           py::arg("least_sigma_m") = d.least_sigma_m,
           py::arg("least_sigma_rad") = d.least_sigma_rad)
      .def_readonly("map", &ScanOdometryConfig::map)
      .def_readonly("window_scans", &ScanOdometryConfig::window_scans)
      .def_readonly("window_m", &ScanOdometryConfig::window_m)
      .def_readonly("key_distance_m", &ScanOdometryConfig::key_distance_m)
      .def_readonly("key_turn_rad", &ScanOdometryConfig::key_turn_rad)
      .def_readonly("least_sigma_m", &ScanOdometryConfig::least_sigma_m)
      .def_readonly("least_sigma_rad", &ScanOdometryConfig::least_sigma_rad);

  py::class_<ScanMotion>(m, "ScanMotion", "Motion estimated from a scan.")
      .def_readonly("increment", &ScanMotion::increment,
                    "Motion since the previous scan as a message for a PoseEkf; zero duration for "
                    "the first scan.")
      .def_readonly("pose", &ScanMotion::pose, "T_start_body, accumulated since the first scan.")
      .def_readonly(
          "match", &ScanMotion::match,
          "Match against the local map in the body frame of the newest key scan (T_key_body).")
      .def_readonly("key", &ScanMotion::key, "Stamp of that key scan [ns].")
      .def_readonly("covariance", &ScanMotion::covariance,
                    "Covariance of T_key_body, (x, y, heading) [m, rad], shape (3, 3); that of "
                    "odometry if there is no match.");

  py::class_<ScanOdometry>(m, "ScanOdometry", R"(Laser odometry without a map.

Each scan is fitted to the latest key scans, starting from wheel odometry.

Raises
------
ValueError
    If a setting is out of bounds.

Examples
--------
>>> import numpy as np
>>> from locfuse import LaserGeometry, LaserScan, Pose2, ScanOdometry
>>> angle = np.pi / 180 * (np.arange(360) + 0.5)
>>> around = LaserGeometry(Pose2(), angle[0], np.pi / 180, range_min=0.1, range_max=10.0)
>>> odometry = ScanOdometry()
>>> for k, x in enumerate([0.0, 0.1, 0.2]):  # in a room of 8 x 6 m; wheels report 12 cm each time
...     ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
...     scan = LaserScan(k * 10**9, around, np.minimum(ahead, 3.0 / np.abs(np.sin(angle))))
...     result = odometry.on(scan, Pose2(0.12, 0.0, 0.0), np.diag([0.03, 0.01, 0.02]) ** 2)
>>> round(result.pose.x, 2)
0.2
)")
      .def(py::init<const ScanOdometryConfig&>(), py::arg_v("config", d, "ScanOdometryConfig()"))
      .def_property_readonly("config", &ScanOdometry::config)
      .def(
          "on",
          [](ScanOdometry& odometry, const LaserScan& scan, const Pose2& motion,
             const locfuse::Matrix<3, 3>& covariance) {
            const Alone alone(&odometry);
            return odometry.on(scan, motion, covariance);
          },
          py::arg("scan"), py::arg("motion"), py::arg("covariance"),
          R"(Process the next scan.

Parameters
----------
scan : LaserScan
motion : Pose2
    Motion since the previous scan from odometry; ignored for the first scan.
covariance : array, shape (3, 3)
    Covariance of that motion: (x, y, heading) in the body frame of its start [m, rad].

Returns
-------
ScanMotion
    The motion is that of odometry if the scan does not fit.

Raises
------
ValueError
    If scan, motion or covariance is not valid or the stamp is not later than the previous one; the
    state is then unchanged.
)");
}
