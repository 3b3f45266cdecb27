// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/frontends/range_fit.hpp"
#include "support/expect.hpp"
#include "support/ranging.hpp"

namespace locfuse {
namespace {

using testing::Anchors;
using testing::expect_near;
using testing::Rng;
using testing::view;

const RangeLossKind kEveryLoss[] = {RangeLossKind::kNone, RangeLossKind::kHuber,
                                    RangeLossKind::kCauchy, RangeLossKind::kOneSided};

TEST(RangeLoss, equals_values_computed_by_hand) {
  const RangeLoss huber{RangeLossKind::kHuber, 2.0};
  EXPECT_DOUBLE_EQ(huber.cost(1.0), 1.0);
  EXPECT_DOUBLE_EQ(huber.cost(-3.0), 8.0);
  EXPECT_DOUBLE_EQ(huber.weight(4.0), 0.5);
  const RangeLoss cauchy{RangeLossKind::kCauchy, 2.0};
  EXPECT_DOUBLE_EQ(cauchy.cost(2.0), 4.0 * std::log(2.0));
  EXPECT_DOUBLE_EQ(cauchy.weight(-2.0), 0.5);
  const RangeLoss one_sided{RangeLossKind::kOneSided, 2.0};
  EXPECT_DOUBLE_EQ(one_sided.cost(2.0), 4.0 * std::log(2.0));
  EXPECT_DOUBLE_EQ(one_sided.cost(-2.0), 4.0);
  EXPECT_DOUBLE_EQ(one_sided.weight(-20.0), 1.0);
}

/// Ranges with one outlier from a random point of the room.
std::vector<double> noisy(Rng& rng, const Anchors& anchors) {
  std::vector<double> ranges = anchors.ranges_from(testing::random_point(rng, 2));
  testing::add_noise(rng, 0.1, ranges);
  ranges[1] += 0.8;
  return ranges;
}

TEST(RangeFit, both_solvers_reach_the_same_minimum_with_every_loss) {
  Rng rng(3);
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const RangeLayout<2> layout(anchors.table(), view(sigma));
  PositionPrior<2> prior;
  prior.mean << 0.5, -0.5;
  for (int trial = 0; trial < 100; ++trial) {
    const std::vector<double> ranges = noisy(rng, anchors);
    prior.information << (trial % 2 == 0 ? 0.0 : 1.0), 0.0;
    for (const RangeLossKind kind : kEveryLoss) {
      const RangeLoss loss{kind, 0.0};
      const auto ours = fit_ranges<2>(layout, view(ranges), Vector<2>::Zero(), loss, prior);
      std::string termination;
      const auto ceres =
          fit_ranges_ceres<2>(layout, view(ranges), ours.position, loss, prior, {}, &termination);
      ASSERT_TRUE(ours.converged);
      ASSERT_TRUE(ceres.converged) << termination;
      EXPECT_FALSE(termination.empty());
      expect_near(ceres.position, ours.position, 1e-5);
      EXPECT_NEAR(ceres.cost, ours.cost, 1e-6 * (1.0 + ours.cost));
      expect_near(ceres.information, ours.information, 0.05 * ours.information.norm());
    }
  }
}

TEST(RangeFit, is_a_minimum_of_the_stated_cost) {
  Rng rng(4);
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const RangeLayout<2> layout(anchors.table(), view(sigma));
  for (int trial = 0; trial < 50; ++trial) {
    const std::vector<double> ranges = noisy(rng, anchors);
    for (const RangeLossKind kind : kEveryLoss) {
      const RangeLoss loss{kind, 0.0};
      const auto cost = [&](const Vector<2>& x) {
        double sum = 0.0;
        for (int i = 0; i < layout.size; ++i) {
          const double h = std::sqrt(layout.squared_distance(x, i));
          sum += loss.cost((ranges[static_cast<std::size_t>(i)] - h) / 0.1);
        }
        return sum;
      };
      const auto fit = fit_ranges<2>(layout, view(ranges), Vector<2>::Zero(), loss);
      EXPECT_NEAR(fit.cost, cost(fit.position), 1e-7);
      for (int k = 0; k < 16; ++k) {
        const Vector<2> aside(1e-3 * std::cos(0.4 * k), 1e-3 * std::sin(0.4 * k));
        EXPECT_LT(fit.cost, cost(fit.position + aside));
      }
    }
  }
}

TEST(RangeFit, one_sided_loss_ignores_ranges_that_are_too_long_but_not_too_short) {
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const RangeLayout<2> layout(anchors.table(), view(sigma));
  const Eigen::Vector2d truth(3.0, 4.0);
  const auto error_with = [&](double bias, RangeLossKind kind) {
    std::vector<double> ranges = anchors.ranges_from(truth);
    ranges[2] += bias;
    const auto fit = fit_ranges<2>(layout, view(ranges), Vector<2>::Zero(), {kind, 0.0});
    return (layout.centre + fit.position - truth).norm();
  };
  EXPECT_LT(error_with(2.0, RangeLossKind::kOneSided), 0.03);
  EXPECT_GT(error_with(-2.0, RangeLossKind::kOneSided), 0.5);
  EXPECT_LT(error_with(-2.0, RangeLossKind::kCauchy), 0.03);
  EXPECT_GT(error_with(2.0, RangeLossKind::kNone), 0.5);
}

TEST(RangeFit, its_gain_is_the_derivative_of_the_position) {
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const RangeLayout<2> layout(anchors.table(), view(sigma));
  const std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  const auto fit = fit_ranges<2>(layout, view(ranges), Vector<2>::Zero());
  RangeGain<2> gain;
  ASSERT_TRUE(range_fit_gain<2>(layout, fit, gain));
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    std::vector<double> more = ranges;
    std::vector<double> less = ranges;
    more[i] += 1e-4;
    less[i] -= 1e-4;
    const Vector<2> slope = (fit_ranges<2>(layout, view(more), fit.position).position -
                             fit_ranges<2>(layout, view(less), fit.position).position) /
                            2e-4;
    expect_near(Vector<2>(gain.col(static_cast<Eigen::Index>(i))), slope, 1e-5);
  }
}

TEST(RangeFit, states_why_ceres_stopped) {
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const RangeLayout<2> layout(anchors.table(), view(sigma));
  const std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  CeresOptions hurried;
  hurried.max_iterations = 1;
  std::string termination;
  const auto fit =
      fit_ranges_ceres<2>(layout, view(ranges), {40.0, 30.0}, {}, {}, hurried, &termination);
  EXPECT_FALSE(fit.converged);
  EXPECT_NE(termination.find("Maximum number of iterations"), std::string::npos) << termination;
}

}  // namespace
}  // namespace locfuse
