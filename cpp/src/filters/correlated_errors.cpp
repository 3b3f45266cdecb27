// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/correlated_errors.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace locfuse {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// How it is learnt how much of an error is correlated; docs/models/updates.md, eq. (1.25) and
/// (1.26).
struct CorrelationTuning {
  /// Share of a source's errors that are correlated over the correlation of its innovations: the
  /// filter follows such errors, which takes half of them out of its innovations.
  static constexpr double kShareOverInnovations = 2.0;
  static constexpr double kMemory = 4000.0;        ///< innovations, of each kind
  static constexpr double kMinCorrelation = 0.3;   ///< of two innovations that are compared
  static constexpr double kMaxInnovation = 3.0;    ///< in sigma; larger ones count as this
  static constexpr double kMinInnovations = 20.0;  ///< before a factor is learnt
};

constexpr double kKept = 1.0 - 1.0 / CorrelationTuning::kMemory;

constexpr int kMaxJoint = 32;  // rows of one measurement
constexpr int kInertial = 15;  // variables of an inertial body
using Small =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxJoint, kMaxJoint>;
using SmallColumn = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxJoint, 1>;

/// Whether these are the rows of all `size` variables: sizes that the compiler knows take half the
/// time, of a pose in the plane and of an inertial body.
bool are_whole(const int* rows, Index size) {
  for (Index i = 0; i < size; ++i) {
    if (rows[i] != i) {
      return false;
    }
  }
  return true;
}

/// All columns, D first, of N variables that move by F.
template <int N>
void move_whole(const Eigen::Ref<const MatrixXd>& jacobian, double* memory, Index columns) {
  using Whole = Eigen::Matrix<double, N, N>;
  const Whole F = jacobian;
  Eigen::Map<Eigen::Matrix<double, N, Eigen::Dynamic>> all(memory, N, columns);
  for (Index column = 0; column < columns; ++column) {
    all.col(column) = (F * all.col(column)).eval();
  }
  Eigen::Map<Whole> D(memory);
  D = (D * F.transpose()).eval();
}

/// (I - K H) from the left of all of N variables, for a measurement of one row, and from the right
/// of D.
template <int N>
void contract_whole(const double* gain, const double* transposed, double* memory, Index columns) {
  const Eigen::Map<const Eigen::Matrix<double, N, 1>> K(gain);
  const Eigen::Map<const Eigen::Matrix<double, N, 1>> seen(transposed);
  Eigen::Map<Eigen::Matrix<double, N, Eigen::Dynamic>> all(memory, N, columns);
  for (Index column = 0; column < columns; ++column) {
    all.col(column) -= K * seen.dot(all.col(column));
  }
  Eigen::Map<Eigen::Matrix<double, N, N>> D(memory);
  const Eigen::Matrix<double, N, 1> right = D * seen;
  D.noalias() -= right * K.transpose();
}

/// Of the errors of one row, whose sigma is the last.
struct Parts {
  double factor;
  double own;
  double common;
  double sigma;
};

/// What the error of a measurement of one row adds to D of N variables and to its own columns.
template <int N>
void add_to(const double* gain, const Parts& parts, double* memory, double* own_column,
            double* common_column) {
  using Column = Eigen::Matrix<double, N, 1>;
  Eigen::Map<Eigen::Matrix<double, N, N>> D(memory);
  Eigen::Map<Column> own(own_column);
  Eigen::Map<Column> all(common_column);
  const Column moved = Eigen::Map<const Column>(gain) * parts.sigma;
  const Eigen::Matrix<double, N, N> both =
      (parts.own * own + parts.common * all) * moved.transpose();
  D += ((parts.factor - 1.0) * moved) * moved.transpose() - (both + both.transpose());
  own -= parts.own * moved;
  all -= parts.common * moved;
}

/// L of L L' = R, empty unless that is positive definite. One row, as of a range, is a square root.
Small root_of(const Eigen::Ref<const MatrixXd>& R) {
  if (R.rows() == 1 && R(0, 0) > 0.0) {
    return Small::Constant(1, 1, std::sqrt(R(0, 0)));
  }
  const Eigen::LLT<Small> factor(R);
  return factor.info() == Eigen::Success ? Small(factor.matrixL()) : Small();
}

/// Names what all sources of a kind have in common, in one row of what each measures: an id beyond
/// any of theirs.
std::uint64_t common_of(std::uint64_t source) {
  constexpr std::uint64_t kEveryId = ((1ULL << kBitsOfId) - 1ULL) << kBitsOfRow;
  constexpr std::uint64_t kNoSource = 1ULL << 63U;
  return source | kEveryId | kNoSource;
}

}  // namespace

void CorrelatedErrors::Pairs::add(const Row& before, double now) {
  if (std::isnan(before.innovation) || before.kept <= CorrelationTuning::kMinCorrelation) {
    return;
  }
  const double both = 0.5 * (now * now + before.innovation * before.innovation);
  products = kKept * products + before.kept * now * before.innovation;
  squares = kKept * squares + before.kept * before.kept * both;
  count = kKept * count + before.kept * before.kept;
}

double CorrelatedErrors::Statistics::share() const {
  if (moving.count < 1.0 || !(moving.squares > 0.0)) {
    return 1.0;
  }
  const double correlation = std::max(
      standing.correlation(), moving.correlation() + 1.0 / std::sqrt(moving.count));  // one sigma
  return std::clamp(CorrelationTuning::kShareOverInnovations * correlation, 0.0, 1.0);
}

double CorrelatedErrors::Statistics::common_of(double share) const {
  return std::clamp(CorrelationTuning::kShareOverInnovations * of_all.correlation(), 0.0, share);
}

double CorrelatedErrors::Statistics::factor() const {
  return innovations < CorrelationTuning::kMinInnovations ? 1.0 : std::max(1.0, nis / innovations);
}

void CorrelatedErrors::move(const Eigen::Ref<const MatrixXd>& jacobian, const int* rows) {
  if (is_empty()) {
    return;
  }
  const Index moving = jacobian.rows();
  const Index all = jacobian.cols();
  if (moving == variables_ && all == variables_ && are_whole(rows, all)) {
    if (variables_ == 3) {
      return move_whole<3>(jacobian, memory_.data(), used());
    }
    if (variables_ == kInertial) {
      return move_whole<kInertial>(jacobian, memory_.data(), used());
    }
  }
  constexpr Index kFew = 15;  // no heap up to there
  std::array<double, kFew> few;
  std::vector<double> many(all > kFew ? static_cast<std::size_t>(all) : 0);
  double* before = many.empty() ? few.data() : many.data();
  const auto turn = [&](double* first, Index step) {
    for (Index k = 0; k < all; ++k) {
      before[k] = first[rows[k] * step];
    }
    for (Index i = 0; i < moving; ++i) {
      double sum = 0.0;
      for (Index k = 0; k < all; ++k) {
        sum += jacobian(i, k) * before[k];
      }
      first[rows[i] * step] = sum;
    }
  };
  for (Index column = 0; column < used(); ++column) {
    turn(memory_.data() + column * variables_, 1);
  }
  for (Index row = 0; row < variables_; ++row) {
    turn(memory_.data() + row, variables_);
  }
}

void CorrelatedErrors::turn(const Eigen::VectorXd& by, int row) {
  if (is_empty()) {
    return;
  }
  auto all = table().leftCols(used());
  const Eigen::VectorXd across = all.col(row) + all(row, row) * by;
  for (Index column = 0; column < used(); ++column) {
    const double of_row = all(row, column);
    all.col(column) += by * of_row;
    if (column < variables_) {
      all.col(column) += across * by(column);
    }
  }
}

void CorrelatedErrors::take(const Fused& fused, Stamp stamp) {
  const Index size = fused.gain.rows();
  const Index m = fused.gain.cols();
  const bool correlated = fused.correlation_s > 0.0 && m <= kMaxJoint;
  if (is_empty() && !correlated) {
    return;
  }
  if (is_empty()) {
    variables_ = size;
    memory_.assign(static_cast<std::size_t>(size * (size + 1)), 0.0);
  }
  std::array<Columns, kMaxJoint> columns;
  if (correlated) {
    for (Index i = 0; i < m; ++i) {
      columns[static_cast<std::size_t>(i)] = {column_of(fused.sources[i], stamp),
                                              column_of(common_of(fused.sources[i]), stamp)};
    }
    for (Index i = 0; i < m; ++i) {
      bring_to(stamp, columns[static_cast<std::size_t>(i)].own, fused.correlation_s);
      bring_to(stamp, columns[static_cast<std::size_t>(i)].common, fused.correlation_s);
    }
  }
  if (size > kInertial && m <= kMaxJoint) {
    take_at_once(fused, correlated ? columns.data() : nullptr);
  } else {
    contract(fused);
    if (correlated) {
      add(fused, columns.data());
    }
  }
  // Beyond what numbers hold it is as if nothing had been fused. Not in `move`, which a transaction
  // may put back.
  if (!std::isfinite(excess().diagonal().sum())) {
    *this = restarted();
  }
}

/// The same for a large belief: D, which is symmetric, is read and written once. With W = D H',
/// U = W - K (H W) / 2, to which what the errors add goes as well, it is D - K U' - U K'.
void CorrelatedErrors::take_at_once(const Fused& fused, const Columns* columns) {
  const Index size = fused.gain.rows();
  const Index m = fused.gain.cols();
  const auto& K = fused.gain;
  const auto at_rows = [&](const auto& column, Index j) {  // of H' and a column
    double sum = 0.0;
    for (Index k = 0; k < fused.transposed.rows(); ++k) {
      sum += fused.transposed(k, j) * column(fused.rows[k]);
    }
    return sum;
  };
  auto table = this->table();
  MatrixXd U = MatrixXd::Zero(size, m);
  for (Index j = 0; j < m; ++j) {
    for (Index k = 0; k < fused.transposed.rows(); ++k) {
      U.col(j) += fused.transposed(k, j) * table.col(fused.rows[k]);
    }
  }
  MatrixXd HW(m, m);
  for (Index j = 0; j < m; ++j) {
    for (Index i = 0; i < m; ++i) {
      HW(i, j) = at_rows(U.col(j), i);
    }
  }
  U.noalias() -= 0.5 * K * HW;
  for (Index column = size; column < used(); ++column) {
    for (Index j = 0; j < m; ++j) {
      HW(j, 0) = at_rows(table.col(column), j);
    }
    table.col(column).noalias() -= K * HW.col(0);
  }
  const Small L = columns != nullptr ? root_of(fused.noise) : Small();
  if (L.size() > 0) {
    const Statistics& known = of_kind_[fused.kind];
    const double factor = known.factor();
    const double share = known.share();
    const double common = known.common_of(share);
    const double of_own = std::sqrt((share - common) * factor);
    const double of_common = std::sqrt(common * factor);
    const MatrixXd moved = K * L;  // by errors of one sigma
    MatrixXd with = -0.5 * (factor - 1.0) * moved;
    for (Index j = 0; j < m; ++j) {
      auto own = table.col(size + columns[j].own);
      auto all = table.col(size + columns[j].common);
      with.col(j) += of_own * own + of_common * all;
      own -= of_own * moved.col(j);
      all -= of_common * moved.col(j);
    }
    U.noalias() += with * L.transpose();
  }
  for (Index column = 0; column < size; ++column) {
    for (Index j = 0; j < m; ++j) {
      table.col(column) -= K.col(j) * U(column, j) + U.col(j) * K(column, j);
    }
  }
  if (L.size() > 0) {
    learn(fused, columns);
  }
}

/// What is left of the errors of a row, at the stamp of what is fused now.
void CorrelatedErrors::bring_to(Stamp stamp, Index column, double correlation_s) {
  Row& row = rows_[static_cast<std::size_t>(column)];
  if (row.is_used) {  // not before in this measurement
    const double lasted = seconds_between(row.stamp, stamp);
    const double stood = stood_s_ - row.stood;
    row.kept = std::exp(std::min(0.0, (stood - lasted) / correlation_s));
    row.has_stood = stood > 0.5 * lasted;
    row.stamp = stamp;
    row.stood = stood_s_;
    row.is_used = false;
    table().col(variables_ + column) *= row.kept;
  }
}

/// (I - K H) from the left of all, and from the right of D.
void CorrelatedErrors::contract(const Fused& fused) {
  const Index size = fused.gain.rows();
  const Index m = fused.gain.cols();
  const Index parts = fused.transposed.rows();
  if (m == 1 && parts == size && are_whole(fused.rows, size)) {
    const double* gain = fused.gain.data();
    if (size == 3) {
      return contract_whole<3>(gain, fused.transposed.data(), memory_.data(), used());
    }
    if (size == kInertial) {
      return contract_whole<kInertial>(gain, fused.transposed.data(), memory_.data(), used());
    }
  }
  std::array<double, kMaxJoint> few;
  std::vector<double> many(m > kMaxJoint ? static_cast<std::size_t>(m) : 0);
  double* seen = many.empty() ? few.data() : many.data();
  const auto apply = [&](double* first, Index step) {
    for (Index j = 0; j < m; ++j) {
      seen[j] = 0.0;
      for (Index k = 0; k < parts; ++k) {
        seen[j] += fused.transposed(k, j) * first[fused.rows[k] * step];
      }
    }
    for (Index j = 0; j < m; ++j) {
      for (Index i = 0; i < size; ++i) {
        first[i * step] -= fused.gain(i, j) * seen[j];
      }
    }
  };
  for (Index column = 0; column < used(); ++column) {
    apply(memory_.data() + column * size, 1);
  }
  for (Index row = 0; row < size; ++row) {
    apply(memory_.data() + row, size);
  }
}

/// What the errors of a measurement add, beyond what the filter takes them for.
void CorrelatedErrors::add(const Fused& fused, const Columns* columns) {
  const Index size = fused.gain.rows();
  const Index m = fused.gain.cols();
  const Statistics& known = of_kind_[fused.kind];
  const double factor = known.factor();
  const double share = known.share();
  const double common = known.common_of(share);
  const Small L = root_of(fused.noise);
  if (L.size() == 0) {
    return;
  }
  const double of_own = std::sqrt((share - common) * factor);
  const double of_common = std::sqrt(common * factor);
  if (m == 1 && (size == 3 || size == kInertial)) {
    double* own = memory_.data() + size * (size + columns[0].own);
    double* all = memory_.data() + size * (size + columns[0].common);
    const Parts parts{factor, of_own, of_common, L(0, 0)};
    size == 3 ? add_to<3>(fused.gain.data(), parts, memory_.data(), own, all)
              : add_to<kInertial>(fused.gain.data(), parts, memory_.data(), own, all);
    learn(fused, columns);
    return;
  }
  auto table = this->table();
  auto moved = table.col(used());  // by an error of one sigma
  for (Index j = 0; j < m; ++j) {
    auto own = table.col(size + columns[j].own);
    auto all = table.col(size + columns[j].common);
    for (Index i = 0; i < size; ++i) {
      moved(i) = 0.0;
      for (Index k = j; k < m; ++k) {
        moved(i) += fused.gain(i, k) * L(k, j);
      }
    }
    for (Index a = 0; a < size; ++a) {
      for (Index b = 0; b < size; ++b) {
        table(a, b) += (factor - 1.0) * moved(a) * moved(b) -
                       (of_own * own(a) + of_common * all(a)) * moved(b) -
                       moved(a) * (of_own * own(b) + of_common * all(b));
      }
    }
    own -= of_own * moved;
    all -= of_common * moved;
  }
  learn(fused, columns);
}

/// The column of the errors of a source, which is new where it has none.
Index CorrelatedErrors::column_of(std::uint64_t source, Stamp stamp) {
  const auto known = std::find_if(rows_.begin(), rows_.end(),
                                  [&](const Row& row) { return row.source == source; });
  if (known != rows_.end()) {
    known->is_used = true;
    return known - rows_.begin();
  }
  const Row added{source, stamp, stood_s_, 1.0, std::numeric_limits<double>::quiet_NaN(),
                  source, false, true};
  Index column = static_cast<Index>(rows_.size());
  if (column < kMaxRows) {
    rows_.push_back(added);
    memory_.resize(static_cast<std::size_t>(variables_ * (used() + 1)));
  } else {
    const auto oldest =
        std::min_element(rows_.begin(), rows_.end(), [](const Row& a, const Row& b) {
          return a.is_used != b.is_used ? b.is_used : a.stamp < b.stamp;
        });
    *oldest = added;
    column = oldest - rows_.begin();
  }
  table().col(variables_ + column).setZero();
  return column;
}

void CorrelatedErrors::reserve(Index variables) {
  rows_.reserve(kMaxRows);
  memory_.reserve(static_cast<std::size_t>(variables * (variables + kMaxRows + 1)));
}

/// Compares innovations with those before, and keeps them.
void CorrelatedErrors::learn(const Fused& fused, const Columns* columns) {
  const Index m = fused.gain.cols();
  if (fused.innovation.size() == 0) {
    for (Index i = 0; i < m; ++i) {  // the next one has none to be compared with
      rows_[static_cast<std::size_t>(columns[i].common)].innovation =
          std::numeric_limits<double>::quiet_NaN();
    }
    return;
  }
  SmallColumn whitened = fused.residual;
  if (m == 1) {
    whitened(0) /= std::sqrt(fused.innovation(0, 0));
  } else {
    const Eigen::LLT<Small> factor(fused.innovation);
    factor.matrixL().solveInPlace(whitened);
  }
  Statistics& known = of_kind_[fused.kind];
  for (Index i = 0; i < m; ++i) {
    const double now = std::clamp(whitened(i), -CorrelationTuning::kMaxInnovation,
                                  CorrelationTuning::kMaxInnovation);
    known.nis = kKept * known.nis + now * now;
    known.innovations = kKept * known.innovations + 1.0;
    Row& own = rows_[static_cast<std::size_t>(columns[i].own)];
    Row& all = rows_[static_cast<std::size_t>(columns[i].common)];
    (own.has_stood ? known.standing : known.moving).add(own, now);
    if (all.of != fused.sources[i]) {
      known.of_all.add(all, now);
    }
    for (Row* row : {&own, &all}) {
      row->innovation = now;
      row->of = fused.sources[i];
      row->kept = 1.0;  // for the next row of this measurement
    }
  }
}

void CorrelatedErrors::grow(Index count, const Eigen::Ref<const MatrixXd>& jacobian,
                            const std::vector<int>& rows) {
  if (is_empty()) {
    return;
  }
  const MatrixXd before = table();
  const Index size = variables_;
  const Index columns = before.cols() - size;
  variables_ += count;
  memory_.assign(static_cast<std::size_t>(variables_ * (used() + 1)), 0.0);
  auto after = table();
  after.topLeftCorner(size, size) = before.leftCols(size);
  after.topRightCorner(size, columns) = before.rightCols(columns);
  if (!rows.empty()) {
    const MatrixXd cross = jacobian * before(rows, Eigen::all);
    after.bottomLeftCorner(count, size) = cross.leftCols(size);
    after.bottomRightCorner(count, columns) = cross.rightCols(columns);
    after.block(0, size, size, count) = cross.leftCols(size).transpose();
    after.block(size, size, count, count) = cross(Eigen::all, rows) * jacobian.transpose();
  }
}

void CorrelatedErrors::remove(Index first, Index count) {
  if (is_empty()) {
    return;
  }
  const MatrixXd before = table();
  std::vector<Index> rows;
  std::vector<Index> columns;
  for (Index i = 0; i < before.cols(); ++i) {
    if (i < first || i >= first + count) {
      columns.push_back(i);
      if (i < variables_) {
        rows.push_back(i);
      }
    }
  }
  variables_ -= count;
  memory_.resize(static_cast<std::size_t>(variables_ * (used() + 1)));
  table() = before(rows, columns);
}

CorrelatedErrors CorrelatedErrors::restarted() const {
  CorrelatedErrors anew;
  anew.of_kind_ = of_kind_;
  return anew;
}

}  // namespace locfuse
