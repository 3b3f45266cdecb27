// SPDX-License-Identifier: Apache-2.0
#include "locfuse/geometry/rotation.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>

namespace locfuse {

Matrix<3, 3> cross_matrix(const Vector<3>& v) {
  Matrix<3, 3> m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Matrix<3, 3> rotation_by(const Vector<3>& v) {
  constexpr double kSmall = 1e-4;  // whose fourth power is beyond a double beside 1
  const double squared = v.squaredNorm();
  const double angle = std::sqrt(squared);
  const bool is_small = angle < kSmall;
  const double first = is_small ? 1.0 - squared / 6.0 : std::sin(angle) / angle;
  const double second = is_small ? 0.5 - squared / 24.0 : (1.0 - std::cos(angle)) / squared;
  const Matrix<3, 3> cross = cross_matrix(v);
  return Matrix<3, 3>::Identity() + first * cross + second * cross * cross;
}

Vector<3> rotation_vector(const Matrix<3, 3>& rotation) {
  const Vector<4> q = quaternion_of(rotation);
  const double sine = q.tail<3>().norm();
  constexpr double kSmall = 1e-9;
  return sine < kSmall ? Vector<3>(2.0 * q.tail<3>())
                       : Vector<3>(2.0 * std::atan2(sine, q(0)) / sine * q.tail<3>());
}

Matrix<3, 3> orthonormal(const Matrix<3, 3>& rotation) {
  Matrix<3, 3> result;
  result.col(0) = rotation.col(0).normalized();
  result.col(2) = result.col(0).cross(rotation.col(1)).normalized();
  result.col(1) = result.col(2).cross(result.col(0));
  return result;
}

Matrix<3, 3> rotation_of(double roll, double pitch, double yaw) {
  return rotation_by({0.0, 0.0, yaw}) * rotation_by({0.0, pitch, 0.0}) *
         rotation_by({roll, 0.0, 0.0});
}

double yaw_of(const Matrix<3, 3>& rotation) { return std::atan2(rotation(1, 0), rotation(0, 0)); }

Matrix<3, 3> rotation_up(const Vector<3>& direction) {
  if (!(direction.allFinite() && direction.squaredNorm() > 0.0)) {
    throw std::invalid_argument("a direction has a length that is not finite and > 0");
  }
  return Eigen::Quaterniond::FromTwoVectors(direction, Vector<3>::UnitZ()).toRotationMatrix();
}

Vector<4> quaternion_of(const Matrix<3, 3>& rotation) {
  const Eigen::Quaterniond q(rotation);
  return (q.w() < 0.0 ? -1.0 : 1.0) * Vector<4>(q.w(), q.x(), q.y(), q.z());
}

Matrix<3, 3> rotation_of(const Vector<4>& quaternion) {
  return Eigen::Quaterniond(quaternion(0), quaternion(1), quaternion(2), quaternion(3))
      .normalized()
      .toRotationMatrix();
}

}  // namespace locfuse
