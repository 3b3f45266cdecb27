// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "locfuse/geometry/pose2.hpp"
#include "support/bits.hpp"

namespace locfuse::testing {

/// The call throws std::invalid_argument and its text contains each of `words`.
template <class Call, class... Words>
void expect_refused(const Call& call, const Words&... words) {
  try {
    call();
    ADD_FAILURE() << "nothing was thrown";
  } catch (const std::invalid_argument& error) {
    const std::string text = error.what();
    for (const std::string& word : {std::string(words)...}) {
      EXPECT_NE(text.find(word), std::string::npos) << "'" << word << "' is not in: " << text;
    }
  }
}

void expect_pose_near(const Pose2& actual, const Pose2& expected, double tolerance);

/// Largest difference of two matrices is within `tolerance`.
void expect_near(const Eigen::MatrixXd& actual, const Eigen::MatrixXd& expected, double tolerance);

/// Symmetric to the bit, and every eigenvalue positive.
[[nodiscard]] bool is_covariance(const Eigen::MatrixXd& P);

}  // namespace locfuse::testing
