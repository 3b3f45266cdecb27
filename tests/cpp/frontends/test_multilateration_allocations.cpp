// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/multilateration.hpp"
#include "support/allocation_counter.hpp"
#include "support/expect.hpp"
#include "support/ranging.hpp"

namespace locfuse {
namespace {

TEST(Multilateration, allocates_nothing_for_sixteen_anchors) {
  testing::Rng rng(9);
  const testing::Anchors anchors = testing::random_anchors(rng, 16, 3);
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const Multilateration<3> solver(anchors.table(), testing::view(sigma), {});
  std::vector<double> ranges = anchors.ranges_from(testing::random_point(rng, 3));
  std::vector<double> few = ranges;
  few[3] = few[7] = std::nan("");
  const std::size_t before = testing::allocations();
  int unique = 0;
  for (int i = 0; i < 10; ++i) {
    unique += solver.solve(testing::view(ranges)).status == PositionStatus::kUnique ? 1 : 0;
    unique += solver.solve(testing::view(few)).status == PositionStatus::kUnique ? 1 : 0;
  }
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_EQ(unique, 20);
}

}  // namespace
}  // namespace locfuse
