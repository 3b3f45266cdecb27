// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "settings.hpp"

namespace {

using namespace locfuse;

void require_sound(const fuzz::Reader& io, const ScanMatch& match) {
  fuzz::require(match.pose.position().allFinite() && std::isfinite(match.pose.heading),
                "a matched pose is finite");
  if (match.converged) {
    fuzz::require(match.information.allFinite(), "information is finite");
    fuzz::require(match.explained >= 0.0 && match.explained <= 1.0, "a fraction is in [0, 1]");
    if (match.covariance) {
      fuzz::require_covariance(io, *match.covariance);
    }
  }
}

}  // namespace

/// Scan matching on a map, scan search and laser odometry with arbitrary settings.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ScanMatcher usual(fuzz::small_room());
  fuzz::Reader io(data, size);
  ScanMatcherConfig matching;
  ScanOdometryConfig driving;
  const bool as_usual = fuzz::read_if_unusual(io, matching, driving);
  std::optional<ScanMatcher> unusual;
  std::optional<ScanOdometry> made;
  if (!fuzz::returns([&] {
        made.emplace(driving);
        if (!as_usual) {
          unusual.emplace(fuzz::small_room(), matching);
        }
      })) {
    return 0;
  }
  const ScanMatcher& matcher = unusual ? *unusual : usual;
  ScanOdometry& odometry = *made;
  Stamp now = 0;
  for (int calls = 0; !io.empty() && calls < 6; ++calls) {
    std::uint8_t call = 0;
    code(io, call, 5);
    Pose2 pose;
    code(io, pose, 5.0);
    Matrix<3, 3> covariance = Matrix<3, 3>::Zero();
    code(io, covariance, 1.0);
    const auto scan = fuzz::read<LaserScan>(io, now);
    fuzz::returns([&] {
      if (call == 0) {
        require_sound(io, matcher.refine(scan, pose));
      } else if (call == 1) {
        require_sound(io, matcher.refine(scan, pose, covariance));
      } else if (call == 2) {
        double total = 0.0;
        for (const ScanHypothesis& found :
             matcher.search(scan, pose.position(), covariance.topLeftCorner<2, 2>()).hypotheses) {
          require_sound(io, found.match);
          total += found.probability;
        }
        fuzz::require(total <= 1.0 + 1e-9, "probabilities sum to at most 1");
      } else {
        const ScanMotion motion = odometry.on(scan, pose, covariance);
        require_sound(io, motion.match);
        validate(motion.increment);
        fuzz::require(motion.covariance.allFinite(), "the covariance of a motion is finite");
      }
    });
  }
  return 0;
}
