// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/belief.hpp"

#include <Eigen/Cholesky>
#include <sstream>
#include <stdexcept>

#include "locfuse/math/symmetric.hpp"

namespace locfuse {

GaussianBelief GaussianBelief::of_pose(Stamp stamp, const Pose2& pose,
                                       const Matrix<3, 3>& covariance) {
  GaussianBelief belief;
  belief.stamp = stamp;
  belief.add("body", SlotKind::kPose2, Vector<3>(pose.x, pose.y, pose.heading), covariance);
  return belief;
}

Slot GaussianBelief::add(const std::string& name, SlotKind kind,
                         const Eigen::Ref<const Eigen::VectorXd>& mean,
                         const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  const int size = dimension_of(kind);
  if (mean.size() != size || covariance.rows() != size || covariance.cols() != size) {
    std::ostringstream text;
    text << "slot '" << name << "' holds " << size << " numbers, got a mean of " << mean.size()
         << " and a covariance of " << covariance.rows() << " x " << covariance.cols();
    throw std::invalid_argument(text.str());
  }
  constexpr double kMaxMagnitude = 1e150;  // its square is finite
  const bool positive = (covariance.array().abs() <= kMaxMagnitude).all() &&
                        is_symmetric(covariance) &&
                        Eigen::MatrixXd(covariance).llt().info() == Eigen::Success;
  if (!(mean.array().abs() <= kMaxMagnitude).all() || !positive) {
    std::ostringstream text;
    text << "slot '" << name << "' needs a finite mean and a symmetric positive definite "
         << "covariance, got " << mean.transpose() << " and\n"
         << covariance;
    throw std::invalid_argument(text.str());
  }
  for (const Variable& variable : layout_->variables) {
    if (variable.name == name) {
      throw std::invalid_argument("there is a slot '" + name + "' already");
    }
  }
  const int offset = dimension();
  Layout& layout = own_layout();
  const int id = layout.next_id++;
  layout.variables.push_back({id, name, kind, offset});
  x.conservativeResize(offset + size);
  x.tail(size) = mean;
  P.grow(size);
  correlated.grow(size, Eigen::MatrixXd(size, 0), {});
  P.bottomRightCorner(size, size) = 0.5 * covariance + 0.5 * covariance.transpose();
  find_rows();
  for (const int row : angle_rows()) {
    x(row) = wrap_angle(x(row));
  }
  return {id};
}

void GaussianBelief::remove(Slot slot) {
  const auto index = static_cast<std::ptrdiff_t>(index_of(slot));
  const int start = offset(slot);
  const int size = dimension_of(kind(slot));
  const int after = dimension() - start - size;
  const Eigen::VectorXd rest = x.tail(after);
  x.segment(start, after) = rest;
  x.conservativeResize(start + after);
  P.remove(start, size);
  correlated.remove(start, size);
  Layout& layout = own_layout();
  for (auto later = layout.variables.erase(layout.variables.begin() + index);
       later != layout.variables.end(); ++later) {
    later->offset -= size;
  }
  find_rows();
}

void GaussianBelief::consider(Slot slot) {
  const std::size_t index = index_of(slot);
  own_layout().variables[index].considered = true;
  find_rows();
}

/// The layout, which no other belief shares.
GaussianBelief::Layout& GaussianBelief::own_layout() {
  if (layout_.use_count() > 1) {
    layout_ = std::make_shared<Layout>(*layout_);
  }
  return *layout_;
}

void GaussianBelief::find_rows() {
  layout_->angle_rows.clear();
  layout_->considered_rows.clear();
  layout_->variance_bounds.resize(static_cast<std::size_t>(dimension()));
  for (const Variable& variable : layout_->variables) {
    if (variable.kind == SlotKind::kPose2) {
      layout_->angle_rows.push_back(variable.offset + 2);
    }
    for (int i = 0; i < dimension_of(variable.kind); ++i) {
      const bool is_number =
          variable.kind == SlotKind::kScalar || variable.kind == SlotKind::kPoint3;
      const SigmaBounds& sigma = is_number ? kScalarBounds
                                 : i == 2  ? kHeadingBounds
                                           : kPositionBounds;
      layout_->variance_bounds[static_cast<std::size_t>(variable.offset) +
                               static_cast<std::size_t>(i)] = {sigma.min * sigma.min,
                                                               sigma.max * sigma.max};
      if (variable.considered) {
        layout_->considered_rows.push_back(variable.offset + i);
      }
    }
  }
}

Slot GaussianBelief::slot(const std::string& name) const {
  std::string known;
  for (const Variable& variable : layout_->variables) {
    if (variable.name == name) {
      return {variable.id};
    }
    known += (known.empty() ? "" : ", ") + variable.name;
  }
  throw std::invalid_argument("no slot '" + name + "'; there are: " + known);
}

std::vector<int> GaussianBelief::rows(Slots slots) const {
  std::vector<int> rows;
  for (const Slot slot : slots) {
    const int start = offset(slot);
    for (int i = 0; i < dimension_of(kind(slot)); ++i) {
      rows.push_back(start + i);
    }
  }
  return rows;
}

Eigen::VectorXd GaussianBelief::mean(Slots slots) const { return x(rows(slots)); }

Eigen::MatrixXd GaussianBelief::marginal(Slots slots) const {
  const std::vector<int> chosen = rows(slots);
  if (correlated.is_empty()) {
    return P(chosen, chosen);
  }
  return with_excess<Eigen::Dynamic>(P(chosen, chosen), correlated.excess()(chosen, chosen));
}

}  // namespace locfuse
