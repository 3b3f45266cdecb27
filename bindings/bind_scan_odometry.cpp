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
    Noise of one beam.
max_distance_m : float
    From the end of a beam to what it is matched with.
trimmed_share : float
    Of the matches, the worst, left out if they are off three sigma.
min_explained : float
    Share of the returns; below it the fit is searched anew.
max_iterations : int
    Of one fit.
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

  py::class_<LocalMap>(m, "LocalMap", R"(Ends of the beams of a few scans, to fit another scan to.

Parameters
----------
scans : list of (LaserScan, Pose2)
    And where each was taken, T_map_body. One for scan to scan.
config : LocalMapConfig, optional

Raises
------
ValueError
    If a setting is out of bounds; if a scan, pose or covariance is not valid.

Examples
--------
A room of 8 x 6 m, seen from its middle and from 0.2 m further on:

>>> import numpy as np
>>> from locfuse import LaserGeometry, LaserScan, LocalMap, Pose2
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
           R"(Fit a scan next to a guess.

Parameters
----------
scan : LaserScan
guess : Pose2
    T_map_body, within 20 cm and 5 degrees.
covariance : array, shape (3, 3), optional
    Of (x, y, heading) [m, rad]; with it the guess is a prior, too, and if it may be further off,
    or the fit explains too little, a search over three sigma of the position and all headings
    gives another start.

Returns
-------
ScanMatch
    TOO_FEW_MATCHES on an empty map.

Raises
------
ValueError
    If scan, guess or covariance are not valid.
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
    Key scans that make the local map; 1 is scan to scan.
window_m : float
    How far from the newest of them the others may be.
key_distance_m, key_turn_rad : float
    From the newest key scan, after which a scan becomes the next; 0 makes every one a key scan.
least_sigma_m, least_sigma_rad : float
    That odometry is known to at best, whatever it says of itself: it is not told in the very
    moment of the scan, and a robot that seems to stand may be on its way.
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

  py::class_<ScanMotion>(m, "ScanMotion", "What a scan says of the motion.")
      .def_readonly("increment", &ScanMotion::increment,
                    "Since the scan before: a message for a PoseEkf. Of no duration for the first.")
      .def_readonly("pose", &ScanMotion::pose, "T_start_body: increments from the first scan on.")
      .def_readonly("match", &ScanMotion::match,
                    "Against the local map, in the body frame of the newest key scan (T_key_body).")
      .def_readonly("key", &ScanMotion::key, "Stamp of that key scan [ns].")
      .def_readonly("covariance", &ScanMotion::covariance,
                    "Of T_key_body, (x, y, heading) [m, rad], shape (3, 3); without a match what "
                    "odometry alone says.");

  py::class_<ScanOdometry>(m, "ScanOdometry", R"(Motion of a body from its laser, without a map.

Each scan is fitted to the key scans driven through last, next to what odometry says.

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
>>> for k, x in enumerate([0.0, 0.1, 0.2]):  # in a room of 8 x 6 m; the wheels say 12 cm each time
...     ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
...     scan = LaserScan(k * 10**9, around, np.minimum(ahead, 3.0 / np.abs(np.sin(angle))))
...     told = odometry.on(scan, Pose2(0.12, 0.0, 0.0), np.diag([0.03, 0.01, 0.02]) ** 2)
>>> round(told.pose.x, 2)
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
          R"(Take the next scan.

Parameters
----------
scan : LaserScan
motion : Pose2
    Since the scan before, as odometry tells it; nothing becomes of that of the first scan.
covariance : array, shape (3, 3)
    Of that motion: (x, y, heading) in the body frame where it begins [m, rad].

Returns
-------
ScanMotion
    Where the scan does not fit, the motion is odometry's.

Raises
------
ValueError
    If scan, motion or covariance are not valid or the stamp is not later than the one before;
    nothing has changed then.
)");
}
