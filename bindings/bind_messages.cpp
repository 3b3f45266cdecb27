// SPDX-License-Identifier: Apache-2.0
#include <sstream>

#include "bindings.hpp"
#include "locfuse/messages/messages.hpp"

namespace py = pybind11;
using locfuse::Id;
using locfuse::Increment;
using locfuse::Pose2;
using locfuse::PoseObservation;
using locfuse::PositionFix;
using locfuse::Range;
using locfuse::Stamp;
using locfuse::Velocity;

namespace {

template <class M>
M checked(const M& message) {
  validate(message);
  return message;
}

}  // namespace

void bind_messages(py::module_& m) {
  py::class_<Velocity>(m, "Velocity",
                       "Wheel odometry as body velocities, held from `stamp` [ns] until the next: "
                       "`forward` [m/s], `turn_rate` [rad/s].")
      .def(py::init([](Stamp stamp, double forward, double turn_rate) {
             return checked(Velocity{stamp, forward, turn_rate});
           }),
           py::arg("stamp"), py::arg("forward"), py::arg("turn_rate"))
      .def_readonly("stamp", &Velocity::stamp)
      .def_readonly("forward", &Velocity::forward)
      .def_readonly("turn_rate", &Velocity::turn_rate)
      .def("__repr__", [](const Velocity& v) {
        std::ostringstream text;
        text << "Velocity(stamp=" << v.stamp << ", forward=" << v.forward
             << ", turn_rate=" << v.turn_rate << ")";
        return text.str();
      });
  py::class_<Increment>(m, "Increment",
                        "Wheel odometry as the motion driven from `begin` to `stamp` [ns]: a Pose2 "
                        "in the body frame at `begin`.")
      .def(py::init([](Stamp begin, Stamp stamp, const Pose2& motion) {
             return checked(Increment{begin, stamp, motion});
           }),
           py::arg("begin"), py::arg("stamp"), py::arg("motion"))
      .def_static("from_trans_rot", &Increment::from_trans_rot, py::arg("begin"), py::arg("stamp"),
                  py::arg("trans"), py::arg("rot"),
                  "ekim2020 eq. (6): drive `trans` [m] along the old heading, then turn by `rot` "
                  "[rad].")
      .def_readonly("begin", &Increment::begin)
      .def_readonly("stamp", &Increment::stamp)
      .def_readonly("motion", &Increment::motion)
      .def("__repr__", [](const Increment& u) {
        std::ostringstream text;
        text << "Increment(begin=" << u.begin << ", stamp=" << u.stamp << ", motion=(" << u.motion.x
             << ", " << u.motion.y << ", " << u.motion.heading << "))";
        return text.str();
      });
  py::class_<Range>(m, "Range",
                    "Distance [m] between a tag on the body and an anchor in the world. Without "
                    "`sigma` [m] the model's own is used.")
      .def(py::init([](Stamp stamp, Id tag, Id anchor, double range, std::optional<double> sigma) {
             return checked(Range{stamp, tag, anchor, range, sigma});
           }),
           py::arg("stamp"), py::arg("tag"), py::arg("anchor"), py::arg("range"),
           py::arg("sigma") = py::none())
      .def_readonly("stamp", &Range::stamp)
      .def_readonly("tag", &Range::tag)
      .def_readonly("anchor", &Range::anchor)
      .def_readonly("range", &Range::range)
      .def_readonly("sigma", &Range::sigma)
      .def("__repr__", [](const Range& z) {
        std::ostringstream text;
        text << "Range(stamp=" << z.stamp << ", tag=" << z.tag << ", anchor=" << z.anchor
             << ", range=" << z.range;
        if (z.sigma) {
          text << ", sigma=" << *z.sigma;
        }
        text << ")";
        return text.str();
      });
  py::class_<PositionFix>(m, "PositionFix",
                          "Position (2,) [m] in world with its covariance (2, 2) [m^2].")
      .def(py::init([](Stamp stamp, const locfuse::Vector<2>& position,
                       const locfuse::Matrix<2, 2>& covariance) {
             return checked(PositionFix{stamp, position, covariance});
           }),
           py::arg("stamp"), py::arg("position"), py::arg("covariance"))
      .def_readonly("stamp", &PositionFix::stamp)
      .def_readonly("position", &PositionFix::position)
      .def_readonly("covariance", &PositionFix::covariance)
      .def("__repr__", [](const PositionFix& z) {
        std::ostringstream text;
        text << "PositionFix(stamp=" << z.stamp << ", position=(" << z.position.x() << ", "
             << z.position.y() << "))";
        return text.str();
      });
  py::class_<PoseObservation>(m, "PoseObservation",
                              "T_world_body from another localizer, with the covariance (3, 3) of "
                              "(x, y, heading).")
      .def(py::init([](Stamp stamp, const Pose2& pose, const locfuse::Matrix<3, 3>& covariance) {
             return checked(PoseObservation{stamp, pose, covariance});
           }),
           py::arg("stamp"), py::arg("pose"), py::arg("covariance"))
      .def_readonly("stamp", &PoseObservation::stamp)
      .def_readonly("pose", &PoseObservation::pose)
      .def_readonly("covariance", &PoseObservation::covariance)
      .def("__repr__", [](const PoseObservation& z) {
        std::ostringstream text;
        text << "PoseObservation(stamp=" << z.stamp << ", pose=(" << z.pose.x << ", " << z.pose.y
             << ", " << z.pose.heading << "))";
        return text.str();
      });
}
