// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "locfuse/filters/belief.hpp"
#include "support/allocation_counter.hpp"

namespace locfuse {
namespace {

/// How often it allocates to add a point to a copy after `guests` came and went.
std::size_t allocations_after(int guests) {
  const Matrix<2, 2> covariance = Matrix<2, 2>::Identity();
  GaussianBelief belief = GaussianBelief::of_pose(0, {}, Matrix<3, 3>::Identity());
  for (int i = 0; i < guests; ++i) {
    belief.remove(belief.add("a name too long for a string to hold by itself", SlotKind::kPoint2,
                             Vector<2>(8.0, 9.0), covariance));
  }
  const GaussianBelief copy = belief;
  const std::size_t before = testing::allocations();
  belief.add("point", SlotKind::kPoint2, Vector<2>(8.0, 9.0), covariance);
  return testing::allocations() - before;
}

// Each left its name for good, which every copy of the layout took along.
TEST(GaussianBelief, what_comes_and_goes_leaves_nothing_behind) {
  EXPECT_EQ(allocations_after(1'000), allocations_after(1));
}

}  // namespace
}  // namespace locfuse
