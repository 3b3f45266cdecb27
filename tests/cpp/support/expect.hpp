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

inline void expect_pose_near(const Pose2& actual, const Pose2& expected, double tolerance) {
  EXPECT_NEAR(actual.x, expected.x, tolerance);
  EXPECT_NEAR(actual.y, expected.y, tolerance);
  EXPECT_NEAR(angle_difference(actual.heading, expected.heading), 0.0, tolerance);
  EXPECT_GE(actual.heading, -kPi);
  EXPECT_LT(actual.heading, kPi);
}

/// Largest difference of two matrices is within `tolerance`.
template <class A, class B>
void expect_near(const Eigen::MatrixBase<A>& actual, const Eigen::MatrixBase<B>& expected,
                 double tolerance) {
  ASSERT_EQ(actual.rows(), expected.rows());
  ASSERT_EQ(actual.cols(), expected.cols());
  const double difference = (actual - expected).cwiseAbs().maxCoeff();
  EXPECT_TRUE(difference <= tolerance) << "differs by " << difference << ", actual\n"
                                       << actual << "\nexpected\n"
                                       << expected;
}

}  // namespace locfuse::testing
