// SPDX-License-Identifier: Apache-2.0
#include "support/allocation_counter.hpp"
#include "support/expect.hpp"
#include "support/inertial_flight.hpp"

namespace locfuse {
namespace {

using testing::allocations;

TEST(InertialAirEkf, allocates_nothing_per_message) {
  AirEkf::Config config = testing::inertial_config();
  config.correlation_s = 10.0;
  config.range.gate = 0.999;
  const testing::InertialFlight flight = testing::swing_about(5, 6.0, {}, false);
  AirEkf ekf = testing::air_ekf(config, flight.start);
  std::size_t before = 0;
  int gated = 0;
  for (const Message& message : flight.messages) {
    if (before == 0 && stamp_of(message) > 3 * testing::kSecond) {
      before = allocations();
    }
    (void)ekf.on(message);
    gated += ekf.on(Range{stamp_of(message), 0, 1, 300.0, {}}).verdict == Verdict::kGated;
  }
  EXPECT_EQ(allocations(), before);
  EXPECT_GT(before, 0U);
  EXPECT_GT(gated, 600);
}

}  // namespace
}  // namespace locfuse
