// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/maps/anchor_map.hpp"
#include "support/expect.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;

/// Anchors whose x is their id, to check look-ups.
AnchorMap map_of(const std::vector<Id>& ids) {
  std::vector<Anchor> anchors;
  for (const Id id : ids) {
    anchors.push_back({id, {static_cast<double>(id), 0.0, 0.0}});
  }
  return AnchorMap(anchors);
}

void expect_finds(const AnchorMap& map, const std::vector<Id>& known,
                  const std::vector<Id>& unknown) {
  for (const Id id : known) {
    const Anchor* anchor = map.find(id);
    ASSERT_NE(anchor, nullptr) << id;
    EXPECT_EQ(anchor->id, id);
    EXPECT_EQ(anchor->position.x(), static_cast<double>(id));
  }
  for (const Id id : unknown) {
    EXPECT_EQ(map.find(id), nullptr) << id;
  }
}

constexpr Id kLowest = std::numeric_limits<Id>::min();
constexpr Id kHighest = std::numeric_limits<Id>::max();

TEST(AnchorMap, finds_dense_ids_given_in_any_order) {
  expect_finds(map_of({2, 0, 3, 1}), {0, 1, 2, 3}, {-1, 4, kLowest, kHighest});
}

TEST(AnchorMap, finds_sparse_ids) {
  expect_finds(map_of({0x1A2B, 7, 0, 100}), {0, 7, 100, 0x1A2B}, {1, 2, 3, 8, 99, kHighest});
}

TEST(AnchorMap, finds_dense_ids_that_start_at_one) {
  expect_finds(map_of({1, 2, 3}), {1, 2, 3}, {0, 4});
}

TEST(AnchorMap, finds_negative_ids_and_the_ends_of_the_range) {
  expect_finds(map_of({-5, kLowest, kHighest, 3, -1}), {kLowest, -5, -1, 3, kHighest},
               {-2, 0, 1, 2, 4});
}

TEST(AnchorMap, finds_nothing_when_empty) { expect_finds(AnchorMap(), {}, {0, 1, -1}); }

TEST(AnchorMap, lists_its_anchors_by_id) {
  const AnchorMap map = map_of({9, -3, 4});
  ASSERT_EQ(map.anchors().size(), 3U);
  EXPECT_EQ(map.anchors()[0].id, -3);
  EXPECT_EQ(map.anchors()[1].id, 4);
  EXPECT_EQ(map.anchors()[2].id, 9);
}

TEST(AnchorMap, rejects_an_id_given_twice) {
  expect_refused([] { (void)map_of({4, 17, 5, 17}); }, "anchor 17", "twice");
}

TEST(AnchorMap, rejects_invalid_anchors) {
  const double nan = std::nan("");
  const auto with = [](const Vector<3>& position, double offset, double scale) {
    (void)AnchorMap(std::vector<Anchor>{{6, position, offset, scale}});
  };
  const Vector<3> zero = Vector<3>::Zero();
  expect_refused([&] { with({0.0, nan, 0.0}, 0.0, 1.0); }, "anchor 6");
  expect_refused([&] { with(zero, nan, 1.0); }, "anchor 6");
  expect_refused([&] { with(zero, 0.0, 0.0); }, "anchor 6", "scale 0");
  expect_refused([&] { with(zero, 0.0, -1.5); }, "anchor 6", "-1.5");
  expect_refused([&] { with(zero, 0.0, nan); }, "anchor 6", "nan");
}

TEST(AnchorMap, rejects_lengths_and_scales_whose_squares_overflow) {
  expect_refused([] { AnchorMap({{6, {1e200, 0.0, 0.0}}}); }, "anchor 6", "1e12");
  expect_refused([] { AnchorMap({{6, {0.0, 0.0, 0.0}, 1e160}}); }, "anchor 6", "1e12");
  expect_refused([] { AnchorMap({{6, {0.0, 0.0, 0.0}, 0.0, 1e160}}); }, "anchor 6", "scale");
}

}  // namespace
}  // namespace locfuse
