// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <vector>

#include "locfuse/math/numerical_jacobian.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::testing {

/// `jacobian` (M x 3) is the derivative of `h(pose)` (M) at `pose`, by central differences.
template <int M, class H>
void expect_jacobian(const Matrix<M, 3>& jacobian, const H& h, const Pose2& pose,
                     double tolerance = 1e-7, double step = 1e-6) {
  SCOPED_TRACE(::testing::Message() << "at " << pose.x << " " << pose.y << " " << pose.heading);
  const Vector<M> here = h(pose);
  const Matrix<M, 3> differences = numerical_jacobian<M, 3>(
      [&](const Vector<3>& delta) { return Vector<M>(h(retract(pose, delta)) - here); }, step);
  expect_near(jacobian, differences, tolerance);
}

/// 100 seeded poses and those where headings wrap.
[[nodiscard]] inline std::vector<Pose2> poses_to_try() {
  std::vector<Pose2> poses = {{0.0, 0.0, 0.0},
                              {1.0, -2.0, -kPi},
                              {1.0, -2.0, std::nextafter(kPi, 0.0)},
                              {-3.0, 4.0, kPi / 2.0},
                              {-3.0, 4.0, -kPi / 2.0}};
  Rng rng(20);
  for (int i = 0; i < 100; ++i) {
    poses.push_back(random_pose(rng));
  }
  return poses;
}

}  // namespace locfuse::testing
