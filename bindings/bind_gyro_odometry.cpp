// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/estimators/gyro_odometry.hpp"
#include "locfuse/estimators/scan_drive.hpp"

namespace py = pybind11;
using locfuse::GyroOdometry;
using locfuse::Imu;
using locfuse::ScanDrive;

namespace {

template <class Message>
void driven(ScanDrive& drive, const Message& message) {
  const Alone alone(&drive);
  drive.on(message);
}

template <class Message>
std::optional<GyroOdometry::Motion> turned(GyroOdometry& odometry, const Message& message) {
  const Alone alone(&odometry);
  return odometry.on(message);
}

}  // namespace

void bind_gyro_odometry(py::module_& m) {
  using Config = GyroOdometry::Config;
  using GyroTurn = GyroOdometry::Turn;
  using GyroVerdict = GyroOdometry::Verdict;
  using GyroMotion = GyroOdometry::Motion;
  py::native_enum<GyroTurn>(m, "GyroTurn", "enum.Enum", "How a turn is made of wheels and gyro.")
      .value("WEIGHTED", GyroTurn::kWeighted, "By their variances.")
      .value("AVERAGE", GyroTurn::kAverage, "The mean of both: zhang eq. (5).")
      .finalize();
  py::native_enum<GyroVerdict>(m, "GyroVerdict", "enum.Enum", "Outcome of a motion.")
      .value("TURNED", GyroVerdict::kTurned, "The turn is of wheels and gyro.")
      .value("SLIPPED", GyroVerdict::kSlipped,
             "They contradict each other: the turn is the gyro's.")
      .value("NO_GYRO", GyroVerdict::kNoGyro,
             "No sample near: the motion of the wheels as it came.")
      .finalize();
  py::class_<Config>(m, "GyroOdometryConfig", "Settings of a GyroOdometry.")
      .def(py::init<>())
      .def_readwrite("turn", &Config::turn)
      .def_readwrite("sigma_turn_per_sqrt_s", &Config::sigma_turn_per_sqrt_s,
                     "White noise of the gyro [rad / sqrt(s)].")
      .def_readwrite("sigma_bias_radps", &Config::sigma_bias_radps,
                     "Of its bias at the start [rad/s].")
      .def_readwrite("sigma_bias_radps_per_sqrt_s", &Config::sigma_bias_radps_per_sqrt_s,
                     "Random walk of the bias [rad/s / sqrt(s)].")
      .def_readwrite("sigma_scale", &Config::sigma_scale, "Of the gyro's scale.")
      .def_readwrite("sigma_turn_scale", &Config::sigma_turn_scale,
                     "Of the scale of the wheels' turn.")
      .def_readwrite("odometry", &Config::odometry, "Noise of the wheels, an OdometryConfig.");
  py::class_<GyroMotion>(m, "GyroMotion", "A motion whose turn is by wheels and gyro.")
      .def_readonly("verdict", &GyroMotion::verdict)
      .def_readonly("increment", &GyroMotion::increment);
  py::class_<GyroOdometry>(
      m, "GyroOdometry",
      R"(Odometry whose turn is measured by wheels and a gyro together; docs/models/motion.md.

Feed messages in order of arrival. The gyro's bias and the scale of the wheels' turn are learnt from
their differences; where the two contradict each other wheels slip, and the turn is the gyro's. With
an accelerometer the turn is that about the vertical, however the sensor is mounted.

Parameters
----------
config : GyroOdometryConfig

Raises
------
ValueError
    If a sigma is out of bounds, or a message is not valid.

Examples
--------
>>> from locfuse.core import GyroOdometry, GyroOdometryConfig, Imu, Increment, Pose2
>>> odometry = GyroOdometry(GyroOdometryConfig())
>>> for k in range(10):
...     odometry.on(Imu(k * 10**7, [0.0, 0.0, 0.5], [0.0, 0.0, 9.81]))
>>> motion = odometry.on(Increment(0, 10**8, Pose2(0.1, 0.0, 0.05)))
>>> motion.verdict.name, round(motion.increment.motion.heading, 3)
('TURNED', 0.05)
)")
      .def(py::init<const Config&>(), py::arg("config"))
      .def(
          "on",
          [](GyroOdometry& odometry, const Imu& z) {
            const Alone alone(&odometry);
            odometry.on(z);
          },
          py::arg("z"), "Takes a sample; one that is not newer than the last is dropped.")
      .def("on", &turned<locfuse::Velocity>, py::arg("u"),
           "Returns the motion since the velocity before; None for the first one and after a "
           "pause of a second.")
      .def("on", &turned<locfuse::Increment>, py::arg("u"),
           "Returns the motion with its turn by both.")
      .def_property_readonly("bias", &GyroOdometry::bias,
                             "Of the gyro about the vertical, as known now [rad/s].")
      .def_property_readonly("sigma_bias", &GyroOdometry::sigma_bias, "[rad/s].");
  py::class_<ScanDrive>(
      m, "ScanDrive",
      R"(Odometry of a laser's scans; the motion by wheels, if there are any, is where a fit begins.

Feed messages in order of arrival. Without wheels, or while they are silent for more than a second,
the body is expected to go on as it did in the last scans, give or take 0.5 m/s and 0.5 rad/s.

Parameters
----------
scans : ScanOdometryConfig, optional
odometry : OdometryConfig, optional
    Noise of the wheels.

Raises
------
ValueError
    If a setting is out of bounds, or a message is not valid.

Examples
--------
>>> import numpy as np
>>> from locfuse import LaserGeometry, LaserScan, Pose2
>>> from locfuse.core import Increment, ScanDrive
>>> angle = np.pi / 180 * (np.arange(360) + 0.5)
>>> around = LaserGeometry(Pose2(), angle[0], np.pi / 180, range_min=0.1, range_max=10.0)
>>> drive = ScanDrive()
>>> for k, x in enumerate([0.0, 0.1]):  # in a room of 8 x 6 m; wheels report 12 cm
...     ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
...     drive.on(Increment((k - 1) * 10**9, k * 10**9, Pose2(0.12, 0.0, 0.0)))
...     motion = drive.on(LaserScan(k * 10**9, around, np.minimum(ahead, 3 / np.abs(np.sin(angle)))))
>>> round(motion.motion.x, 2)
0.1
)")
      .def(py::init([](const locfuse::ScanOdometryConfig& scans,
                       const locfuse::OdometryMotion::Config& odometry) {
             return ScanDrive({scans, odometry});
           }),
           py::arg_v("scans", locfuse::ScanOdometryConfig{}, "ScanOdometryConfig()"),
           py::arg_v("odometry", locfuse::OdometryMotion::Config{}, "OdometryConfig()"))
      .def("on", &driven<locfuse::Velocity>, py::arg("u"),
           "Take the motion of the wheels; one that begins before the end of the last is dropped.")
      .def("on", &driven<locfuse::Increment>, py::arg("u"),
           "Take the motion of the wheels; one that begins before the end of the last is dropped.")
      .def(
          "on",
          [](ScanDrive& drive, const locfuse::LaserScan& scan) {
            const Alone alone(&drive);
            return drive.on(scan);
          },
          py::arg("scan"),
          "Return the motion since the last scan; None for the first, and for one that is late.");
}
