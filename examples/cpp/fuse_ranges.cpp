// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <locfuse/locfuse.hpp>

int main() {
  using namespace locfuse;
  const auto anchors = std::make_shared<const AnchorMap>(
      std::vector<Anchor>{{1, {0, 0, 2}}, {2, {8, 0, 2}}, {3, {4, 6, 2}}});
  const Matrix<3, 3> covariance = Vector<3>(0.25, 0.25, 0.01).asDiagonal();
  const World world{anchors, {{0, {0, 0, 1.1}}}};  // and tag 0 on the robot
  PoseEkf ekf({}, world, {0, {3.0, 2.0, 0.0}, covariance});
  ekf.on(Increment{0, 100'000'000, {0.05, 0.0, 0.0}});  // stamps are nanoseconds
  ekf.on(Range{100'000'000, 0, 1, 3.63, 0.1});          // tag 0, anchor 1: 3.63 m +- 0.1 m
  ekf.on(Range{100'000'000, 0, 2, 5.52, 0.1});
  ekf.on(Range{100'000'000, 0, 3, 4.22, 0.1});
  const PoseEstimate now = ekf.estimate();
  std::printf("x = %.2f m, y = %.2f m\n", now.pose.x, now.pose.y);
}
