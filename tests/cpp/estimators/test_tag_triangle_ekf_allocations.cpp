// SPDX-License-Identifier: Apache-2.0
#include "support/allocation_counter.hpp"
#include "support/expect.hpp"
#include "support/scrubber.hpp"

namespace locfuse {
namespace {

using testing::allocations;

TEST(TagTriangleEkf, allocates_nothing_per_message) {
  testing::Scrubber run;
  testing::drive(run, 1, 60.0);
  TagTriangleEkf ekf({}, {testing::hall(), testing::triangle()}, run.start);
  int fused = 0;
  const auto take = [&](const Message& message) {
    fused += ekf.on(message).verdict == Verdict::kFused ? 1 : 0;
    const Stamp now = ekf.belief().stamp;
    fused += ekf.on(Range{now, 10, 0, 13.0, 20.0}).verdict == Verdict::kFused ? 1 : 0;
    fused += ekf.on(PositionFix{now, {900.0, 0.0}, Matrix<2, 2>::Identity(), 11}).verdict ==
                     Verdict::kGated
                 ? 1
                 : 0;
    (void)ekf.pose();
  };
  const std::size_t first = run.messages.size() / 10;  // each source by then
  for (std::size_t i = 0; i < first; ++i) {
    take(run.messages[i]);
  }
  const TagTriangleEkf snapshot = ekf;
  const std::size_t before = allocations();
  for (std::size_t i = first; i < run.messages.size(); ++i) {
    take(run.messages[i]);
  }
  ekf = snapshot;
  EXPECT_EQ(allocations(), before);
  EXPECT_GT(fused, static_cast<int>(2.9 * static_cast<double>(run.messages.size())));
}

}  // namespace
}  // namespace locfuse
