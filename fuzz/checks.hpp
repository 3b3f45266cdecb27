// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iomanip>
#include <iostream>
#include <stdexcept>
#include <vector>

#include "codec.hpp"
#include "locfuse/error.hpp"
#include "locfuse/filters/outcome.hpp"
#include "support/bits.hpp"

/// What holds after every call, whatever it was told.
namespace locfuse::fuzz {

inline void require(bool holds, const char* claim) {
  if (!holds) {
    std::fprintf(stderr, "broken: %s\n", claim);
    std::abort();
  }
}

/// Whether the call returned; the errors that are documented are the only ones there are.
template <class Call>
bool returns(const Call& call) {
  try {
    call();
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  } catch (const NumericalError&) {
    return false;
  }
}

/// Positive definite, of a filter whatever it was told. Of a front end as long as every number was
/// plausible: beyond, where variances lie further apart than a double has digits, each is positive.
template <class Derived>
void require_covariance(bool plausible, const Eigen::MatrixBase<Derived>& P) {
  const Eigen::MatrixXd dense = P;
  const auto require_of_it = [&](bool holds, const char* claim) {
    if (!holds) {
      std::cerr << std::setprecision(17) << dense << '\n';
      require(false, claim);
    }
  };
  require_of_it(dense.allFinite(), "the covariance is finite");
  require_of_it(testing::same_bits(dense, dense.transpose()), "the covariance is symmetric");
  require_of_it(dense.diagonal().minCoeff() > 0.0, "variances are positive");
  require_of_it(!plausible || dense.llt().info() == Eigen::Success,
                "the covariance is positive definite");
}

template <class Derived>
void require_covariance(const Reader& io, const Eigen::MatrixBase<Derived>& P) {
  require_covariance(io.plausible(), P);
}

inline void require_sound(const GaussianBelief& belief) {
  require(belief.stamp > -kStampLimit && belief.stamp < kStampLimit, "the stamp is in its limit");
  require(belief.x.allFinite(), "the state is finite");
  for (const int row : belief.angle_rows()) {
    require(belief.x(row) >= -kPi && belief.x(row) < kPi, "angles are wrapped");
  }
  require_covariance(true, belief.P);
}

inline bool is_fused(const Outcome& outcome) { return outcome.verdict == Verdict::kFused; }
inline bool is_fused(const std::vector<Outcome>& outcomes) {
  return std::any_of(outcomes.begin(), outcomes.end(),
                     [](const Outcome& outcome) { return is_fused(outcome); });
}

/// Tells an estimator something: what is not fused, or refused, changes no bit of the belief and of
/// where odometry carries it; and the belief stays sound.
template <class Estimator, class Call>
void tell(Estimator& estimator, const Call& call) {
  const Estimator before = estimator;
  bool fused = false;
  returns([&] { fused = is_fused(call(estimator)); });
  require_sound(estimator.belief());
  if (fused) {
    return;
  }
  require(testing::same_bits(before.belief(), estimator.belief()),
          "a message that is not fused changes no bit");
  returns([&] {
    const auto a = before.estimate();
    const auto b = estimator.estimate();
    require(a.stamp == b.stamp && testing::same_bits(a.covariance, b.covariance),
            "a message that is not fused changes no bit of what odometry told");
  });
}

}  // namespace locfuse::fuzz
