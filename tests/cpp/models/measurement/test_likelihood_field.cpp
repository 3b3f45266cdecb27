// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/models/measurement/likelihood_field.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_likelihood_field {
namespace {

using testing::Rng;
using testing::uniform;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// 60 x 40 cells of 10 cm: a wall at column 10, right of column 49 is unknown.
std::shared_ptr<const OccupancyGrid> wall() {
  std::vector<Cell> cells(60 * 40, Cell::kFree);
  for (std::size_t row = 0; row < 40; ++row) {
    cells[row * 60 + 10] = Cell::kOccupied;
    for (std::size_t column = 50; column < 60; ++column) {
      cells[row * 60 + column] = Cell::kUnknown;
    }
  }
  return std::make_shared<const OccupancyGrid>(60, 40, 0.1, Pose2{1.0, 2.0, 0.3}, cells);
}

TEST(LikelihoodField, is_a_mixture_of_walls_clutter_and_uniform) {
  const LikelihoodField field({0.15, 0.1, 20.0, 0.04, 0.01}, wall());
  const auto density = [](double distance) {
    return 0.9 / (0.15 * std::sqrt(2.0 * kPi)) *
               std::exp(-0.5 * distance * distance / (0.15 * 0.15)) +
           0.1 / 20.0;
  };
  EXPECT_NEAR(field.log_density(10.4, 17.9), std::log(density(0.0)), 0.51 * field.unit());
  for (const int off : {1, 2, 3, 20}) {  // cells beside the wall
    EXPECT_NEAR(field.log_density(10.4 + off, 17.9), std::log(density(0.1 * off) + 0.04),
                0.51 * field.unit());
  }
  EXPECT_NEAR(field.log_density(55.0, 20.0), std::log(0.01), 0.51 * field.unit());
  EXPECT_NEAR(field.log_density(-30.0, 20.0), std::log(0.01), 0.51 * field.unit());
  EXPECT_LT(255.0 * field.unit(), 10.0);
}

TEST(LikelihoodField, an_end_in_front_of_a_wall_is_likelier_than_one_behind_it) {
  const LikelihoodField field({}, wall());
  EXPECT_GT(field.log_density(35.0, 20.0), field.log_density(55.0, 20.0) + 2.0);
}

TEST(LikelihoodField, sums_the_costs_of_single_end_points) {
  const LikelihoodField field({0.15, 0.1, 3.0}, wall());
  Rng rng(2);
  EndPoints points;
  for (int i = 0; i < 61; ++i) {
    points.x.push_back(static_cast<float>(uniform(rng, -20.0, 20.0)));
    points.y.push_back(static_cast<float>(uniform(rng, -20.0, 20.0)));
  }
  constexpr int kPoses = 800;
  std::vector<float> x, y, c, s;
  std::vector<double> heading;
  for (int i = 0; i < kPoses; ++i) {
    x.push_back(static_cast<float>(uniform(rng, 0.0, 59.99)));
    y.push_back(static_cast<float>(uniform(rng, 0.0, 39.99)));
    heading.push_back(uniform(rng, -kPi, kPi));
    c.push_back(static_cast<float>(std::cos(heading.back())));
    s.push_back(static_cast<float>(std::sin(heading.back())));
  }
  std::vector<std::int32_t> sums(kPoses);
  field.costs(points, x.data(), y.data(), c.data(), s.data(), 0, kPoses, sums.data());
  int equal = 0;
  for (std::size_t i = 0; i < kPoses; ++i) {
    double expected = 0.0;
    for (std::size_t k = 0; k < points.x.size(); ++k) {
      const Vector<2> p =
          Pose2{static_cast<double>(x[i]), static_cast<double>(y[i]), heading[i]}.act(
              Vector<2>(points.x[k], points.y[k]));
      expected += (field.best() - field.log_density(p.x(), p.y())) / field.unit();
    }
    equal += static_cast<int>(std::abs(sums[i] - expected) < 0.5);
  }
  EXPECT_GE(equal, kPoses - 8);  // the others end within rounding of a cell's edge
}

TEST(LikelihoodField, poses_off_the_map_cost_more_than_any_on_it) {
  const LikelihoodField field({0.15, 0.1, 3.0}, wall());
  const EndPoints points{{10.0F, 5.0F}, {0.0F, 1.0F}};
  const std::vector<float> x{-0.1F, 60.1F, 30.0F, 30.0F, 1e9F, 30.0F, std::nanf(""), 30.0F};
  const std::vector<float> y{20.0F, 20.0F, -5.0F, 40.1F, 20.0F, 20.0F, 20.0F, 20.0F};
  const std::vector<float> c(8, 1.0F);
  const std::vector<float> s(8, 0.0F);
  std::vector<std::int32_t> sums(8);
  field.costs(points, x.data(), y.data(), c.data(), s.data(), 0, 8, sums.data());
  for (const std::size_t off : {0U, 1U, 2U, 3U, 4U, 6U}) {
    EXPECT_EQ(sums[off], 512) << off;
  }
  EXPECT_LE(sums[5], 510);
}

TEST(LikelihoodField, selects_returns_evenly) {
  const LikelihoodField field({0.15, 0.1, 5.0}, wall());
  const auto laser = std::make_shared<const LaserGeometry>(
      LaserGeometry{{0.5, 0.1, kPi / 2.0}, 0.0, -kPi / 8.0, 0.2, 30.0});
  const LaserScan scan{0, laser, {1.0, kNan, 0.1, 2.0, 6.0, 31.0, 3.0}};
  const EndPoints all = field.end_points(scan, 100);
  ASSERT_EQ(all.x.size(), 3U);  // without those of 6 m and 31 m and below range_min
  // Beam 0 leaves along the body's y axis; the laser turns clockwise.
  EXPECT_NEAR(static_cast<double>(all.x[0]), 5.0, 1e-5);
  EXPECT_NEAR(static_cast<double>(all.y[0]), 11.0, 1e-5);
  const double angle = kPi / 2.0 - 3.0 * kPi / 8.0;
  EXPECT_NEAR(static_cast<double>(all.x[1]), 5.0 + 20.0 * std::cos(angle), 1e-5);
  EXPECT_NEAR(static_cast<double>(all.y[1]), 1.0 + 20.0 * std::sin(angle), 1e-5);
  const EndPoints one = field.end_points(scan, 1);
  ASSERT_EQ(one.x.size(), 1U);
  EXPECT_EQ(one.x[0], all.x[1]);  // the middle one
  EXPECT_TRUE(field.end_points({0, laser, {kNan, 99.0}}, 10).x.empty());
}

TEST(LikelihoodField, counts_end_points_at_walls) {
  const LikelihoodField field({0.1, 0.1, 5.0}, wall());
  const EndPoints points{{-10.0F, -9.0F, 5.0F, -2.0F}, {0.0F, 3.0F, 0.0F, 1.0F}};
  EXPECT_EQ(field.explained(points.seen_from({20.5, 20.5, 0.0})), 0.5);
  EXPECT_EQ(field.explained({}), 0.0);
}

TEST(LikelihoodField, end_points_turn_and_move_with_the_body) {
  Rng rng(3);
  for (int i = 0; i < 20; ++i) {
    const Pose2 pose{uniform(rng, -5.0, 5.0), uniform(rng, -5.0, 5.0), uniform(rng, -3.0, 3.0)};
    const Vector<2> at(uniform(rng, -9.0, 9.0), uniform(rng, -9.0, 9.0));
    const EndPoints points{{static_cast<float>(at.x())}, {static_cast<float>(at.y())}};
    const EndPoints seen = points.seen_from(pose);
    EXPECT_NEAR(seen.x[0], pose.act(at).x(), 1e-5);
    EXPECT_NEAR(seen.y[0], pose.act(at).y(), 1e-5);
  }
}

TEST(LikelihoodField, fields_double_in_width_up_to_the_widest) {
  const std::vector<LikelihoodField> fields =
      LikelihoodField::doubling({0.05, 0.1, 5.0}, wall(), 0.4);
  ASSERT_EQ(fields.size(), 4U);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const LikelihoodField own({0.05 * std::pow(2.0, static_cast<double>(i)), 0.1, 5.0}, wall());
    EXPECT_EQ(fields[i].config().sigma_hit_m, own.config().sigma_hit_m) << i;
    EXPECT_EQ(fields[i].log_density(12.5, 17.5), own.log_density(12.5, 17.5)) << i;
  }
}

TEST(LikelihoodField, rejects_invalid_maps_and_settings) {
  const auto full = std::make_shared<const OccupancyGrid>(2, 2, 0.1, Pose2{},
                                                          std::vector<Cell>(4, Cell::kOccupied));
  testing::expect_refused([&] { LikelihoodField({}, full); }, "0 free cells");
  const auto empty =
      std::make_shared<const OccupancyGrid>(2, 2, 0.1, Pose2{}, std::vector<Cell>(4, Cell::kFree));
  testing::expect_refused([&] { LikelihoodField({}, empty); }, "0 occupied cells");
  testing::expect_refused([] { LikelihoodField({}, nullptr); }, "no map");
  testing::expect_refused([] { LikelihoodField({0.0, 0.1, 5.0}, wall()); }, "sigma_hit_m is 0");
  testing::expect_refused([] { LikelihoodField({0.1, 1.0, 5.0}, wall()); }, "random_share is 1");
  testing::expect_refused([] { LikelihoodField({0.1, 0.1, kNan}, wall()); }, "max_range_m is nan");
  testing::expect_refused(
      [] {
        LikelihoodField({0.1, 0.1, 5.0, -1.0}, wall());
      },
      "clutter_per_m is -1");
  testing::expect_refused(
      [] {
        LikelihoodField({0.1, 0.1, 5.0, 0.1, kNan}, wall());
      },
      "unknown_per_m is nan");
}

TEST(LikelihoodField, rejects_settings_without_density_or_beyond_memory) {
  for (const double sigma : {1e-200, 1e-310}) {
    testing::expect_refused([&] { LikelihoodField({sigma}, wall()); }, "sigma_hit_m");
  }
  testing::expect_refused([&] { LikelihoodField({0.1, 5e-324}, wall()); }, "random_share");
  for (const double reach : {1e-310, 1e-100, 9999.0}) {
    testing::expect_refused([&] { LikelihoodField({0.1, 0.05, reach}, wall()); }, "max_range_m");
  }
}

TEST(LikelihoodField, points_beyond_integers_are_unknown) {
  const LikelihoodField field({0.1, 0.05, 2.0}, wall());
  for (const double far : {kNan, 1e10, -1e300, 2147483646.0}) {
    EXPECT_EQ(field.log_density(far, 0.0), field.log_density(-1e3, 0.0)) << far;
    EXPECT_FALSE(field.explains(0.0, far)) << far;
  }
}

}  // namespace
}  // namespace locfuse::test_likelihood_field
