// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include <sstream>

#include "bindings.hpp"
#include "locfuse/frontends/cylinder_detector.hpp"
#include "locfuse/frontends/single_beam_landmarks.hpp"

namespace py = pybind11;
using locfuse::BeamLandmark;
using locfuse::Cylinder;
using locfuse::CylinderDetector;
using locfuse::CylinderDetectorConfig;
using locfuse::CylinderMethod;
using Unlocked = py::call_guard<py::gil_scoped_release>;

namespace {

void bind_detector_config(py::module_& m) {
  py::native_enum<CylinderMethod>(m, "CylinderMethod", "enum.IntEnum",
                                  "How a CylinderDetector finds cylinders and their centres.")
      .value("ARCS", CylinderMethod::kArcs, "a circle is fitted to all beams of a cylinder")
      .value("CLOSEST_BEAM", CylinderMethod::kClosestBeam,
             "found by arcs; the centre lies `radius_m` behind the shortest beam (wells)")
      .value("CONE", CylinderMethod::kCone,
             "the shortest beam of a cone as wide as a cylinder of `radius_m` (gadau2022); tests "
             "no shape")
      .finalize();
  const CylinderDetectorConfig d;
  py::class_<CylinderDetectorConfig> config(m, "CylinderDetectorConfig",
                                            R"(Settings of a CylinderDetector.

Parameters
----------
method : CylinderMethod
    How cylinders are found and their centres computed.
sigma_range_m, sigma_bearing_rad : float
    Noise of the length and of the direction (beam width, quantization) of one beam.
radius_m : float
    Radius of all cylinders; 0: estimated for each.
radius_min_m, radius_max_m : float
    Bounds of an estimated radius.
least_beams : int
    Minimum number of beams on a cylinder.
jump_gaps : float
    A depth step between two beams is an edge if it exceeds six sigma plus this multiple of the gap
    between beams.
misfit_probability : float
    Probability that the arc of a cylinder passes the chi-square gate.
least_evidence : float
    Minimum chi-square difference to a straight wall. An object too small to decide is a cylinder
    if it is isolated and as wide as `radius_m`, or for 0 any width within bounds.
least_corner_evidence : float
    Minimum chi-square difference to a right-angled corner. Thin cylinders resemble corners of
    equally small boxes; -20 accepts all of them where there are no boxes.
leg_radius_m, leg_distance_m : float
    A cylinder up to this radius and this close to anything as thin is a leg; 0: no people.
least_intensity : float
    Minimum intensity of at least one beam; 0: any.
)");
  config
      .def(py::init([](CylinderMethod method, double sigma_range_m, double sigma_bearing_rad,
                       double radius_m, double radius_min_m, double radius_max_m, int least_beams,
                       double jump_gaps, double misfit_probability, double least_evidence,
                       double least_corner_evidence, double leg_radius_m, double leg_distance_m,
                       double least_intensity) {
             return CylinderDetectorConfig{method,
                                           sigma_range_m,
                                           sigma_bearing_rad,
                                           radius_m,
                                           radius_min_m,
                                           radius_max_m,
                                           least_beams,
                                           jump_gaps,
                                           misfit_probability,
                                           least_evidence,
                                           least_corner_evidence,
                                           leg_radius_m,
                                           leg_distance_m,
                                           least_intensity};
           }),
           py::kw_only(), py::arg_v("method", d.method, "CylinderMethod.ARCS"),
           py::arg("sigma_range_m") = d.sigma_range_m,
           py::arg("sigma_bearing_rad") = d.sigma_bearing_rad, py::arg("radius_m") = d.radius_m,
           py::arg("radius_min_m") = d.radius_min_m, py::arg("radius_max_m") = d.radius_max_m,
           py::arg("least_beams") = d.least_beams, py::arg("jump_gaps") = d.jump_gaps,
           py::arg("misfit_probability") = d.misfit_probability,
           py::arg("least_evidence") = d.least_evidence,
           py::arg("least_corner_evidence") = d.least_corner_evidence,
           py::arg("leg_radius_m") = d.leg_radius_m, py::arg("leg_distance_m") = d.leg_distance_m,
           py::arg("least_intensity") = d.least_intensity)
      .def_readonly("method", &CylinderDetectorConfig::method)
      .def_readonly("sigma_range_m", &CylinderDetectorConfig::sigma_range_m)
      .def_readonly("sigma_bearing_rad", &CylinderDetectorConfig::sigma_bearing_rad)
      .def_readonly("radius_m", &CylinderDetectorConfig::radius_m)
      .def_readonly("radius_min_m", &CylinderDetectorConfig::radius_min_m)
      .def_readonly("radius_max_m", &CylinderDetectorConfig::radius_max_m)
      .def_readonly("least_beams", &CylinderDetectorConfig::least_beams)
      .def_readonly("jump_gaps", &CylinderDetectorConfig::jump_gaps)
      .def_readonly("misfit_probability", &CylinderDetectorConfig::misfit_probability)
      .def_readonly("least_evidence", &CylinderDetectorConfig::least_evidence)
      .def_readonly("least_corner_evidence", &CylinderDetectorConfig::least_corner_evidence)
      .def_readonly("leg_radius_m", &CylinderDetectorConfig::leg_radius_m)
      .def_readonly("leg_distance_m", &CylinderDetectorConfig::leg_distance_m)
      .def_readonly("least_intensity", &CylinderDetectorConfig::least_intensity);
}

void bind_detector(py::module_& m) {
  bind_detector_config(m);
  py::class_<Cylinder>(m, "Cylinder", "Upright cylinder in the scan plane.")
      .def_readonly("range", &Cylinder::range, "Range of the centre from the laser [m].")
      .def_readonly("bearing", &Cylinder::bearing,
                    "Bearing of the centre in the laser frame [rad].")
      .def_readonly("radius", &Cylinder::radius, "Metres.")
      .def_readonly("covariance", &Cylinder::covariance,
                    "Covariance of (range, bearing, radius) [m, rad, m], shape (3, 3); row and "
                    "column of a fixed radius are zero. Mean squared error of a single beam's.")
      .def_readonly(
          "first", &Cylinder::first,
          "First beam of the arc by bearing; larger than `last` across the end of the scan.")
      .def_readonly("last", &Cylinder::last, "Last beam of the arc by bearing.")
      .def_readonly("beams", &Cylinder::beams, "Number of beams in the fit.")
      .def_readonly("misfit", &Cylinder::misfit, "Chi-square per degree of freedom.")
      .def("__repr__", [](const Cylinder& c) {
        std::ostringstream text;
        text << "Cylinder(range=" << c.range << ", bearing=" << c.bearing << ", radius=" << c.radius
             << ", beams=" << c.beams << ")";
        return text.str();
      });
  py::class_<CylinderDetector>(m, "CylinderDetector", R"(Detects cylinders in single scans.

Raises
------
ValueError
    If a setting is out of bounds.

Examples
--------
A single cylinder of radius 0.5 m, 2 m ahead:

>>> import numpy as np
>>> from locfuse import CylinderDetector, LaserGeometry, LaserScan, Pose2
>>> angle = np.pi / 180 * (np.arange(360) - 180)
>>> around = LaserGeometry(Pose2(), angle[0], np.pi / 180, range_min=0.1, range_max=10.0)
>>> with np.errstate(invalid="ignore"):
...     ranges = 2 * np.cos(angle) - np.sqrt(0.5**2 - (2 * np.sin(angle)) ** 2)
>>> seen = LaserScan(0, around, np.where(np.cos(angle) > 0, ranges, np.nan))
>>> [found] = CylinderDetector().detect(seen)
>>> round(found.range, 3), round(abs(found.bearing), 3), round(found.radius, 3), found.beams
(2.0, 0.0, 0.5, 29)
)")
      .def(py::init<const CylinderDetectorConfig&>(),
           py::arg_v("config", CylinderDetectorConfig{}, "CylinderDetectorConfig()"))
      .def_property_readonly("config", &CylinderDetector::config)
      .def("detect", &CylinderDetector::detect, py::arg("scan"), Unlocked(),
           R"(Detect the cylinders of a scan.

Parameters
----------
scan : LaserScan

Returns
-------
list of Cylinder
    In order of `first`.

Raises
------
ValueError
    If the scan is not valid, or lacks the intensities that `least_intensity` requires.
)");
}

void bind_single_beams(py::module_& m) {
  py::class_<BeamLandmark>(m, "BeamLandmark",
                           "Beam that represents a landmark: `beam`, `range` [m], `bearing` in the "
                           "laser frame [rad]; -1, -1 and 0 if there is none.")
      .def_readonly("beam", &BeamLandmark::beam)
      .def_readonly("range", &BeamLandmark::range)
      .def_readonly("bearing", &BeamLandmark::bearing);
  m.def("closest_beam", &locfuse::closest_beam, py::arg("scan"), py::arg("first"), py::arg("last"),
        py::arg("radius"), Unlocked(),
        R"(Centre of a cylinder from its closest beam (wells eq. 8-11).

Parameters
----------
scan : LaserScan
first, last : int
    Beams of the cylinder; `first` > `last` wraps around the end of the scan.
radius : float
    Added to the minimum range [m].

Returns
-------
BeamLandmark

Raises
------
ValueError
    If the scan is not valid, a beam is not in it, or `radius` is not a finite number >= 0.
)");
  m.def("recognize_landmarks", &locfuse::recognize_landmarks, py::arg("scan"), py::arg("predicted"),
        py::arg("landmarks"), Unlocked(),
        R"(Beams that a predicted pose assigns to landmarks (gadau2022 Fig. 3).

Parameters
----------
scan : LaserScan
predicted : Pose2
    T_world_body.
landmarks : LandmarkMap

Returns
-------
list of BeamLandmark
    One per landmark in order of id, with the measured range to the surface.

Raises
------
ValueError
    If scan or pose is not valid.
)");
}

}  // namespace

void bind_landmarks(py::module_& m) {
  bind_detector(m);
  bind_single_beams(m);
}
