// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/maps/anchor_map.hpp"
#include "locfuse/maps/tags.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/math/noise_kind.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Systematic errors of the ranges to an anchor, beyond those of the map.
struct RangeErrors {
  double offset = 0.0;  ///< [m]
  double scale = 0.0;   ///< added to the anchor's
  double delay = 0.0;   ///< by which a range is older than its stamp [s]

  static constexpr int kCount = 3;
};

/// Range from a body-fixed tag to an anchor, both in 3D; the body is on the plane z = 0 or at a
/// height above it.
///
/// h(x) = scale * |anchor - (p + R(theta) tag)| + offset  [m]; docs/models/ranges.md eq. (1.1).
class RangeModel {
 public:
  /// R = sigma^2 + (sigma_relative * distance)^2 where the message has no sigma.
  struct Config {
    double sigma_m = 0.3;                    ///< [m]
    double sigma_relative = 0.0;             ///< share of the distance
    double gate = 0.999;                     ///< probability that a good one passes; 1: no gate
    NoiseKind noise = NoiseKind::kGaussian;  ///< distribution of their noise
  };

  /// Throws std::invalid_argument on negative sigmas, both zero, duplicate tags, or without a map.
  RangeModel(const Config& config, std::shared_ptr<const AnchorMap> anchors, std::vector<Tag> tags);

  /// Expected measurement [m]; empty if anchor or tag is unknown.
  [[nodiscard]] std::optional<double> predict(const Pose2& T_world_body, const Range& z) const {
    return predict(T_world_body, 0.0, z);
  }
  [[nodiscard]] std::optional<double> predict(const Pose2& T_world_body, double height,
                                              const Range& z) const;

  /// Jacobian with respect to (x, y, theta) of T_world_body, 1x3: eq. (1.3). Empty if the anchor or
  /// the tag is unknown, or the tag sits on the anchor (no direction).
  [[nodiscard]] std::optional<Linearization<1, 3>> linearize(const Pose2& T_world_body,
                                                             const Range& z) const {
    return look<3>(T_world_body, 0.0, z);
  }
  /// Jacobian with respect to (x, y, theta) and the height of the body above z = 0 [m], 1x4: eq.
  /// (1.5).
  [[nodiscard]] std::optional<Linearization<1, 4>> linearize(const Pose2& T_world_body,
                                                             double height, const Range& z) const {
    return look<4>(T_world_body, height, z);
  }

  /// Linearization with `errors`, on a body that moves by `rate` per second in its own frame:
  /// Jacobian with respect to (x, y, theta) and the errors, 1x6, eq. (1.7) and (1.8). Empty as
  /// above.
  [[nodiscard]] std::optional<Linearization<1, 3 + RangeErrors::kCount>> linearize_with_errors(
      const Pose2& T_world_body, const Range& z, const RangeErrors& errors,
      const Pose2& rate) const;

  /// Linearization for a tag that is itself a variable: Jacobian with respect to its position in
  /// the plane, 1x2, at its height in body; eq. (1.6). Empty as above.
  [[nodiscard]] std::optional<Linearization<1, 2>> linearize_point(const Vector<2>& tag_in_world,
                                                                   const Range& z) const;

  /// Linearization for an anchor and a tag whose places are variables: Jacobian with respect to (x,
  /// y, theta), the position of the anchor, and that of the tag in body (forward, left), 1x8; eq.
  /// (1.9). Empty if the tag sits on the anchor.
  [[nodiscard]] std::optional<Linearization<1, 8>> linearize_with_places(
      const Pose2& T_world_body, const Range& z, const Anchor& anchor,
      const Vector<3>& tag_in_body) const;

  [[nodiscard]] const AnchorMap& anchors() const { return *anchors_; }
  [[nodiscard]] const std::vector<Tag>& tags() const { return tags_.all(); }

 private:
  static constexpr double kMinDistance = 1e-9;  // with a direction [m]

  /// N columns: the pose, and the height if there is a fourth.
  template <int N>
  [[nodiscard]] std::optional<Linearization<1, N>> look(const Pose2& T_world_body, double height,
                                                        const Range& z) const {
    const Anchor* anchor = anchors_->find(z.anchor);
    const Tag* tag = tags_.find(z.tag);
    if (anchor == nullptr || tag == nullptr) {
      return std::nullopt;
    }
    return look<N>(T_world_body, height, z, *anchor, tag->position);
  }
  template <int N>
  [[nodiscard]] std::optional<Linearization<1, N>> look(const Pose2& T_world_body,
                                                        [[maybe_unused]] double height,
                                                        const Range& z, const Anchor& anchor,
                                                        const Vector<3>& tag) const {
    // Tag relative to the body's origin, in the axes of the world; a centred tag needs no
    // trigonometry.
    double arm_x = 0.0;
    double arm_y = 0.0;
    if (tag.x() != 0.0 || tag.y() != 0.0) {
      const double c = std::cos(T_world_body.heading);
      const double s = std::sin(T_world_body.heading);
      arm_x = c * tag.x() - s * tag.y();
      arm_y = s * tag.x() + c * tag.y();
    }
    const double dx = T_world_body.x + arm_x - anchor.position.x();
    const double dy = T_world_body.y + arm_y - anchor.position.y();
    double dz = tag.z() - anchor.position.z();
    if constexpr (N == 4) {
      dz += height;
    }
    const double distance = std::sqrt(dx * dx + dy * dy + dz * dz);
    if (distance < kMinDistance) {
      return std::nullopt;
    }
    const double slope = anchor.scale / distance;
    const double ux = slope * dx;
    const double uy = slope * dy;
    Linearization<1, N> lin;
    lin.residual(0) = z.range - (anchor.scale * distance + anchor.offset);
    lin.jacobian(0) = ux;
    lin.jacobian(1) = uy;
    lin.jacobian(2) = uy * arm_x - ux * arm_y;
    if constexpr (N == 4) {
      lin.jacobian(3) = slope * dz;
    }
    lin.noise(0) =
        z.sigma ? *z.sigma * *z.sigma : variance_ + relative_variance_ * distance * distance;
    return lin;
  }

  double variance_;
  double relative_variance_;
  std::shared_ptr<const AnchorMap> anchors_;
  Tags tags_;
};

}  // namespace locfuse
