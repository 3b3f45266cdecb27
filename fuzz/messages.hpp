// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "codec.hpp"
#include "locfuse/messages/message.hpp"

/// Byte format of messages; see codec.hpp.
namespace locfuse::fuzz {

template <class Io>
void code(Io& io, Pose2& pose, double reach) {
  code(io, pose.x, -reach, reach);
  code(io, pose.y, -reach, reach);
  code(io, pose.heading, -4.0, 4.0);
}

/// Covariance as sigmas and arbitrary correlations.
template <class Io, int N>
void code(Io& io, Matrix<N, N>& P, double largest) {
  for (int i = 0; i < N; ++i) {
    double sigma = std::sqrt(P(i, i));
    code(io, sigma, 1e-3, largest);
    P(i, i) = sigma * sigma;
  }
  std::uint8_t way = P.isDiagonal(0.0) ? 0 : 1;  // 2: not symmetric
  code(io, way, 3);
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < i; ++j) {
      const double scale = std::sqrt(P(i, i) * P(j, j));
      double correlation = P(i, j) / scale;
      if (way > 0) {
        code(io, correlation, -0.99, 0.99);
      } else {
        correlation = 0.0;
      }
      P(i, j) = P(j, i) = correlation * scale;
      if (way == 2) {
        code(io, P(j, i), -1.0, 1.0);
      }
    }
  }
}

template <class Io>
void code(Io& io, Velocity& m, Stamp& now) {
  code(io, m.stamp, now);
  code(io, m.forward, -3.0, 3.0);
  code(io, m.turn_rate, -3.0, 3.0);
}
template <class Io>
void code(Io& io, Increment& m, Stamp& now) {
  code(io, m.begin, now);
  code(io, m.stamp, now);
  code(io, m.motion, 1.0);
  code_optional(io, m.variance, [&](Vector<3>& variance) {
    for (double& one : variance) {
      code(io, one, 0.0, 1.0);
    }
  });
}
template <class Io>
void code(Io& io, Imu& m, Stamp& now) {
  code(io, m.stamp, now);
  for (double& rate : m.angular_rate) {
    code(io, rate, -10.0, 10.0);
  }
  code_optional(io, m.specific_force, [&](Vector<3>& force) {
    for (double& one : force) {
      code(io, one, -20.0, 20.0);
    }
  });
}
template <class Io>
void code(Io& io, Range& m, Stamp& now) {
  code(io, m.stamp, now);
  code(io, m.tag);
  code(io, m.anchor);
  code(io, m.range, 0.0, 50.0);
  code_optional(io, m.sigma, [&](double& sigma) { code(io, sigma, 1e-3, 10.0); });
}
template <class Io>
void code(Io& io, PositionFix& m, Stamp& now) {
  code(io, m.stamp, now);
  code(io, m.position.x(), -30.0, 30.0);
  code(io, m.position.y(), -30.0, 30.0);
  code(io, m.covariance, 10.0);
  code_optional(io, m.tag, [&](Id& tag) { code(io, tag); });
}
template <class Io>
void code(Io& io, PoseObservation& m, Stamp& now) {
  code(io, m.stamp, now);
  code(io, m.pose, 30.0);
  code(io, m.covariance, 10.0);
}
template <class Io>
void code(Io& io, Altitude& m, Stamp& now) {
  code(io, m.stamp, now);
  code(io, m.height, -10.0, 30.0);
  constexpr double kNone = 9.9;  // from here on
  double sigma = m.sigma.value_or(10.0);
  code(io, sigma, 1e-3, 10.0);
  m.sigma = sigma >= kNone ? std::nullopt : std::optional(sigma);
}
template <class Io>
void code(Io& io, Heading& m, Stamp& now) {
  code(io, m.stamp, now);
  code(io, m.heading, -10.0, 10.0);
  code_optional(io, m.sigma, [&](double& sigma) { code(io, sigma, 1e-3, 10.0); });
  code(io, m.is_course);
}
template <class Io>
void code(Io& io, RangeBearing& m, Stamp& now) {
  code(io, m.stamp, now);
  code_optional(io, m.landmark, [&](Id& id) { code(io, id); });
  code_optional(io, m.range, [&](double& range) { code(io, range, 0.0, 50.0); });
  code_optional(io, m.bearing, [&](double& bearing) { code(io, bearing, -4.0, 4.0); });
  code_optional(io, m.covariance, [&](Matrix<2, 2>& covariance) { code(io, covariance, 10.0); });
  code_optional(io, m.elevation, [&](double& angle) { code(io, angle, -1.5, 1.5); });
  code_optional(io, m.sigma_elevation, [&](double& sigma) { code(io, sigma, 1e-3, 1.0); });
}
/// Scan of up to 255 beams.
template <class Io>
void code(Io& io, LaserScan& m, Stamp& now) {
  code(io, m.stamp, now);
  bool has_geometry = m.geometry != nullptr;
  code(io, has_geometry);
  LaserGeometry geometry = m.geometry ? *m.geometry : LaserGeometry{};
  if (has_geometry) {
    code(io, geometry.pose_in_body, 1.0);
    code(io, geometry.angle_min, -4.0, 4.0);
    code(io, geometry.angle_increment, -0.2, 0.2);
    code(io, geometry.range_min, 0.0, 1.0);
    code(io, geometry.range_max, 0.0, 30.0);
    m.geometry = std::make_shared<const LaserGeometry>(geometry);
  }
  auto beams = static_cast<std::uint8_t>(m.ranges.size());
  code(io, beams, 256);
  m.ranges.resize(beams);
  for (double& range : m.ranges) {
    code(io, range, 0.0, 20.0);
  }
  bool bright = !m.intensities.empty();
  code(io, bright);
  m.intensities.resize(bright ? beams : 0);
  for (double& intensity : m.intensities) {
    code(io, intensity, 0.0, 100.0);
  }
}

/// Default-constructed message of the alternative `index`.
template <std::size_t... I>
[[nodiscard]] Message message_of(std::size_t index, std::index_sequence<I...> /*all*/) {
  Message message;
  (void)((index == I && (message.emplace<I>(), true)) || ...);
  return message;
}

/// Message of any kind.
template <class Io>
void code(Io& io, Message& message, Stamp& now) {
  constexpr std::size_t kKinds = std::variant_size_v<Message>;
  // Those that came later have bytes of their own, so that older inputs mean what they meant.
  constexpr std::size_t kFirst = 6;
  constexpr std::size_t kLater = 250;
  const std::size_t index = message.index();
  auto byte = static_cast<std::uint8_t>(index < kFirst ? index : index - kFirst + kLater);
  io.raw(&byte, 1);
  const std::size_t later = byte - kLater + kFirst;  // huge below kLater
  const std::size_t kind = byte >= kLater && later < kKinds ? later : byte % kFirst;
  if (kind != message.index()) {
    message = message_of(kind, std::make_index_sequence<kKinds>());
  }
  std::visit([&](auto& m) { code(io, m, now); }, message);
}

template <class M>
[[nodiscard]] M read(Reader& io, Stamp& now) {
  M message;
  code(io, message, now);
  return message;
}

}  // namespace locfuse::fuzz
