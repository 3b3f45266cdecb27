// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "locfuse/math/numerical_jacobian.hpp"
#include "locfuse/models/measurement/point_distance.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_point_distance {
namespace {

using testing::expect_near;
using testing::expect_refused;

TEST(PointDistanceModel, equals_values_computed_by_hand) {
  const PointDistanceModel model({0.5});
  const auto lin = model.linearize({1.0, 2.0}, {4.0, 6.0}, 5.25);
  EXPECT_EQ(PointDistanceModel::predict({1.0, 2.0}, {4.0, 6.0}), 5.0);
  EXPECT_EQ(lin->residual(0), 0.25);
  expect_near(lin->jacobian, Matrix<1, 4>(-0.6, -0.8, 0.6, 0.8), 1e-15);
  EXPECT_EQ(lin->noise(0), 0.25);
}

TEST(PointDistanceModel, jacobian_matches_differences_from_1_mm_on) {
  testing::Rng rng(2);
  for (int i = 0; i < 100; ++i) {
    const double size = i < 20 ? 1e-3 : 5.0;
    const Vector<4> ab = size * testing::random_matrix(rng, 4, 1);
    const auto lin = PointDistanceModel().linearize(ab.head<2>(), ab.tail<2>(), 1.0);
    const Matrix<1, 4> differences = numerical_jacobian<1, 4>(
        [&](const Vector<4>& d) {
          const Vector<4> moved = ab + d;
          return Vector<1>(PointDistanceModel::predict(moved.head<2>(), moved.tail<2>()));
        },
        1e-7);
    expect_near(lin->jacobian, differences, 1e-5);
  }
}

TEST(PointDistanceModel, is_empty_where_the_points_coincide) {
  EXPECT_FALSE(PointDistanceModel().linearize({1.0, 2.0}, {1.0, 2.0}, 0.5));
}

TEST(PointDistanceModel, rejects_an_invalid_sigma) {
  for (const double sigma : {0.0, -0.1, std::numeric_limits<double>::quiet_NaN(), 1e200}) {
    expect_refused([&] { (void)PointDistanceModel({sigma}); }, "side.sigma_m");
  }
}

}  // namespace
}  // namespace locfuse::test_point_distance
