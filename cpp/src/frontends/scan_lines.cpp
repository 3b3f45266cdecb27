// SPDX-License-Identifier: Apache-2.0
#include "frontends/scan_lines.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "frontends/beams.hpp"
#include "frontends/line_fit.hpp"

namespace locfuse::internal {
namespace {

/// Constants of the lines through neighbouring end points; docs/models/scans.md, "Without a
/// map". Values without another source are empirical.
struct ScanLinesTuning {
  /// Distance of the end points on a line from its middle [standard deviations]: noise turns a line
  /// through n of them by 0.17 / sqrt(n) rad.
  static constexpr double kReachSigmas = 10.0;
  /// Beams to each side: at least, however far apart their ends are; at most, as all beams of a
  /// covered laser end near each other.
  static constexpr int kMinReachBeams = 2;
  static constexpr int kMaxReachBeams = 500;
  /// Maximum gap between two ends on a line: in gaps beside the end, as on a slanted wall, and in
  /// standard deviations.
  static constexpr double kGapGrowth = 2.5;
  static constexpr double kGapSigmas = 4.0;
  /// Maximum spread across a line [standard deviations], or, where that is more, the share of the
  /// variance along it; and the share that noise does not excuse.
  static constexpr double kFlatSigmas = 2.0;
  static constexpr double kFlatShare = 0.01;
  static constexpr double kMaxFlatness = 0.2;
  /// Minimum share of the variance of a range that counts across the line: grazing beams have other
  /// errors besides.
  static constexpr double kMinAcrossShare = 0.25;
};

/// Ends of beams in the order of the scan.
class Ends {
 public:
  Ends(const Beams& beams, double sigma) : beams_(beams), sigma_(sigma) {
    for (std::size_t i = 0; i + 1 < beams.x.size(); ++i) {
      gaps_.push_back((at(i + 1) - at(i)).norm());
    }
  }

  [[nodiscard]] LinePoint point(std::size_t i) const {
    const Vector<2> end = at(i);
    LinePoint point{
        end, end, Vector<2>::Zero(), sigma_ * sigma_, beams_.range[i] * beams_.step, nearer_gap(i)};
    const double limit =
        ScanLinesTuning::kGapGrowth * point.gap + ScanLinesTuning::kGapSigmas * sigma_;
    Vector<2> mean = Vector<2>::Zero();
    Matrix<2, 2> scatter = Matrix<2, 2>::Zero();
    const auto add = [&](std::size_t j) {
      const Vector<2> d = at(j) - end;
      mean += d;
      scatter += d * d.transpose();
    };
    std::size_t first = i;
    while (first > 0 && gaps_[first - 1] <= limit && near(i, first - 1)) {
      add(--first);
    }
    std::size_t last = i;
    while (last < gaps_.size() && gaps_[last] <= limit && near(i, last + 1)) {
      add(++last);
    }
    const double count = static_cast<double>(last - first + 1);
    if (count < 3.0) {
      return point;
    }
    mean /= count;
    fit(point, mean, scatter / count - mean * mean.transpose(), count);
    return point;
  }

 private:
  [[nodiscard]] Vector<2> at(std::size_t i) const { return {beams_.x[i], beams_.y[i]}; }

  [[nodiscard]] double nearer_gap(std::size_t i) const {
    constexpr double kNone = std::numeric_limits<double>::infinity();
    return std::min(i > 0 ? gaps_[i - 1] : kNone, i < gaps_.size() ? gaps_[i] : kNone);
  }

  /// Whether the end of beam j belongs to a line through that of beam i.
  [[nodiscard]] bool near(std::size_t i, std::size_t j) const {
    const std::size_t apart = i < j ? j - i : i - j;
    return apart <= ScanLinesTuning::kMinReachBeams ||
           (apart <= ScanLinesTuning::kMaxReachBeams &&
            (at(j) - at(i)).norm() < ScanLinesTuning::kReachSigmas * sigma_);
  }

  /// Fits the line through `mean` (relative to the end) along the largest spread, if there is one.
  void fit(LinePoint& point, const Vector<2>& mean, const Matrix<2, 2>& scatter,
           double count) const {
    const LineFit line = fit_line(scatter);
    const double across = line.across;
    const double noise =
        ScanLinesTuning::kFlatSigmas * ScanLinesTuning::kFlatSigmas * sigma_ * sigma_;
    if (across > std::min(std::max(noise, ScanLinesTuning::kFlatShare * line.along),
                          ScanLinesTuning::kMaxFlatness * line.along)) {
      return;
    }
    const Vector<2> normal = line.normal();
    const Vector<2> beam = point.end - beams_.laser;
    const double into = normal.dot(beam);
    point.foot += normal * normal.dot(mean);
    point.normal = into > 0.0 ? Vector<2>(-normal) : normal;
    point.variance = across > noise ? across * count / (count - 2.0)
                                    : point.variance * std::max(ScanLinesTuning::kMinAcrossShare,
                                                                into * into / beam.squaredNorm());
  }

  const Beams& beams_;
  double sigma_;
  std::vector<double> gaps_;
};

}  // namespace

std::vector<LinePoint> line_points(const LaserScan& scan, double sigma_range_m) {
  const Beams beams = beams_of(scan, 1.0);
  const Ends ends(beams, sigma_range_m);
  std::vector<LinePoint> points;
  points.reserve(beams.x.size());
  for (std::size_t i = 0; i < beams.x.size(); ++i) {
    points.push_back(ends.point(i));
  }
  return points;
}

LinePoint moved(const LinePoint& point, const Pose2& pose) {
  const Pose2 turn{0.0, 0.0, pose.heading};
  return {pose.act(point.end), pose.act(point.foot), turn.act(point.normal),
          point.variance,      point.spacing,        point.gap};
}

}  // namespace locfuse::internal
