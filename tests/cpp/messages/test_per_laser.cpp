// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <memory>

#include "locfuse/messages/per_laser.hpp"

namespace locfuse::test_per_laser {
namespace {

LaserScan scan_of(const Pose2& mount, double range_max = 10.0) {
  return {
      0, std::make_shared<const LaserGeometry>(LaserGeometry{mount, 0.0, 0.1, 0.1, range_max}), {}};
}

TEST(PerLaser, a_laser_is_known_by_its_mount) {
  internal::PerLaser<int> values;
  const LaserScan front = scan_of({0.2, 0.0, 0.0});
  const LaserScan turned = scan_of({0.2, 0.0, 1e-16});
  EXPECT_TRUE(values.empty());
  EXPECT_EQ(values.find(front), nullptr);
  values.set(front, 1);
  EXPECT_EQ(values.find(turned), nullptr);
  values.set(turned, 2);
  values.set(scan_of({0.2, 0.0, 0.0}, 20.0), 3);
  ASSERT_NE(values.find(front), nullptr);
  EXPECT_EQ(*values.find(front), 3);
  EXPECT_EQ(*values.find(turned), 2);
}

TEST(PerLaser, of_one_that_moves_on_the_body_the_last_mounts_are_kept) {
  internal::PerLaser<std::size_t> values;
  for (std::size_t k = 0; k < 1000; ++k) {
    values.set(scan_of({1e-3 * static_cast<double>(k), 0.0, 0.0}), k);
  }
  std::size_t kept = 0;
  values.for_each([&](std::size_t& value) {
    ++kept;
    EXPECT_GE(value, 1000 - internal::kMaxLasers);
  });
  EXPECT_EQ(kept, internal::kMaxLasers);
}

TEST(PerLaser, all_are_changed_in_this_copy_alone) {
  internal::PerLaser<int> values;
  const LaserScan front = scan_of({0.2, 0.0, 0.0});
  const LaserScan rear = scan_of({-0.2, 0.0, -kPi});
  values.set(front, 1);
  values.set(rear, 2);
  const internal::PerLaser<int> before = values;
  values.for_each([](int& value) { value += 10; });
  EXPECT_EQ(*values.find(front), 11);
  EXPECT_EQ(*values.find(rear), 12);
  EXPECT_EQ(*before.find(rear), 2);
  values.clear();
  EXPECT_TRUE(values.empty());
}

}  // namespace
}  // namespace locfuse::test_per_laser
