// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/association.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "locfuse/filters/gate.hpp"

namespace locfuse {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMaxAppends = 100'000;  // then joint compatibility keeps the best set so far

/// Rows of costs to columns, each column once, at the minimum sum: the Hungarian method with
/// potentials, in O(rows^2 columns). There must be no more rows than columns.
std::vector<int> least_sum(const Eigen::MatrixXd& cost) {
  const auto rows = static_cast<int>(cost.rows());
  const auto columns = static_cast<int>(cost.cols());
  std::vector<double> row_potential(static_cast<std::size_t>(rows) + 1, 0.0);
  std::vector<double> column_potential(static_cast<std::size_t>(columns) + 1, 0.0);
  std::vector<int> row_of(static_cast<std::size_t>(columns) + 1, 0);  // 1-based, 0 is none
  for (int row = 1; row <= rows; ++row) {
    std::vector<double> slack(row_of.size(), kInfinity);
    std::vector<int> before(row_of.size(), 0);
    std::vector<bool> done(row_of.size(), false);
    row_of[0] = row;
    int column = 0;
    while (row_of[static_cast<std::size_t>(column)] != 0) {
      done[static_cast<std::size_t>(column)] = true;
      const int from = row_of[static_cast<std::size_t>(column)];
      double least = kInfinity;
      int next = 0;
      for (int c = 1; c <= columns; ++c) {
        const auto i = static_cast<std::size_t>(c);
        if (done[i]) {
          continue;
        }
        const double reduced = cost(from - 1, c - 1) -
                               row_potential[static_cast<std::size_t>(from)] - column_potential[i];
        if (reduced < slack[i]) {
          slack[i] = reduced;
          before[i] = column;
        }
        if (slack[i] < least) {
          least = slack[i];
          next = c;
        }
      }
      for (std::size_t i = 0; i < row_of.size(); ++i) {
        if (done[i]) {
          row_potential[static_cast<std::size_t>(row_of[i])] += least;
          column_potential[i] -= least;
        } else {
          slack[i] -= least;
        }
      }
      column = next;
    }
    while (column != 0) {
      const int back = before[static_cast<std::size_t>(column)];
      row_of[static_cast<std::size_t>(column)] = row_of[static_cast<std::size_t>(back)];
      column = back;
    }
  }
  std::vector<int> column_of(static_cast<std::size_t>(rows), -1);
  for (int c = 1; c <= columns; ++c) {
    if (const int row = row_of[static_cast<std::size_t>(c)]; row > 0) {
      column_of[static_cast<std::size_t>(row) - 1] = c - 1;
    }
  }
  return column_of;
}

/// Branch and bound over the sightings, one after the other; the innovations of the pairs so far
/// are kept as a Cholesky factor that grows by a block of rows.
class Joint {
 public:
  Joint(const Eigen::MatrixXd& P, const Pairings& pairings, double probability)
      : pairings_(pairings), gate_(probability), best_(pairings.size(), -1), now_(best_) {
    rows_after_.assign(pairings.size() + 1, 0);
    pairs_after_.assign(pairings.size() + 1, 0);
    int seen = 0;
    std::set<int> landmarks;
    for (std::size_t i = pairings.size(); i-- > 0;) {
      Eigen::Index rows = 0;
      for (const Pairing& pairing : pairings[i]) {
        rows = std::max(rows, pairing.lin.residual.size());
        landmarks.insert(pairing.landmark);
      }
      seen += pairings[i].empty() ? 0 : 1;
      rows_after_[i] = rows_after_[i + 1] + rows;
      pairs_after_[i] = std::min(seen, static_cast<int>(landmarks.size()));
    }
    for (const std::vector<Pairing>& of_one : pairings) {
      std::vector<Eigen::MatrixXd> columns;
      columns.reserve(of_one.size());
      for (const Pairing& pairing : of_one) {
        columns.emplace_back(P(Eigen::all, pairing.rows) * pairing.lin.jacobian.transpose());
      }
      cross_.push_back(std::move(columns));
    }
    const Eigen::Index most = rows_after_.front();
    L_.setZero(most, most);
    y_.setZero(most);
  }

  Assignment search() {
    start_from(global_nearest_neighbour(pairings_));
    appends_ = 0;
    branch(0, 0, 0, 0.0);
    return best_;
  }

 private:
  /// Keeps those pairs, one after the other, that fit jointly: what is to be beaten.
  void start_from(const Assignment& assignment) {
    Eigen::Index rows = 0;
    double nis = 0.0;
    for (std::size_t i = 0; i < assignment.size(); ++i) {
      if (assignment[i] < 0) {
        continue;
      }
      const auto k = static_cast<std::size_t>(assignment[i]);
      const double with = nis + append(i, k, rows);
      const Eigen::Index dof = rows + pairings_[i][k].lin.residual.size();
      if (std::isfinite(with) && with <= gate_.limit(static_cast<int>(dof))) {
        now_[i] = assignment[i];
        rows = dof;
        nis = with;
        ++best_pairs_;
      }
    }
    best_ = now_;
    best_nis_ = best_pairs_ > 0 ? std::nextafter(nis, kInfinity) : kInfinity;  // may be equalled
    now_.assign(now_.size(), -1);
  }

  void branch(std::size_t sighting, int pairs, Eigen::Index rows, double nis) {
    if (sighting == pairings_.size()) {
      const bool fits = pairs == 0 || nis <= gate_.limit(static_cast<int>(rows));
      if (fits && (pairs > best_pairs_ || (pairs == best_pairs_ && nis < best_nis_))) {
        best_ = now_;
        best_pairs_ = pairs;
        best_nis_ = nis;
      }
      return;
    }
    const int most = pairs + pairs_after_[sighting];
    if (most < best_pairs_ || (most == best_pairs_ && nis >= best_nis_)) {
      return;
    }
    for (std::size_t k = 0; k < pairings_[sighting].size(); ++k) {
      const Pairing& pairing = pairings_[sighting][k];
      if (taken_.count(pairing.landmark) != 0) {
        continue;
      }
      if (appends_ == kMaxAppends) {
        return;
      }
      const double with = nis + append(sighting, k, rows);
      const Eigen::Index dof = rows + pairing.lin.residual.size();
      // More pairs may be allowed more, so a set that does not fit may be part of one that does.
      if (std::isfinite(with) &&
          with <= gate_.limit(static_cast<int>(dof + rows_after_[sighting + 1]))) {
        now_[sighting] = static_cast<int>(k);
        taken_.insert(pairing.landmark);
        branch(sighting + 1, pairs + 1, dof, with);
        taken_.erase(pairing.landmark);
        now_[sighting] = -1;
      }
    }
    if (pairs + pairs_after_[sighting + 1] >= best_pairs_) {
      branch(sighting + 1, pairs, rows, nis);
    }
  }

  /// Adds a pair's rows to the factor; returns what they add to the joint NIS.
  double append(std::size_t sighting, std::size_t k, Eigen::Index rows) {
    ++appends_;
    const Pairing& pairing = pairings_[sighting][k];
    const Eigen::Index size = pairing.lin.residual.size();
    Eigen::Index at = 0;
    for (std::size_t other = 0; other < sighting; ++other) {
      if (now_[other] < 0) {
        continue;
      }
      const Pairing& with = pairings_[other][static_cast<std::size_t>(now_[other])];
      const Eigen::Index height = with.lin.residual.size();
      // S of this pair with the other, H P H'.
      L_.block(rows, at, size, height) =
          pairing.lin.jacobian *
          cross_[other][static_cast<std::size_t>(now_[other])](pairing.rows, Eigen::all);
      at += height;
    }
    auto row_block = L_.block(rows, 0, size, rows);
    L_.topLeftCorner(rows, rows)
        .triangularView<Eigen::Lower>()
        .transpose()
        .solveInPlace<Eigen::OnTheRight>(row_block);
    const Eigen::MatrixXd S = pairing.lin.jacobian * cross_[sighting][k](pairing.rows, Eigen::all) +
                              pairing.lin.noise - row_block * row_block.transpose();
    const Eigen::LLT<Eigen::MatrixXd> factor(S);
    if (factor.info() != Eigen::Success) {
      return kInfinity;
    }
    L_.block(rows, rows, size, size) = factor.matrixL();
    const Eigen::VectorXd r = pairing.lin.residual - row_block * y_.head(rows);
    y_.segment(rows, size) = factor.matrixL().solve(r);
    return y_.segment(rows, size).squaredNorm();
  }

  const Pairings& pairings_;
  Gate gate_;
  std::vector<Eigen::Index> rows_after_;             // that sightings from one on may add
  std::vector<int> pairs_after_;                     // of pairs
  std::vector<std::vector<Eigen::MatrixXd>> cross_;  // P H' of each pairing
  Eigen::MatrixXd L_;
  Eigen::VectorXd y_;  // L^-1 r
  std::set<int> taken_;
  Assignment best_;
  Assignment now_;
  int appends_ = 0;
  int best_pairs_ = 0;
  double best_nis_ = kInfinity;
};

}  // namespace

void compare(const Eigen::MatrixXd& P, double probability, Pairings& pairings) {
  const Gate gate(probability);
  for (std::vector<Pairing>& of_one : pairings) {
    for (Pairing& pairing : of_one) {
      const Eigen::MatrixXd S =
          pairing.lin.jacobian * P(pairing.rows, pairing.rows) * pairing.lin.jacobian.transpose() +
          pairing.lin.noise;
      pairing.nis = squared_mahalanobis(pairing.lin.residual, S);
    }
    const auto beyond = [&](const Pairing& pairing) {
      return !std::isfinite(pairing.nis) ||
             pairing.nis > gate.limit(static_cast<int>(pairing.lin.residual.size()));
    };
    of_one.erase(std::remove_if(of_one.begin(), of_one.end(), beyond), of_one.end());
  }
}

Assignment nearest_neighbour(const Pairings& pairings) {
  Assignment assignment(pairings.size(), -1);
  const auto chosen = [&](std::size_t i) -> const Pairing& {
    return pairings[i][static_cast<std::size_t>(assignment[i])];
  };
  for (std::size_t i = 0; i < pairings.size(); ++i) {
    const auto nearest =
        std::min_element(pairings[i].begin(), pairings[i].end(),
                         [](const auto& a, const auto& b) { return a.nis < b.nis; });
    if (nearest == pairings[i].end()) {
      continue;
    }
    assignment[i] = static_cast<int>(nearest - pairings[i].begin());
    for (std::size_t j = 0; j < i; ++j) {
      if (assignment[j] >= 0 && chosen(j).landmark == nearest->landmark) {
        assignment[chosen(j).nis <= nearest->nis ? i : j] = -1;
        break;
      }
    }
  }
  return assignment;
}

Assignment global_nearest_neighbour(const Pairings& pairings) {
  std::size_t pairs = 1;  // never a division by 0
  for (const std::vector<Pairing>& of_one : pairings) {
    pairs += of_one.size();
  }
  const double limit = 1e300 / static_cast<double>(pairs);  // or no pair: the sum must be finite
  std::vector<int> landmarks;
  double most = 1.0;
  for (const std::vector<Pairing>& of_one : pairings) {
    for (const Pairing& pairing : of_one) {
      if (pairing.nis <= limit) {
        landmarks.push_back(pairing.landmark);
        most += pairing.nis;
      }
    }
  }
  std::sort(landmarks.begin(), landmarks.end());
  landmarks.erase(std::unique(landmarks.begin(), landmarks.end()), landmarks.end());
  // Being of none costs more than all pairs together, so that as many as possible are made.
  const auto rows = static_cast<Eigen::Index>(pairings.size());
  const auto known = static_cast<Eigen::Index>(landmarks.size());
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(rows, known + rows, 1e3 * most);
  cost.rightCols(rows).setConstant(most);
  for (std::size_t i = 0; i < pairings.size(); ++i) {
    for (const Pairing& pairing : pairings[i]) {
      if (pairing.nis <= limit) {
        const auto column = std::lower_bound(landmarks.begin(), landmarks.end(), pairing.landmark);
        cost(static_cast<Eigen::Index>(i), column - landmarks.begin()) = pairing.nis;
      }
    }
  }
  const std::vector<int> column_of = least_sum(cost);
  Assignment assignment(pairings.size(), -1);
  for (std::size_t i = 0; i < pairings.size(); ++i) {
    for (std::size_t k = 0; k < pairings[i].size(); ++k) {
      if (column_of[i] < known &&
          pairings[i][k].landmark == landmarks[static_cast<std::size_t>(column_of[i])]) {
        assignment[i] = static_cast<int>(k);
      }
    }
  }
  return assignment;
}

Assignment joint_compatibility(const Eigen::MatrixXd& P, const Pairings& pairings,
                               double probability) {
  return Joint(P, pairings, probability).search();
}

Assignment associate(Association association, const Eigen::MatrixXd& P, const Pairings& pairings,
                     double probability) {
  switch (association) {
    case Association::kNearest:
      return nearest_neighbour(pairings);
    case Association::kGlobal:
      return global_nearest_neighbour(pairings);
    case Association::kJoint:
      break;
  }
  return joint_compatibility(P, pairings, probability);
}

}  // namespace locfuse
