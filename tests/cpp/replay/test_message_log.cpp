// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/message_log.hpp"
#include "support/expect.hpp"

namespace locfuse::test_message_log {
namespace {

Velocity velocity(Stamp stamp, double forward) { return {stamp, forward, 0.0}; }

TEST(MessageLog, a_message_arrives_when_it_takes_effect_by_default) {
  MessageLog log;
  log.add(velocity(5, 1.0));
  log.add(Increment{6, 9, {}});
  log.add(velocity(7, 1.0), 20);
  ASSERT_EQ(log.arrivals().size(), 3U);
  EXPECT_EQ(log.arrivals()[0].arrival, 5);
  EXPECT_EQ(log.arrivals()[1].arrival, 6);
  EXPECT_EQ(log.arrivals()[2].arrival, 20);
}

TEST(MessageLog, sorts_by_arrival_and_keeps_the_order_within_an_instant) {
  MessageLog log;
  log.add(velocity(1, 0.0), 30);
  for (int i = 1; i <= 50; ++i) {
    log.add(velocity(100 - i, i), 20);
  }
  log.add(velocity(3, 51.0), 10);
  log.sort();
  ASSERT_EQ(log.arrivals().size(), 52U);
  EXPECT_EQ(log.arrivals().front().arrival, 10);
  EXPECT_EQ(log.arrivals().back().arrival, 30);
  for (int i = 1; i <= 50; ++i) {
    const auto& message = log.arrivals()[static_cast<std::size_t>(i)].message;
    EXPECT_EQ(std::get<Velocity>(message).forward, i);
  }
}

TEST(MessageLog, sorts_any_number_of_columns_that_are_sorted_each) {
  for (int columns = 0; columns <= 9; ++columns) {
    MessageLog log;
    for (int column = 0; column < columns; ++column) {
      for (int row = 0; row < 20; ++row) {  // all start at 0, at different rates
        log.add(velocity(0, column), row * (column % 4 + 1));
      }
    }
    log.sort();
    ASSERT_EQ(log.arrivals().size(), static_cast<std::size_t>(20 * columns));
    for (std::size_t i = 1; i < log.arrivals().size(); ++i) {
      const MessageLog::Arrival& before = log.arrivals()[i - 1];
      const MessageLog::Arrival& after = log.arrivals()[i];
      ASSERT_LE(before.arrival, after.arrival) << columns << " columns, row " << i;
      if (before.arrival == after.arrival) {
        ASSERT_LT(std::get<Velocity>(before.message).forward,
                  std::get<Velocity>(after.message).forward);
      }
    }
  }
}

TEST(MessageLog, adds_all_rows_or_none_and_names_the_wrong_one) {
  MessageLog log;
  log.add(velocity(1, 1.0));
  const auto row = [](std::size_t i) {
    return MessageLog::Arrival{static_cast<Stamp>(10 + i), Range{5, 0, 0, 2.0 - double(i), {}}};
  };
  testing::expect_refused([&] { log.add_rows(4, row); }, "row 3", "Range.range", "-1");
  EXPECT_EQ(log.arrivals().size(), 1U);
  log.add_rows(3, row);
  ASSERT_EQ(log.arrivals().size(), 4U);
  EXPECT_EQ(log.arrivals()[3].arrival, 12);
  EXPECT_EQ(std::get<Range>(log.arrivals()[3].message).range, 0.0);
}

TEST(MessageLog, refuses_messages_that_are_not_valid) {
  MessageLog log;
  testing::expect_refused([&] { log.add(Range{0, 0, 0, -2.5, {}}); }, "-2.5");
  testing::expect_refused([&] { log.add(Increment{9, 4, {}}, 10); }, "9", "4");
  EXPECT_TRUE(log.arrivals().empty());
}

}  // namespace
}  // namespace locfuse::test_message_log
