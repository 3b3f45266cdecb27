// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "locfuse/messages/message.hpp"

namespace locfuse::test_message {
namespace {

TEST(Message, an_increment_takes_effect_where_it_begins) {
  const Message increment = Increment{10, 30, {1.0, 0.0, 0.0}};
  EXPECT_EQ(effective_stamp(increment), 10);
  EXPECT_EQ(stamp_of(increment), 30);
}

TEST(Message, everything_else_takes_effect_at_its_stamp) {
  Velocity velocity;
  velocity.stamp = 7;
  Range range;
  range.stamp = 7;
  PositionFix fix;
  fix.stamp = 7;
  PoseObservation pose;
  pose.stamp = 7;
  RangeBearing sighting;
  sighting.stamp = 7;
  Altitude altitude;
  altitude.stamp = 7;
  for (const Message& message :
       std::vector<Message>{velocity, range, fix, pose, sighting, altitude}) {
    EXPECT_EQ(effective_stamp(message), 7);
    EXPECT_EQ(stamp_of(message), 7);
  }
}

TEST(Message, an_elevation_is_valid_in_space_only) {
  RangeBearing sighting{7, 0, 3.0, 0.1, {}};
  sighting.elevation = 0.2;
  EXPECT_NO_THROW(validate_in_space(Message(sighting)));
  EXPECT_THROW(validate(sighting), std::invalid_argument);
  sighting.elevation = 1.6;
  EXPECT_THROW(validate_in_space(Message(sighting)), std::invalid_argument);
  EXPECT_THROW(validate_in_space(Message(Range{7, 0, 0, -1.0, {}})), std::invalid_argument);
}

TEST(Message, one_order_whatever_that_of_arrival) {
  PositionFix fix{7, {1.0, 2.0}, Matrix<2, 2>::Identity()};
  PositionFix of_tag = fix;
  of_tag.tag = 0;
  const auto geometry = std::make_shared<const LaserGeometry>();
  const auto rear =
      std::make_shared<const LaserGeometry>(LaserGeometry{{-0.2, 0.0, -kPi}, 0.0, 0.1});
  const auto nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Message> ordered{Velocity{7, 0.5, 0.0},
                                     Increment{7, 8, {1.0, 0.0, 0.0}},
                                     Increment{7, 9, {0.0, 0.0, 0.0}},
                                     Range{7, 1, -2, 9.0, {}},
                                     Range{7, 0, 3, 5.0, {}},
                                     Range{7, 1, 3, 4.0, {}},
                                     Range{7, 1, 3, 4.5, {}},
                                     fix,
                                     of_tag,
                                     PoseObservation{7, {1.0, 0.0, 0.0}, {}},
                                     RangeBearing{7, {}, 2.0, 0.1, {}},
                                     RangeBearing{7, 4, 1.0, {}, {}},
                                     Altitude{7, 1.0, {}},
                                     LaserScan{7, rear, {1.0}},
                                     LaserScan{7, geometry, {1.0}},
                                     LaserScan{7, rear, {1.0, 2.0}},
                                     LaserScan{7, geometry, {1.0, 2.0}},
                                     LaserScan{7, geometry, {1.0, nan}},
                                     Velocity{8, 0.0, 0.0}};
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    for (std::size_t k = 0; k < ordered.size(); ++k) {
      EXPECT_EQ(precedes(ordered[i], ordered[k]), i < k) << i << " and " << k;
    }
  }
}

TEST(Message, motions_of_one_stamp_keep_the_order_in_which_they_arrive) {
  const Message go = Velocity{7, 0.5, 0.0};
  const Message stop = Velocity{7, 0.0, 0.0};
  const Message step = Increment{7, 7, {1.0, 0.0, 0.0}};
  const Message turn = Increment{7, 7, {0.0, 0.0, 1.0}};
  for (const Message& a : {go, stop, step, turn}) {
    for (const Message& b : {go, stop, step, turn}) {
      EXPECT_FALSE(precedes(a, b));
    }
  }
}

TEST(Message, every_kind_has_its_source) {
  EXPECT_EQ(source_of(Velocity{}), Source::kOdometry);
  EXPECT_EQ(source_of(RangeBearing{}), Source::kSightings);
  EXPECT_EQ(source_of(Altitude{}), Source::kAltitudes);
}

TEST(Increment, of_translation_and_rotation_drives_first_and_turns_then) {
  const Increment u = Increment::from_drive_then_turn(1, 2, 0.5, 0.1);
  EXPECT_EQ(u.begin, 1);
  EXPECT_EQ(u.stamp, 2);
  EXPECT_EQ(u.motion.x, 0.5);
  EXPECT_EQ(u.motion.y, 0.0);
  EXPECT_EQ(u.motion.heading, 0.1);
}

}  // namespace
}  // namespace locfuse::test_message
