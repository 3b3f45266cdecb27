// SPDX-License-Identifier: Apache-2.0
#include <cstdio>

#include "bindings.hpp"
#include "locfuse/geometry/pose2.hpp"

namespace py = pybind11;
using locfuse::Pose2;

void bind_geometry(py::module_& m) {
  py::class_<Pose2>(m, "Pose2", R"(Pose in the plane, or a motion in the previous body frame.

Parameters
----------
x, y : float
    Metres.
heading : float
    Radians, counter-clockwise; results are wrapped to [-pi, pi).

Examples
--------
>>> from locfuse import Pose2
>>> Pose2(1, 2, 0) * Pose2(0.5, 0, 0.25)
Pose2(x=1.5, y=2, heading=0.25)
)")
      .def(py::init<double, double, double>(), py::arg("x") = 0.0, py::arg("y") = 0.0,
           py::arg("heading") = 0.0)
      .def_readonly("x", &Pose2::x, "Metres.")
      .def_readonly("y", &Pose2::y, "Metres.")
      .def_readonly("heading", &Pose2::heading, "Radians.")
      .def("act", &Pose2::act, py::arg("point"), "Point (2,) in the target frame.")
      .def("inverse", [](const Pose2& pose) { return locfuse::inverse(pose); })
      .def(
          "__mul__", [](const Pose2& a, const Pose2& b) { return a * b; }, py::is_operator())
      .def("__eq__",
           [](const Pose2& a, const py::object& other) {
             if (!py::isinstance<Pose2>(other)) {
               return false;
             }
             const auto& b = other.cast<const Pose2&>();
             return a.x == b.x && a.y == b.y && a.heading == b.heading;
           })
      .def("__repr__", [](const Pose2& p) {
        char text[96];
        std::snprintf(text, sizeof(text), "Pose2(x=%g, y=%g, heading=%g)", p.x, p.y, p.heading);
        return std::string(text);
      });
  m.def("arc", &locfuse::arc, py::arg("forward"), py::arg("left"), py::arg("turn"),
        "Motion along the arc of a constant body twist (metres, metres, radians): SE(2) "
        "exponential.");
  m.def("local", &locfuse::local, py::arg("to"), py::arg("origin"),
        "Error state (3,) from `origin` to `to` [m, m, rad], heading wrapped.");
}
