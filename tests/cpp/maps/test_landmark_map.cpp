// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "locfuse/maps/landmark_map.hpp"
#include "support/expect.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(LandmarkMap, finds_any_ids) {
  const LandmarkMap counted({{1, {2.0, 0.0}}, {0, {1.0, 0.0}}, {2, {3.0, 0.0}, 0.5}});
  EXPECT_EQ(counted.find(1)->position.x(), 2.0);
  EXPECT_EQ(counted.find(2)->radius, 0.5);
  EXPECT_EQ(counted.find(3), nullptr);
  EXPECT_EQ(counted.find(-1), nullptr);
  const LandmarkMap named({{70, {1.0, 0.0}}, {-5, {2.0, 0.0}}});
  EXPECT_EQ(named.find(-5)->position.x(), 2.0);
  EXPECT_EQ(named.find(70)->position.x(), 1.0);
  EXPECT_EQ(named.find(0), nullptr);
  EXPECT_EQ(named.landmarks().front().id, -5);
}

TEST(LandmarkMap, rejects_invalid_maps) {
  expect_refused([] { LandmarkMap({{4, {0.0, 0.0}}, {4, {1.0, 0.0}}}); }, "landmark 4", "twice");
  expect_refused([] { LandmarkMap({{4, {kNan, 0.0}}}); }, "landmark 4", "finite");
  expect_refused([] { LandmarkMap({{4, {0.0, 0.0}, 0.0, kNan}}); }, "landmark 4", "finite");
  expect_refused([] { LandmarkMap({{4, {0.0, 0.0}, -0.1}}); }, "landmark 4", "radius -0.1");
  expect_refused([] { LandmarkMap({{4, {0.0, 0.0}, kNan}}); }, "radius nan");
}

}  // namespace
}  // namespace locfuse
