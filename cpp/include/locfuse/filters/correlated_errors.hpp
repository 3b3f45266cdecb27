// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "locfuse/math/linearization.hpp"
#include "locfuse/time.hpp"

namespace locfuse {

/// What errors that are correlated over seconds add to the covariance of a filter whose gains take
/// them for independent: eq. (1.21) to (1.26) of docs/models/updates.md. How much of an error is
/// correlated is learnt from innovations, and taken for all of it before there are any.
///
/// It moves nothing but the covariance that is reported: the mean, P, gains and gates are as
/// without it.
class CorrelatedErrors {
 public:
  /// Sources whose errors are remembered; of more those that were fused last.
  static constexpr Eigen::Index kMaxRows = 64;

  /// Makes room, so that sources of a belief of so many variables that are new take no memory.
  void reserve(Eigen::Index variables);

  /// Whether nothing correlated was fused yet, so that all else changes nothing.
  [[nodiscard]] bool is_empty() const { return rows_.empty(); }

  /// D, eq. (1.23), which is added to P. Empty as above.
  [[nodiscard]] auto excess() const { return table().leftCols(variables_); }

  /// Some variables, at `rows`, moved by F or turned: `jacobian` has a row for each that moves,
  /// which are the first, and a column for each.
  void move(const Eigen::Ref<const Eigen::MatrixXd>& jacobian, const int* rows);

  /// All variables moved by I + u e', with e of one row: each by what it has in `by` of that row.
  void turn(const Eigen::VectorXd& by, int row);

  /// So much of the time that passes the body stood: errors last as long as what makes them does
  /// not change.
  void stand(double seconds) { stood_s_ += seconds; }

  /// What an update used.
  struct Fused {
    Eigen::Ref<const Eigen::MatrixXd> gain;        ///< K, a row for each variable of the belief
    Eigen::Ref<const Eigen::MatrixXd> transposed;  ///< H', a row for each in `rows`
    const int* rows;                               ///< those that H has columns for
    Eigen::Ref<const Eigen::VectorXd> residual;
    Eigen::Ref<const Eigen::MatrixXd> noise;       ///< R
    Eigen::Ref<const Eigen::MatrixXd> innovation;  ///< S; empty where nothing was compared
    double correlation_s;                          ///< 0: its errors are independent
    std::size_t kind;
    const std::uint64_t* sources;  ///< of each row
  };
  /// A measurement was fused at `stamp`.
  void take(const Fused& fused, Stamp stamp);

  /// `count` variables more, at the end, as `jacobian` makes them of those at `rows`.
  void grow(Eigen::Index count, const Eigen::Ref<const Eigen::MatrixXd>& jacobian,
            const std::vector<int>& rows);
  void remove(Eigen::Index first, Eigen::Index count);

  /// The same that was learnt, and nothing of what was fused: of a belief that starts anew.
  [[nodiscard]] CorrelatedErrors restarted() const;

  /// All that `move` of the first three variables and `stand` change, to be put back by `restore`:
  /// their rows, and their columns of D.
  [[nodiscard]] auto moving_rows() const { return table().topLeftCorner(moving(), used()); }
  [[nodiscard]] auto moving_columns() const { return table().leftCols(moving()); }
  [[nodiscard]] double stood() const { return stood_s_; }
  template <class MovingRows, class MovingColumns>
  void restore(const MovingRows& rows, const MovingColumns& columns, double stood) {
    table().topLeftCorner(moving(), used()) = rows;
    table().leftCols(moving()) = columns;
    stood_s_ = stood;
  }

  /// The share of the variance of a kind of measurement that is correlated, and the factor of all
  /// of it, as its innovations say; eq. (1.25) and (1.26).
  [[nodiscard]] double share(std::size_t kind) const { return of_kind_[kind].share(); }
  /// Of that share, what all sources of the kind have in common.
  [[nodiscard]] double common(std::size_t kind) const {
    return of_kind_[kind].common_of(of_kind_[kind].share());
  }
  [[nodiscard]] double factor(std::size_t kind) const { return of_kind_[kind].factor(); }

 private:
  struct Row {
    std::uint64_t source;  // or what all of a kind have in common
    Stamp stamp;           // of when it was fused last
    double stood;          // until then
    double kept;           // of that error, at the stamp of what is fused now
    double innovation;     // of then, of variance 1 as the filter sees it
    std::uint64_t of;      // the source of that
    bool has_stood;        // the body, since
    bool is_used;          // by what is fused now
  };
  struct Pairs {
    double products = 0.0;  // of successive innovations
    double squares = 0.0;   // what they would be if all were correlated
    double count = 0.0;
    void add(const Row& before, double now);
    [[nodiscard]] double correlation() const { return squares > 0.0 ? products / squares : 0.0; }
  };
  struct Statistics {
    Pairs moving;    // of one source
    Pairs standing;  // which take up what lasts: it is there where it is seen, not absent if not
    Pairs of_all;    // of different sources
    double nis = 0.0;
    double innovations = 0.0;
    [[nodiscard]] double share() const;
    [[nodiscard]] double common_of(double share) const;
    [[nodiscard]] double factor() const;
  };
  [[nodiscard]] Eigen::Index used() const {
    return variables_ + static_cast<Eigen::Index>(rows_.size());
  }
  [[nodiscard]] Eigen::Index moving() const { return is_empty() ? 0 : 3; }
  struct Columns {
    Eigen::Index own;     // of a source
    Eigen::Index common;  // of all of its kind
  };
  [[nodiscard]] Eigen::Index column_of(std::uint64_t source, Stamp stamp);
  void bring_to(Stamp stamp, Eigen::Index column, double correlation_s);
  void take_at_once(const Fused& fused, const Columns* columns);
  void contract(const Fused& fused);
  void add(const Fused& fused, const Columns* columns);
  void learn(const Fused& fused, const Columns* columns);

  /// D, then for each row cov(error of the state, its own), eq. (1.21), then one column of room.
  [[nodiscard]] Eigen::Map<Eigen::MatrixXd> table() {
    return {memory_.data(), variables_, used() + 1};
  }
  [[nodiscard]] Eigen::Map<const Eigen::MatrixXd> table() const {
    return {memory_.data(), variables_, used() + 1};
  }

  Eigen::Index variables_ = 0;
  double stood_s_ = 0.0;
  std::vector<double> memory_;  // of the table, whose columns follow each other
  std::vector<Row> rows_;
  std::array<Statistics, kErrorKinds> of_kind_;
};

}  // namespace locfuse
