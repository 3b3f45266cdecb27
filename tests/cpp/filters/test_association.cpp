// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "locfuse/filters/association.hpp"
#include "locfuse/math/chi_squared.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_association {
namespace {

using testing::random_covariance;
using testing::random_matrix;
using testing::Rng;
using testing::uniform;

/// A measurement of a point whose position errors are those of a body, and its own noise.
Pairing pairing(int landmark, const Vector<2>& residual, double sigma = 0.1) {
  Pairing made;
  made.landmark = landmark;
  made.lin.residual = residual;
  made.lin.jacobian = Matrix<2, 2>::Identity();
  made.lin.noise = sigma * sigma * Matrix<2, 2>::Identity();
  made.rows = {0, 1};
  return made;
}

/// Landmarks, and sightings that are off by `shift` together and by `noise` each.
Pairings sightings(const std::vector<Vector<2>>& landmarks, const std::vector<Vector<2>>& seen) {
  Pairings pairings(seen.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t k = 0; k < landmarks.size(); ++k) {
      pairings[i].push_back(pairing(static_cast<int>(k), seen[i] - landmarks[k]));
    }
  }
  return pairings;
}

std::vector<int> landmarks_of(const Pairings& pairings, const Assignment& assignment) {
  std::vector<int> landmarks;
  for (std::size_t i = 0; i < pairings.size(); ++i) {
    landmarks.push_back(
        assignment[i] < 0 ? -1 : pairings[i][static_cast<std::size_t>(assignment[i])].landmark);
  }
  return landmarks;
}

/// Calls `each` with every assignment that uses no landmark twice.
void for_all(const Pairings& pairings, const std::function<void(const Assignment&)>& each) {
  Assignment now(pairings.size(), -1);
  std::vector<int> taken;
  const std::function<void(std::size_t)> from = [&](std::size_t i) {
    if (i == pairings.size()) {
      each(now);
      return;
    }
    from(i + 1);
    for (std::size_t k = 0; k < pairings[i].size(); ++k) {
      const int landmark = pairings[i][k].landmark;
      if (std::find(taken.begin(), taken.end(), landmark) != taken.end()) {
        continue;
      }
      now[i] = static_cast<int>(k);
      taken.push_back(landmark);
      from(i + 1);
      taken.pop_back();
      now[i] = -1;
    }
  };
  from(0);
}

/// r' S^-1 r of all pairs stacked.
std::pair<double, int> joint_nis(const Eigen::MatrixXd& P, const Pairings& pairings,
                                 const Assignment& assignment) {
  std::vector<const Pairing*> chosen;
  Eigen::Index rows = 0;
  for (std::size_t i = 0; i < pairings.size(); ++i) {
    if (assignment[i] >= 0) {
      chosen.push_back(&pairings[i][static_cast<std::size_t>(assignment[i])]);
      rows += chosen.back()->lin.residual.size();
    }
  }
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(rows, P.rows());
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::VectorXd r(rows);
  Eigen::Index at = 0;
  for (const Pairing* pair : chosen) {
    const Eigen::Index size = pair->lin.residual.size();
    H(Eigen::seqN(at, size), pair->rows) = pair->lin.jacobian;
    R.block(at, at, size, size) = pair->lin.noise;
    r.segment(at, size) = pair->lin.residual;
    at += size;
  }
  const Eigen::MatrixXd S = H * P * H.transpose() + R;
  return {rows == 0 ? 0.0 : r.dot(S.llt().solve(r)), static_cast<int>(rows)};
}

Pairings random_pairings(Rng& rng) {
  Pairings pairings(4);
  for (std::vector<Pairing>& of_one : pairings) {
    for (int landmark = 0; landmark < 4; ++landmark) {
      Pairing made;
      const Eigen::Index size = uniform(rng, 0.0, 1.0) < 0.3 ? 1 : 2;
      made.landmark = landmark;
      made.rows = {0, 1, 3 + landmark};
      made.lin.residual = 4.0 * random_matrix(rng, size, 1);
      made.lin.jacobian = random_matrix(rng, size, 3);
      made.lin.noise = 0.3 * random_covariance(rng, size);
      of_one.push_back(made);
    }
  }
  return pairings;
}

TEST(Association, compare_computes_the_nis_and_drops_what_the_gate_does) {
  Rng rng(1);
  const Eigen::MatrixXd P = random_covariance(rng, 7);
  Pairings pairings = random_pairings(rng);
  Pairings kept = pairings;
  compare(P, 0.9, kept);
  for (std::size_t i = 0; i < pairings.size(); ++i) {
    std::size_t next = 0;
    for (std::size_t k = 0; k < pairings[i].size(); ++k) {
      Assignment one(pairings.size(), -1);
      one[i] = static_cast<int>(k);
      const auto [nis, dof] = joint_nis(P, pairings, one);
      if (nis <= chi_squared_quantile(dof, 0.9)) {
        ASSERT_LT(next, kept[i].size());
        EXPECT_NEAR(kept[i][next].nis, nis, 1e-9);
        EXPECT_EQ(kept[i][next].landmark, pairings[i][k].landmark);
        ++next;
      }
    }
    EXPECT_EQ(next, kept[i].size());
  }
}

TEST(Association, the_nearest_of_two_that_want_one_landmark_gets_it) {
  const std::vector<Vector<2>> landmarks{{0.0, 0.0}, {3.0, 0.0}};
  Pairings pairings = sightings(landmarks, {{0.3, 0.0}, {0.1, 0.0}, {9.0, 0.0}});
  compare(0.01 * Eigen::MatrixXd::Identity(2, 2), 0.999, pairings);
  EXPECT_EQ(landmarks_of(pairings, nearest_neighbour(pairings)), (std::vector<int>{-1, 0, -1}));
}

TEST(Association, global_nearest_neighbour_is_the_best_of_all_assignments) {
  Rng rng(2);
  for (int round = 0; round < 200; ++round) {
    const Eigen::MatrixXd P = random_covariance(rng, 7);
    Pairings pairings = random_pairings(rng);
    compare(P, 0.99, pairings);
    int most = 0;
    double least = 0.0;
    for_all(pairings, [&](const Assignment& assignment) {
      int pairs = 0;
      double sum = 0.0;
      for (std::size_t i = 0; i < pairings.size(); ++i) {
        if (assignment[i] >= 0) {
          ++pairs;
          sum += pairings[i][static_cast<std::size_t>(assignment[i])].nis;
        }
      }
      if (pairs > most || (pairs == most && sum < least)) {
        most = pairs;
        least = sum;
      }
    });
    const Assignment found = global_nearest_neighbour(pairings);
    double sum = 0.0;
    std::vector<int> used = landmarks_of(pairings, found);
    used.erase(std::remove(used.begin(), used.end(), -1), used.end());
    for (std::size_t i = 0; i < pairings.size(); ++i) {
      sum += found[i] < 0 ? 0.0 : pairings[i][static_cast<std::size_t>(found[i])].nis;
    }
    EXPECT_EQ(static_cast<int>(used.size()), most);
    EXPECT_NEAR(sum, least, 1e-9);
    std::sort(used.begin(), used.end());
    EXPECT_EQ(std::adjacent_find(used.begin(), used.end()), used.end());
  }
}

TEST(Association, joint_compatibility_is_the_largest_set_that_fits_jointly) {
  Rng rng(3);
  for (int round = 0; round < 200; ++round) {
    const Eigen::MatrixXd P = random_covariance(rng, 7);
    Pairings pairings = random_pairings(rng);
    compare(P, 0.99, pairings);
    int most = 0;
    double least = std::numeric_limits<double>::infinity();
    for_all(pairings, [&](const Assignment& assignment) {
      const auto [nis, dof] = joint_nis(P, pairings, assignment);
      const auto pairs = static_cast<int>(
          std::count_if(assignment.begin(), assignment.end(), [](int k) { return k >= 0; }));
      if (pairs > 0 && nis > chi_squared_quantile(dof, 0.99)) {
        return;
      }
      if (pairs > most || (pairs == most && nis < least)) {
        most = pairs;
        least = nis;
      }
    });
    const Assignment found = joint_compatibility(P, pairings, 0.99);
    const auto [nis, dof] = joint_nis(P, pairings, found);
    EXPECT_EQ(std::count_if(found.begin(), found.end(), [](int k) { return k >= 0; }), most);
    EXPECT_NEAR(nis, least, 1e-8);
  }
}

TEST(Association, a_common_error_fools_the_nearest_neighbour_but_not_the_joint_test) {
  // A row of posts, one metre apart, seen 0.8 m farther on: each by itself is nearest to the next.
  std::vector<Vector<2>> landmarks;
  std::vector<Vector<2>> seen;
  for (int i = 0; i < 5; ++i) {
    landmarks.emplace_back(i, 0.0);
    seen.emplace_back(i + 0.8, 0.0);
  }
  landmarks.emplace_back(0.0, 2.0);  // one off the line decides
  seen.emplace_back(0.8, 2.0);
  const Eigen::MatrixXd P = 0.25 * Eigen::MatrixXd::Identity(2, 2);
  Pairings pairings = sightings(landmarks, seen);
  compare(P, 0.999, pairings);
  EXPECT_EQ(landmarks_of(pairings, joint_compatibility(P, pairings, 0.999)),
            (std::vector<int>{0, 1, 2, 3, 4, 5}));
  EXPECT_NE(landmarks_of(pairings, nearest_neighbour(pairings)),
            (std::vector<int>{0, 1, 2, 3, 4, 5}));
}

TEST(Association, nothing_seen_or_nothing_known_is_nothing_assigned) {
  const Eigen::MatrixXd P = Eigen::MatrixXd::Identity(2, 2);
  for (const Pairings& pairings : {Pairings{}, Pairings(3)}) {
    const Assignment none(pairings.size(), -1);
    EXPECT_EQ(nearest_neighbour(pairings), none);
    EXPECT_EQ(global_nearest_neighbour(pairings), none);
    EXPECT_EQ(joint_compatibility(P, pairings, 0.99), none);
  }
}

// The Hungarian method went on for ever where its sums were no numbers.
TEST(Association, a_nis_that_is_no_number_makes_no_pair) {
  for (const double nis : {std::numeric_limits<double>::infinity(), std::nan(""), 1.7e308}) {
    Pairings pairings(2);
    pairings[0].push_back(pairing(3, {0.0, 0.0}));
    pairings[0].back().nis = nis;
    pairings[1] = pairings[0];
    EXPECT_EQ(global_nearest_neighbour(pairings), (Assignment{-1, -1})) << nis;
    pairings[1].front().nis = 2.0;
    EXPECT_EQ(global_nearest_neighbour(pairings), (Assignment{-1, 0})) << nis;
  }
}

TEST(Association, compare_lets_no_infinite_nis_through_the_widest_gate) {
  Pairings pairings{{pairing(0, {1e200, 0.0}), pairing(1, {1e100, 0.0})}};
  compare(Eigen::MatrixXd::Identity(2, 2), 1.0, pairings);
  ASSERT_EQ(pairings[0].size(), 1U);
  EXPECT_EQ(pairings[0].front().landmark, 1);
  EXPECT_EQ(joint_compatibility(Eigen::MatrixXd::Identity(2, 2),
                                {{pairing(0, {1e200, 0.0}), pairing(1, {1e100, 0.0})}}, 1.0),
            (Assignment{1}));
}

/// A row of posts, half a metre apart, seen from a pose that P is of.
Pairings row_of_posts(int posts, double gate, const Eigen::MatrixXd& P) {
  Pairings pairings(static_cast<std::size_t>(posts));
  for (int i = 0; i < posts; ++i) {
    const Vector<2> seen(5.0 + 0.3 * std::cos(11.0 * i), 0.5 * i + 0.17 * std::sin(7.0 * i));
    for (int k = 0; k < posts; ++k) {
      const Vector<2> post(5.0, 0.5 * k);
      Pairing made = pairing(k, seen - post);
      made.lin.jacobian = (Matrix<2, 3>() << 1.0, 0.0, -post.y(), 0.0, 1.0, post.x()).finished();
      made.rows = {0, 1, 2};
      pairings[static_cast<std::size_t>(i)].push_back(made);
    }
  }
  compare(P, gate, pairings);
  return pairings;
}

// From a start known to 2 m and 0.3 rad nearly any pairs of 27 posts fit: it took 13 s, and twice
// that with each post more.
TEST(JointCompatibility, ends_in_time_however_many_fit) {
  const Eigen::MatrixXd P = Vector<3>(4.0, 4.0, 0.09).asDiagonal();
  const Pairings pairings = row_of_posts(27, 0.999, P);
  const Assignment found = joint_compatibility(P, pairings, 0.999);
  std::vector<int> used = landmarks_of(pairings, found);
  used.erase(std::remove(used.begin(), used.end(), -1), used.end());
  EXPECT_GE(used.size(), 17U);
  std::sort(used.begin(), used.end());
  EXPECT_EQ(std::adjacent_find(used.begin(), used.end()), used.end());
  const auto [nis, dof] = joint_nis(P, pairings, found);
  EXPECT_LE(nis, chi_squared_quantile(dof, 0.999));
}

}  // namespace
}  // namespace locfuse::test_association
