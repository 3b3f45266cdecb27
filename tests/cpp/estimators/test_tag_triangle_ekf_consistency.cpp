// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>

#include "locfuse/frontends/tag_conditioner.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/scrubber.hpp"

namespace locfuse::test_tag_triangle_ekf_consistency {
namespace {

using testing::in_band;

constexpr int kRuns = 120;

struct Consistency {
  double nees = 0.0;  ///< mean over the runs, of (x, y, heading) at the end
  double nis = 0.0;   ///< mean over the fixes from 20 s on, when the heading was found
  int fixes = 0;
};

/// `change` may spoil the filter's config; a conditioner may stand before it, and its covariances
/// be those of the messages.
template <class Change>
Consistency measure(const Change& change, const TagConditioner::Config* conditioning = nullptr,
                    bool knows_lag = true) {
  Consistency result;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    testing::Scrubber run;
    testing::drive(run, seed, 60.0);
    TagTriangleEkf::Config config;
    // What a tag's velocity does on an eight is not a random walk. With this one the mean NEES of
    // 4,000 other runs is 2.9; with 0.1 it is 2.7, with 0.05 it is 3.4.
    config.motion.sigma_velocity_per_sqrt_s = 0.07;
    config.position.gate = 1.0;
    config.velocity.gate = 1.0;
    change(config);
    TagTriangleEkf ekf(config, {{}, testing::triangle()}, run.start);
    std::optional<TagConditioner> conditioner;
    if (conditioning != nullptr) {
      conditioner.emplace(*conditioning, testing::triangle());
    }
    for (Message message : run.messages) {
      if (PositionFix* z = std::get_if<PositionFix>(&message)) {
        if (conditioner) {
          const ConditionedFix out = conditioner->on(*z);
          if (!out.fix) {
            continue;
          }
          const Matrix<2, 2> R = z->covariance;
          *z = *out.fix;
          z->covariance = knows_lag ? z->covariance : R;
        }
        const Outcome outcome = ekf.on(*z);
        if (z->stamp > 20 * testing::kSecond) {
          result.nis += outcome.nis;
          ++result.fixes;
        }
      } else {
        ekf.on(message);
      }
    }
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local({run.x, run.y, wrap_angle(run.heading)}, end.pose);
    result.nees += error.dot(end.covariance.llt().solve(error)) / kRuns;
  }
  result.nis /= result.fixes;
  return result;
}

TEST(TagTriangleEkf, is_as_sure_as_it_should_be_with_the_jacobian_of_the_heading) {
  const Consistency honest = measure([](TagTriangleEkf::Config&) {});
  EXPECT_TRUE(in_band(honest.nees, 3, kRuns)) << honest.nees;
  EXPECT_TRUE(in_band(honest.nis, 2, honest.fixes)) << honest.nis;
}

TEST(TagTriangleEkf, is_too_sure_by_far_where_the_heading_is_taken_as_known) {
  const Consistency known =
      measure([](TagTriangleEkf::Config& config) { config.heading_is_known = true; });
  EXPECT_GT(known.nees, 30.0);
}

TEST(TagTriangleEkf, is_too_sure_behind_a_low_pass_whose_lag_it_does_not_know) {
  TagConditioner::Config conditioning;
  conditioning.cutoff_hz = 0.2;
  const auto nothing = [](TagTriangleEkf::Config&) {};
  const Consistency smoothed = measure(nothing, &conditioning);
  EXPECT_LT(smoothed.nees, 3.5);
  EXPECT_GT(smoothed.nees, 1.5);
  const Consistency unaware = measure(nothing, &conditioning, false);
  EXPECT_FALSE(in_band(unaware.nees, 3, kRuns)) << unaware.nees;
  EXPECT_GT(unaware.nees, 4.0);
  conditioning.cutoff_hz = 0.0;
  const Consistency raw = measure([](TagTriangleEkf::Config&) {}, &conditioning);
  EXPECT_TRUE(in_band(raw.nees, 3, kRuns)) << raw.nees;
}

}  // namespace
}  // namespace locfuse::test_tag_triangle_ekf_consistency
