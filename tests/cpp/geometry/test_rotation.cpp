// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <cmath>

#include "locfuse/geometry/rotation.hpp"
#include "locfuse/math/angle.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_rotation {
namespace {

using testing::expect_near;
using testing::Rng;
using testing::uniform;

Vector<3> any(Rng& rng, double length) {
  return length *
         Vector<3>(uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0))
             .normalized();
}

TEST(Rotation, by_a_vector_equals_that_about_its_axis) {
  Rng rng(1);
  for (int i = 0; i < 200; ++i) {
    const double angle = std::pow(10.0, uniform(rng, -12.0, 0.49));
    const Vector<3> v = any(rng, angle);
    const Matrix<3, 3> R = rotation_by(v);
    expect_near(R, Eigen::AngleAxisd(angle, v / angle).toRotationMatrix(), 1e-14);
    expect_near(rotation_vector(R), v, 1e-13 + 1e-7 * angle * (angle > 3.0));
  }
  expect_near(rotation_by(Vector<3>::Zero()), Matrix<3, 3>::Identity(), 0.0);
  expect_near(rotation_vector(Matrix<3, 3>::Identity()), Vector<3>::Zero(), 0.0);
}

TEST(Rotation, cross_matrix_makes_the_cross_product) {
  Rng rng(2);
  const Vector<3> v = any(rng, 2.0);
  const Vector<3> w = any(rng, 3.0);
  expect_near(cross_matrix(v) * w, v.cross(w), 1e-15);
}

TEST(Rotation, of_angles_is_by_roll_then_pitch_then_yaw) {
  const Matrix<3, 3> R = rotation_of(0.3, -0.4, 2.0);
  expect_near(
      R,
      (Eigen::AngleAxisd(2.0, Vector<3>::UnitZ()) * Eigen::AngleAxisd(-0.4, Vector<3>::UnitY()) *
       Eigen::AngleAxisd(0.3, Vector<3>::UnitX()))
          .toRotationMatrix(),
      1e-15);
  EXPECT_NEAR(yaw_of(R), 2.0, 1e-15);
}

TEST(Rotation, up_turns_a_direction_upwards_and_no_further) {
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Vector<3> d = any(rng, uniform(rng, 0.1, 20.0));
    const Matrix<3, 3> R = rotation_up(d);
    expect_near(R * d, d.norm() * Vector<3>::UnitZ(), 1e-12);
    EXPECT_NEAR(rotation_vector(R).norm(), std::acos(d.z() / d.norm()), 1e-7);
  }
  const Vector<3> down(0.0, 0.0, -9.8);
  expect_near(rotation_up(down) * down, Vector<3>(0.0, 0.0, 9.8), 1e-12);
  testing::expect_refused([] { (void)rotation_up(Vector<3>::Zero()); }, "length");
  testing::expect_refused([] { (void)rotation_up(Vector<3>(0.0, 0.0, std::nan(""))); }, "length");
}

TEST(Rotation, quaternions_go_there_and_back) {
  Rng rng(4);
  for (int i = 0; i < 100; ++i) {
    const Matrix<3, 3> R = rotation_by(any(rng, uniform(rng, 0.0, 3.1)));
    const Vector<4> q = quaternion_of(R);
    EXPECT_GE(q(0), 0.0);
    EXPECT_NEAR(q.norm(), 1.0, 1e-14);
    expect_near(rotation_of(q), R, 1e-14);
    expect_near(rotation_of(Vector<4>(-2.0 * q)), R, 1e-14);
  }
}

TEST(Rotation, orthonormal_mends_rounding_and_keeps_a_rotation) {
  Rng rng(5);
  const Matrix<3, 3> R = rotation_by(any(rng, 2.0));
  expect_near(orthonormal(R), R, 1e-15);
  const Matrix<3, 3> mended =
      orthonormal(R + 1e-6 * Matrix<3, 3>(testing::random_matrix(rng, 3, 3)));
  expect_near(mended * mended.transpose(), Matrix<3, 3>::Identity(), 1e-14);
  expect_near(mended, R, 1e-5);
}

}  // namespace
}  // namespace locfuse::test_rotation
