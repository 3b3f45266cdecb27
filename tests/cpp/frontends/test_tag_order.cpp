// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/frontends/tag_order.hpp"
#include "locfuse/geometry/pose2.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;
using testing::Rng;

const std::vector<Tag> kTagsInOrder = {
    {1, {0.6, 0.0, 1.0}}, {2, {-0.3, 0.4, 1.0}}, {3, {-0.3, -0.2, 1.0}}};

std::vector<PositionFix> epoch(Rng& rng, double sigma,
                               const std::vector<Tag>& tags = kTagsInOrder) {
  const Pose2 pose = testing::random_pose(rng);
  std::vector<PositionFix> fixes;
  for (const Tag& tag : tags) {
    const Vector<2> noise{testing::normal(rng, sigma), testing::normal(rng, sigma)};
    fixes.push_back({0, pose.act(tag.position.head<2>()) + noise,
                     sigma * sigma * Matrix<2, 2>::Identity(), tag.id});
  }
  return fixes;
}

TEST(TagOrder, passes_the_right_order_with_the_given_probability) {
  constexpr int kRuns = 4000;
  int fits = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    Rng rng(seed);
    fits +=
        tag_order(kTagsInOrder, epoch(rng, 0.03), 0.95).verdict == TagOrderVerdict::kFits ? 1 : 0;
  }
  EXPECT_NEAR(fits, 0.95 * kRuns, 3.0 * std::sqrt(0.95 * 0.05 * kRuns) + 0.005 * kRuns);
}

TEST(TagOrder, finds_every_swap_and_the_ids_that_fit) {
  Rng rng(7);
  for (int run = 0; run < 200; ++run) {
    std::vector<PositionFix> fixes = epoch(rng, 0.01);
    const auto i = static_cast<std::size_t>(run % 3);
    std::swap(fixes[i].tag, fixes[(i + 1) % 3].tag);
    const TagOrder order = tag_order(kTagsInOrder, fixes, 0.9999);
    ASSERT_EQ(order.verdict, TagOrderVerdict::kSwapped) << to_string(order);
    EXPECT_EQ(order.ids, (std::array<Id, 3>{1, 2, 3}));
    EXPECT_NE(to_string(order).find("as tags 1, 2, 3"), std::string::npos);
    EXPECT_GT(order.nis, order.limit);
    EXPECT_LE(order.best, order.limit);
  }
}

TEST(TagOrder, rotations_of_an_equilateral_triangle_are_ambiguous) {
  const double h = std::sqrt(0.75);
  const std::vector<Tag> even = {{1, {0.0, 0.0, 0.0}}, {2, {1.0, 0.0, 0.0}}, {3, {0.5, h, 0.0}}};
  Rng rng(3);
  std::vector<PositionFix> fixes = epoch(rng, 0.001, even);
  fixes[0].tag = 2;
  fixes[1].tag = 3;
  fixes[2].tag = 1;
  EXPECT_EQ(tag_order(even, fixes).verdict, TagOrderVerdict::kFits);
  std::swap(fixes[0].tag, fixes[1].tag);  // mirrored: all three rotations fit
  EXPECT_EQ(tag_order(even, fixes).verdict, TagOrderVerdict::kAmbiguous);
}

TEST(TagOrder, a_wrong_fix_fits_in_no_order) {
  Rng rng(5);
  std::vector<PositionFix> fixes = epoch(rng, 0.01);
  fixes[1].position.x() += 3.0;
  const TagOrder order = tag_order(kTagsInOrder, fixes);
  EXPECT_EQ(order.verdict, TagOrderVerdict::kNoFit);
  EXPECT_NE(to_string(order).find("nor in any other order"), std::string::npos);
}

TEST(TagOrder, is_ambiguous_where_noise_is_as_large_as_the_triangle) {
  Rng rng(6);
  std::vector<PositionFix> fixes = epoch(rng, 0.5);
  std::swap(fixes[0].tag, fixes[1].tag);
  EXPECT_EQ(tag_order(kTagsInOrder, fixes).verdict, TagOrderVerdict::kFits);
}

TEST(TagOrder, rejects_epochs_that_are_not_of_three_tags) {
  Rng rng(1);
  const std::vector<PositionFix> good = epoch(rng, 0.01);
  expect_refused(
      [&] {
        (void)tag_order({kTagsInOrder[0], kTagsInOrder[1]}, good);
      },
      "2 tags and 3 fixes");
  expect_refused([&] { (void)tag_order(kTagsInOrder, {good[0]}); }, "3 tags and 1 fixes");
  std::vector<PositionFix> bad = good;
  bad[1].tag = 1;
  expect_refused([&] { (void)tag_order(kTagsInOrder, bad); }, "two fixes of tag 1");
  bad[1].tag = 8;
  expect_refused([&] { (void)tag_order(kTagsInOrder, bad); }, "tag 8", "1, 2, 3");
  bad = good;
  bad[2].stamp = 1;
  expect_refused([&] { (void)tag_order(kTagsInOrder, bad); }, "one stamp");
}

}  // namespace
}  // namespace locfuse
