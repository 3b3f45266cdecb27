// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "locfuse/smoothing/smoother.hpp"

namespace locfuse {

/// How well the place of a surveyed anchor is known.
enum class SurveyStatus : std::uint8_t {
  kPlaced,     ///< one place fits
  kTwoPlaces,  ///< its mirror image fits as well
  kNotPlaced,  ///< its ranges leave a whole curve, or most are rejected
};

/// The height of an anchor, where it is known.
struct KnownHeight {
  Id anchor = 0;
  double height_m = 0.0;
  double sigma_m = 0.0;  ///< 0: exact
};

struct SurveyConfig {
  /// Its places are those of the tags, if they are not exact. Of a landmark nothing is known.
  SmootherConfig smoother;
  /// Anchors without one are found in space, above the tags: below them they would fit as well.
  std::vector<KnownHeight> heights = {};
};

/// An anchor that ranges name.
struct SurveyedAnchor {
  Anchor anchor;  ///< in the frame of the start; its place means nothing if it is kNotPlaced
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();  ///< of its place [m^2]
  SurveyStatus status = SurveyStatus::kNotPlaced;
  int ranges = 0;                  ///< to it, from the start on
  int rejected = 0;                ///< of those, that are judged wrong
  std::optional<Vector<3>> other;  ///< of kTwoPlaces the other one
};

/// Where anchors and landmarks are.
struct Survey {
  Smoothed smoothed;                    ///< the drive, among the anchors and landmarks placed
  std::vector<SurveyedAnchor> anchors;  ///< by id
};

/// Receives the share of a survey that is done, 0 to 1.
using SurveyProgress = std::function<void(double)>;

/// Finds where anchors and landmarks are from one drive among them: ranges and odometry; sightings
/// by name, positions and poses as far as there are. Nothing needs to be known of their places; of
/// the anchors of the world offset and scale are used, and its tags. docs/survey.md.
///
/// Throws std::invalid_argument as `smooth` does, and where no range or sighting names anything;
/// NumericalError as `smooth`.
[[nodiscard]] Survey survey(const SurveyConfig& config, const World& world,
                            const PoseEstimate& start, const std::vector<Message>& messages,
                            const SurveyProgress& progress = {});

}  // namespace locfuse
