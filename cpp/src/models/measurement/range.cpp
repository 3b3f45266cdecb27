// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/range.hpp"

#include <stdexcept>
#include <string>
#include <utility>

namespace locfuse {

RangeModel::RangeModel(const Config& config, std::shared_ptr<const AnchorMap> anchors,
                       std::vector<Tag> tags)
    : variance_(config.sigma_m * config.sigma_m),
      relative_variance_(config.sigma_relative * config.sigma_relative),
      anchors_(std::move(anchors)),
      tags_(std::move(tags)) {
  const bool sigmas_ok = config.sigma_m >= 0.0 && config.sigma_relative >= 0.0 &&
                         variance_ + relative_variance_ > 0.0 &&
                         std::isfinite(variance_ + relative_variance_);
  if (!sigmas_ok) {
    throw std::invalid_argument(
        "range.sigma_m is " + std::to_string(config.sigma_m) + " and range.sigma_relative is " +
        std::to_string(config.sigma_relative) +
        ", expected finite numbers >= 0, not both 0, their squares finite as well");
  }
  if (!anchors_) {
    throw std::invalid_argument("RangeModel needs an AnchorMap, got none");
  }
}

std::optional<double> RangeModel::predict(const Pose2& T_world_body, double height,
                                          const Range& z) const {
  const Anchor* anchor = anchors_->find(z.anchor);
  const Tag* tag = tags_.find(z.tag);
  if (anchor == nullptr || tag == nullptr) {
    return std::nullopt;
  }
  Vector<3> tag_in_world;
  tag_in_world << T_world_body.act(tag->position.head<2>()), tag->position.z() + height;
  return anchor->scale * (tag_in_world - anchor->position).norm() + anchor->offset;
}

std::optional<Linearization<1, 3 + RangeErrors::kCount>> RangeModel::linearize_with_errors(
    const Pose2& T_world_body, const Range& z, const RangeErrors& errors, const Pose2& rate) const {
  const Pose2 then = T_world_body * arc(-errors.delay * rate.x, -errors.delay * rate.y,
                                        -errors.delay * rate.heading);
  const std::optional<Linearization<1, 3>> plain = linearize(then, z);
  if (!plain) {
    return std::nullopt;
  }
  const Anchor& anchor = *anchors_->find(z.anchor);
  const double distance = (*predict(then, z) - anchor.offset) / anchor.scale;
  const Matrix<1, 3> by_then = (1.0 + errors.scale / anchor.scale) * plain->jacobian;
  const Vector<2> back = then.position() - T_world_body.position();
  const Vector<2> velocity = Pose2{0.0, 0.0, then.heading}.act({rate.x, rate.y});
  Linearization<1, 3 + RangeErrors::kCount> lin;
  lin.residual(0) = plain->residual(0) - errors.scale * distance - errors.offset;
  lin.jacobian.leftCols<3>() = by_then;
  lin.jacobian(2) += by_then(1) * back.x() - by_then(0) * back.y();
  lin.jacobian(3) = 1.0;
  lin.jacobian(4) = distance;
  lin.jacobian(5) = -by_then.dot(Vector<3>(velocity.x(), velocity.y(), rate.heading));
  lin.noise = plain->noise;
  return lin;
}

std::optional<Linearization<1, 2>> RangeModel::linearize_point(const Vector<2>& tag_in_world,
                                                               const Range& z) const {
  const Tag* tag = tags_.find(z.tag);
  if (tag == nullptr) {
    return std::nullopt;
  }
  // A body without rotation whose tag is at that position.
  const Pose2 at{tag_in_world.x() - tag->position.x(), tag_in_world.y() - tag->position.y(), 0.0};
  const std::optional<Linearization<1, 3>> lin = linearize(at, z);
  if (!lin) {
    return std::nullopt;
  }
  return Linearization<1, 2>{lin->residual, lin->jacobian.head<2>(), lin->noise};
}

std::optional<Linearization<1, 8>> RangeModel::linearize_with_places(
    const Pose2& T_world_body, const Range& z, const Anchor& anchor,
    const Vector<3>& tag_in_body) const {
  const std::optional<Linearization<1, 4>> plain =
      look<4>(T_world_body, 0.0, z, anchor, tag_in_body);
  if (!plain) {
    return std::nullopt;
  }
  const Vector<2> by_tag(plain->jacobian(0), plain->jacobian(1));  // in the axes of the world
  Linearization<1, 8> lin;
  lin.residual = plain->residual;
  lin.jacobian.leftCols<3>() = plain->jacobian.leftCols<3>();
  lin.jacobian.segment<2>(3) = -by_tag.transpose();
  lin.jacobian(5) = -plain->jacobian(3);
  lin.jacobian.segment<2>(6) = Pose2{0.0, 0.0, -T_world_body.heading}.act(by_tag).transpose();
  lin.noise = plain->noise;
  return lin;
}

}  // namespace locfuse
