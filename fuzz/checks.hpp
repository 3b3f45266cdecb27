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

/// Invariants that hold after every call, whatever the input.
namespace locfuse::fuzz {

inline void require(bool holds, const char* claim) {
  if (!holds) {
    std::fprintf(stderr, "broken: %s\n", claim);
    std::abort();
  }
}

/// Whether the call returned; any exception other than the documented ones escapes and is a
/// finding.
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

/// Aborts unless a covariance is sound: positive definite if `plausible`, as for every filter. For
/// the implausible numbers of a front end, whose variances can differ by more than the precision of
/// a double, only the variances must be positive.
template <class Derived>
void require_covariance(bool plausible, const Eigen::MatrixBase<Derived>& P) {
  const Eigen::MatrixXd dense = P;
  const auto require_or_print = [&](bool holds, const char* claim) {
    if (!holds) {
      std::cerr << std::setprecision(17) << dense << '\n';
      require(false, claim);
    }
  };
  require_or_print(dense.allFinite(), "the covariance is finite");
  require_or_print(testing::same_bits(dense, dense.transpose()), "the covariance is symmetric");
  require_or_print(dense.diagonal().minCoeff() > 0.0, "variances are positive");
  require_or_print(!plausible || dense.llt().info() == Eigen::Success,
                   "the covariance is positive definite");
}

template <class Derived>
void require_covariance(const Reader& io, const Eigen::MatrixBase<Derived>& P) {
  require_covariance(io.plausible(), P);
}

inline void require_sound(const GaussianBelief& belief) {
  require(belief.stamp > -kStampLimit && belief.stamp < kStampLimit,
          "the stamp is within its limit");
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

/// Calls an estimator and checks it: a message that is not fused, or rejected, changes neither the
/// belief nor the propagated estimate bitwise, and the belief stays sound.
template <class Estimator, class Call>
void call_and_check(Estimator& estimator, const Call& call) {
  const Estimator before = estimator;
  bool fused = false;
  returns([&] { fused = is_fused(call(estimator)); });
  require_sound(estimator.belief());
  if (fused) {
    return;
  }
  require(testing::same_bits(before.belief(), estimator.belief()),
          "a message that is not fused leaves the belief unchanged");
  returns([&] {
    const auto a = before.estimate();
    const auto b = estimator.estimate();
    require(a.stamp == b.stamp && testing::same_bits(a.covariance, b.covariance),
            "a message that is not fused leaves the estimate unchanged");
  });
}

}  // namespace locfuse::fuzz
