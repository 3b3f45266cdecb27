// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include <sstream>

#include "bindings.hpp"
#include "locfuse/messages/limits.hpp"
#include "locfuse/messages/message.hpp"
#include "numpy.hpp"

namespace py = pybind11;
using locfuse::Altitude;
using locfuse::Heading;
using locfuse::Id;
using locfuse::Increment;
using locfuse::LaserGeometry;
using locfuse::LaserScan;
using locfuse::Limits;
using locfuse::Pose2;
using locfuse::PoseObservation;
using locfuse::PositionFix;
using locfuse::Range;
using locfuse::RangeBearing;
using locfuse::Stamp;
using locfuse::Vector;
using locfuse::Velocity;

namespace {

template <class M>
M checked(const M& message) {
  validate(message);
  return message;
}

std::vector<double> column_of(const char* name, const Column<double>& column) {
  expect_shape(name, column, column.ndim() > 0 ? column.shape(0) : 0);
  return {column.data(), column.data() + column.size()};
}

py::array_t<double> view_of(const std::vector<double>& column, const py::object& owner) {
  py::array_t<double> view(static_cast<py::ssize_t>(column.size()), column.data(), owner);
  view.attr("flags").attr("writeable") = false;
  return view;
}

void bind_laser(py::module_& m) {
  py::class_<LaserGeometry, std::shared_ptr<LaserGeometry>>(
      m, "LaserGeometry",
      "Mounting and beams of a 2D laser: beam i points at angle_min + i * angle_increment [rad] "
      "from the laser's x axis, `time_increment` [s] after the one before; `pose_in_body` is "
      "T_body_laser; ranges [m].")
      .def(py::init([](const Pose2& pose_in_body, double angle_min, double angle_increment,
                       double range_min, double range_max, double time_increment) {
             return std::make_shared<LaserGeometry>(checked(LaserGeometry{
                 pose_in_body, angle_min, angle_increment, range_min, range_max, time_increment}));
           }),
           py::arg("pose_in_body"), py::arg("angle_min"), py::arg("angle_increment"),
           py::arg("range_min"), py::arg("range_max"), py::arg("time_increment") = 0.0)
      .def_readonly("pose_in_body", &LaserGeometry::pose_in_body)
      .def_readonly("angle_min", &LaserGeometry::angle_min)
      .def_readonly("angle_increment", &LaserGeometry::angle_increment)
      .def_readonly("range_min", &LaserGeometry::range_min)
      .def_readonly("range_max", &LaserGeometry::range_max)
      .def_readonly("time_increment", &LaserGeometry::time_increment);
  py::class_<LaserScan>(
      m, "LaserScan",
      "One scan of a 2D laser, `stamp` [ns] that of its middle beam: `ranges` (beams,) [m], NaN "
      "without return. Ranges outside (range_min, range_max) do not count as returns: many lasers "
      "report range_max if there is "
      "none. `intensities` (beams,) in the unit of the laser; empty if not reported.")
      .def(py::init([](Stamp stamp, std::shared_ptr<LaserGeometry> geometry,
                       const Column<double>& ranges,
                       const std::optional<Column<double>>& intensities) {
             LaserScan scan{stamp, std::move(geometry), column_of("ranges", ranges)};
             if (intensities) {
               scan.intensities = column_of("intensities", *intensities);
             }
             return checked(scan);
           }),
           py::arg("stamp"), py::arg("geometry"), py::arg("ranges"),
           py::arg("intensities") = py::none())
      .def_readonly("stamp", &LaserScan::stamp)
      .def_property_readonly("geometry", [](const LaserScan& scan) { return *scan.geometry; })
      .def_property_readonly(
          "ranges",
          [](const py::object& self) {
            return view_of(self.cast<const LaserScan&>().ranges, self);
          },
          "Metres (beams,), a read-only view.")
      .def_property_readonly(
          "intensities",
          [](const py::object& self) {
            return view_of(self.cast<const LaserScan&>().intensities, self);
          },
          "In the unit of the laser, (beams,) or (0,), a read-only view.")
      .def("__repr__", [](const LaserScan& scan) {
        return "LaserScan(stamp=" + std::to_string(scan.stamp) + ", " +
               std::to_string(scan.ranges.size()) + " beams)";
      });
}

}  // namespace

void bind_messages(py::module_& m) {
  using locfuse::Source;
  py::native_enum<Source>(m, "Source", "enum.Enum", "Kind of sensor that a message comes from.")
      .value("ODOMETRY", Source::kOdometry)
      .value("RANGES", Source::kRanges)
      .value("POSITIONS", Source::kPositions)
      .value("POSES", Source::kPoses)
      .value("LANDMARK_SIGHTINGS", Source::kSightings)
      .value("SCANS", Source::kScans)
      .value("ALTITUDES", Source::kAltitudes)
      .value("HEADINGS", Source::kHeadings)
      .value("IMU", Source::kImu)
      .finalize();
  py::class_<Velocity>(m, "Velocity",
                       "Wheel odometry as body velocities, constant from `stamp` [ns] until the "
                       "next message: `forward` [m/s], `turn_rate` [rad/s], and `left` [m/s] of "
                       "wheels that roll sideways, too.")
      .def(py::init([](Stamp stamp, double forward, double turn_rate, double left) {
             return checked(Velocity{stamp, forward, turn_rate, left});
           }),
           py::arg("stamp"), py::arg("forward"), py::arg("turn_rate"), py::arg("left") = 0.0)
      .def_readonly("stamp", &Velocity::stamp)
      .def_readonly("forward", &Velocity::forward)
      .def_readonly("turn_rate", &Velocity::turn_rate)
      .def_readonly("left", &Velocity::left)
      .def("__repr__", [](const Velocity& v) {
        std::ostringstream text;
        text << "Velocity(stamp=" << v.stamp << ", forward=" << v.forward
             << ", turn_rate=" << v.turn_rate << ", left=" << v.left << ")";
        return text.str();
      });
  py::class_<Increment>(m, "Increment",
                        "Wheel odometry as the motion from `begin` to `stamp` [ns]: a Pose2 in the "
                        "body frame at `begin`. `variance` of its dx, dy [m^2] and dheading "
                        "[rad^2] defaults to that of the model.")
      .def(py::init([](Stamp begin, Stamp stamp, const Pose2& motion,
                       const std::optional<Vector<3>>& variance) {
             return checked(Increment{begin, stamp, motion, variance});
           }),
           py::arg("begin"), py::arg("stamp"), py::arg("motion"), py::arg("variance") = py::none())
      .def_static(
          "from_drive_then_turn", &Increment::from_drive_then_turn, py::arg("begin"),
          py::arg("stamp"), py::arg("trans"), py::arg("rot"),
          "ekim2020 eq. (6): drive `trans` [m] along the old heading, then turn by `rot` [rad].")
      .def_readonly("begin", &Increment::begin)
      .def_readonly("stamp", &Increment::stamp)
      .def_readonly("motion", &Increment::motion)
      .def_readonly("variance", &Increment::variance)
      .def("__repr__", [](const Increment& u) {
        std::ostringstream text;
        text << "Increment(begin=" << u.begin << ", stamp=" << u.stamp << ", motion=(" << u.motion.x
             << ", " << u.motion.y << ", " << u.motion.heading << "))";
        return text.str();
      });
  py::class_<locfuse::Imu>(m, "Imu",
                           "Angular rate [rad/s] and specific force [m/s^2] (at rest 9.81 upwards; "
                           "None without an accelerometer) in the axes of the sensor, (3,) each.")
      .def(py::init([](Stamp stamp, const Vector<3>& angular_rate,
                       const std::optional<Vector<3>>& specific_force) {
             return checked(locfuse::Imu{stamp, angular_rate, specific_force});
           }),
           py::arg("stamp"), py::arg("angular_rate"), py::arg("specific_force") = py::none())
      .def_readonly("stamp", &locfuse::Imu::stamp)
      .def_readonly("angular_rate", &locfuse::Imu::angular_rate)
      .def_readonly("specific_force", &locfuse::Imu::specific_force);
  py::class_<Range>(m, "Range",
                    "Distance [m] between a tag on the body and an anchor in the world. `sigma` "
                    "[m] defaults to that of the model.")
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
                          "Position (2,) [m] in world with its covariance (2, 2) [m^2], of `tag` "
                          "or, without one, of the antenna.")
      .def(py::init([](Stamp stamp, const locfuse::Vector<2>& position,
                       const locfuse::Matrix<2, 2>& covariance, std::optional<Id> tag) {
             return checked(PositionFix{stamp, position, covariance, tag});
           }),
           py::arg("stamp"), py::arg("position"), py::arg("covariance"),
           py::arg("tag") = py::none())
      .def_readonly("stamp", &PositionFix::stamp)
      .def_readonly("position", &PositionFix::position)
      .def_readonly("covariance", &PositionFix::covariance)
      .def_readonly("tag", &PositionFix::tag)
      .def("__repr__", [](const PositionFix& z) {
        std::ostringstream text;
        text << "PositionFix(stamp=" << z.stamp << ", position=(" << z.position.x() << ", "
             << z.position.y() << ")";
        if (z.tag) {
          text << ", tag=" << *z.tag;
        }
        text << ")";
        return text.str();
      });
  py::class_<PoseObservation>(
      m, "PoseObservation",
      "T_world_body from another localizer, with the covariance (3, 3) of (x, y, heading).")
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
  py::class_<Altitude>(
      m, "Altitude",
      "Height [m] of an altimeter above z = 0 of the world. With a PositionFix of "
      "the same stamp it forms a 3D fix. `sigma` [m] defaults to that of the model.")
      .def(py::init([](Stamp stamp, double height, std::optional<double> sigma) {
             return checked(Altitude{stamp, height, sigma});
           }),
           py::arg("stamp"), py::arg("height"), py::arg("sigma") = py::none())
      .def_readonly("stamp", &Altitude::stamp)
      .def_readonly("height", &Altitude::height)
      .def_readonly("sigma", &Altitude::sigma)
      .def("__repr__", [](const Altitude& z) {
        std::ostringstream text;
        text << "Altitude(stamp=" << z.stamp << ", height=" << z.height;
        if (z.sigma) {
          text << ", sigma=" << *z.sigma;
        }
        text << ")";
        return text.str();
      });
  py::class_<Heading>(
      m, "Heading",
      "Heading [rad] of the body in world, counter-clockwise from x: of a magnetometer, the "
      "orientation of an inertial unit or two antennas. With `is_course` the direction in which "
      "the antenna of GPS travels. `sigma` [rad] defaults to that of the model.")
      .def(py::init([](Stamp stamp, double heading, std::optional<double> sigma, bool is_course) {
             return checked(Heading{stamp, heading, sigma, is_course});
           }),
           py::arg("stamp"), py::arg("heading"), py::arg("sigma") = py::none(),
           py::arg("is_course") = false)
      .def_readonly("stamp", &Heading::stamp)
      .def_readonly("heading", &Heading::heading)
      .def_readonly("sigma", &Heading::sigma)
      .def_readonly("is_course", &Heading::is_course)
      .def("__repr__", [](const Heading& z) {
        std::ostringstream text;
        text << "Heading(stamp=" << z.stamp << ", heading=" << z.heading;
        if (z.sigma) {
          text << ", sigma=" << *z.sigma;
        }
        text << (z.is_course ? ", is_course=True)" : ")");
        return text.str();
      });
  py::class_<RangeBearing>(
      m, "RangeBearing",
      "Landmark observation from a sensor on the body: `range` [m] to its centre, `bearing` [rad] "
      "counter-clockwise from the sensor's x axis, or one of the two. Without `landmark` it is "
      "associated; `covariance` (2, 2) of (range, bearing) defaults to that of the model. Only an "
      "AirEkf uses `elevation` [rad], positive upwards, of the line of sight along which the range "
      "is measured.")
      .def(py::init([](Stamp stamp, std::optional<Id> landmark, std::optional<double> range,
                       std::optional<double> bearing,
                       const std::optional<locfuse::Matrix<2, 2>>& covariance,
                       std::optional<double> elevation, std::optional<double> sigma_elevation) {
             const RangeBearing z{stamp,      landmark,  range,          bearing,
                                  covariance, elevation, sigma_elevation};
             validate_in_space(z);
             return z;
           }),
           py::arg("stamp"), py::arg("landmark") = py::none(), py::arg("range") = py::none(),
           py::arg("bearing") = py::none(), py::arg("covariance") = py::none(),
           py::arg("elevation") = py::none(), py::arg("sigma_elevation") = py::none())
      .def_readonly("stamp", &RangeBearing::stamp)
      .def_readonly("landmark", &RangeBearing::landmark)
      .def_readonly("range", &RangeBearing::range)
      .def_readonly("bearing", &RangeBearing::bearing)
      .def_readonly("covariance", &RangeBearing::covariance)
      .def_readonly("elevation", &RangeBearing::elevation)
      .def_readonly("sigma_elevation", &RangeBearing::sigma_elevation)
      .def("__repr__", [](const RangeBearing& z) {
        std::ostringstream text;
        text << "RangeBearing(stamp=" << z.stamp;
        if (z.landmark) {
          text << ", landmark=" << *z.landmark;
        }
        if (z.range) {
          text << ", range=" << *z.range;
        }
        if (z.bearing) {
          text << ", bearing=" << *z.bearing;
        }
        if (z.elevation) {
          text << ", elevation=" << *z.elevation;
        }
        text << ")";
        return text.str();
      });
  bind_laser(m);
  py::class_<Limits>(m, "Limits",
                     "Physical limits of robot and sensors; a message beyond them is IMPLAUSIBLE.")
      .def(py::init<>())
      .def_readwrite("speed_mps", &Limits::speed_mps)
      .def_readwrite("turn_rate_radps", &Limits::turn_rate_radps)
      .def_readwrite("range_m", &Limits::range_m)
      .def_readwrite("distance_m", &Limits::distance_m,
                     "Maximum distance of positions from the world origin [m].");
}
