// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <new>
#include <utility>
#include <vector>

namespace locfuse {

/// Square matrix with room to grow: an Eigen::Map of memory that it owns. Adding rows and columns
/// one after the other copies each entry a bounded number of times. How it lies in memory depends
/// on its size alone, so that what is computed with a copy is the same to the bit.
class Covariance : public Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>> {
 public:
  using View = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

  Covariance() : View(nullptr, 0, 0, Eigen::OuterStride<>(0)) {}
  Covariance(const Covariance& other) : Covariance() { assign(other); }
  Covariance(Covariance&& other) noexcept : Covariance() { swap(other); }
  ~Covariance() = default;
  Covariance& operator=(const Covariance& other) {
    if (this != &other) {
      assign(other);
    }
    return *this;
  }
  Covariance& operator=(Covariance&& other) noexcept {
    swap(other);
    return *this;
  }
  template <class Derived>
  Covariance& operator=(const Eigen::MatrixBase<Derived>& values) {
    if (values.rows() == rows() && values.cols() == cols()) {
      View::operator=(values);
    } else {
      assign(Eigen::MatrixXd(values));  // `values` may be a part of this
    }
    return *this;
  }

  /// Appends rows and columns of zeros.
  void grow(Eigen::Index count) {
    const Eigen::Index size = rows();
    if (stride_of(size + count) != stride_) {
      Covariance larger;
      larger.reshape(size + count);
      larger.topLeftCorner(size, size) = *this;
      swap(larger);
    } else {
      reshape(size + count);
    }
    rightCols(count).setZero();
    bottomRows(count).setZero();
  }

  /// Takes out `count` rows and columns from `first` on.
  void remove(Eigen::Index first, Eigen::Index count) {
    const Eigen::Index size = rows();
    const Eigen::Index stride = stride_of(size - count);  // at most that of now
    double* to = data();
    for (Eigen::Index column = 0; column < size; ++column) {
      if (column >= first && column < first + count) {
        continue;
      }
      const double* from = data() + column * stride_;
      std::copy(from, from + first, to);
      std::copy(from + first + count, from + size, to + first);
      to += stride;
    }
    reshape(size - count);
  }

 private:
  /// Small ones have no room, of the others each step is half as much again; of large ones an odd
  /// number of cache lines, or the entries of a row would compete for the same places in the cache.
  static Eigen::Index stride_of(Eigen::Index size) {
    if (size <= kSmall) {
      return size;
    }
    Eigen::Index stride = kSmall;
    while (stride < size) {
      const Eigen::Index larger = stride + stride / 2;
      stride = larger < 64 ? larger : larger / 16 * 16 + 8;
    }
    return stride;
  }
  template <class Values>
  void assign(const Values& values) {
    reshape(values.rows());
    View::operator=(values);
  }
  void reshape(Eigen::Index size) {
    stride_ = stride_of(size);
    memory_.resize(static_cast<std::size_t>(stride_ * stride_) + kNumbersPerCacheLine - 1);
    show(size);
  }
  void swap(Covariance& other) noexcept {
    const Eigen::Index size = rows();
    const Eigen::Index others = other.rows();
    memory_.swap(other.memory_);
    std::swap(stride_, other.stride_);
    show(others);
    other.show(size);
  }
  void show(Eigen::Index size) noexcept {
    ::new (static_cast<View*>(this)) View(first(), size, size, Eigen::OuterStride<>(stride_));
  }
  /// Where a cache line begins.
  double* first() noexcept {
    const auto address = reinterpret_cast<std::uintptr_t>(memory_.data());
    const auto past = address / sizeof(double) % kNumbersPerCacheLine;
    return memory_.data() + (past == 0 ? 0 : kNumbersPerCacheLine - past);
  }

  static constexpr std::size_t kNumbersPerCacheLine = 8;  // numbers in a cache line
  static constexpr Eigen::Index kSmall = 16;

  std::vector<double> memory_;
  Eigen::Index stride_ = 0;  // of columns
};

}  // namespace locfuse
