// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/cylinder_detector.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include "frontends/circle_fit.hpp"
#include "frontends/closest_beam.hpp"
#include "locfuse/math/angle.hpp"
#include "locfuse/math/chi_squared.hpp"
#include "math/refuse.hpp"

namespace locfuse {
namespace {

using internal::BeamNoise;
using internal::Circle;
using internal::CircleFit;
using internal::cross;
using internal::Jump;
using internal::Ray;
using internal::Run;
using internal::Sweep;

/// Constants of CylinderDetector; docs/models/landmarks.md. Values without another source are
/// empirical.
struct CylinderDetectorTuning {
  // Limits.
  /// Maximum number of beams; at worst the time grows with its square.
  static constexpr std::size_t kMaxBeams = 100'000;
  /// Degrees of freedom up to which chi-square gates are tabulated.
  static constexpr int kGates = 256;

  // Pieces.
  /// Depth step between two objects, beside the configured gaps [standard deviations].
  static constexpr double kJumpSigmas = 6.0;
  /// Distance from the chord at which a piece is cut [standard deviations].
  static constexpr double kChordSigmas = 4.0;

  // Sparse runs: the bearing follows from which beams hit.
  /// Maximum number of beams of such a run.
  static constexpr int kMaxSparseBeams = 3;
  /// Half the angle of a circle below which its runs count as such [beams].
  static constexpr double kSparseHalfWidth = 2.0;

  // Start of the fit.
  /// Runs that are longer than a known radius by this many gaps between beams are walls.
  static constexpr double kChordGaps = 2.0;
  /// Minimum height over the chord as a share of that of a cylinder of the known radius.
  static constexpr double kMinHeightShare = 0.4;
  /// Maximum radius of the algebraic start [radius_max_m].
  static constexpr double kMaxStartRadii = 3.0;
  /// Maximum angle that a start from few beams fills [rad].
  static constexpr double kMaxStartAngle = 1.0;

  // Growth of an arc.
  static constexpr int kMaxRounds = 8;
  /// Maximum number of beams without return that an arc may continue behind.
  static constexpr int kMaxGapBeams = 3;
  /// Squared deviation of one beam of an arc [variances]: four standard deviations.
  static constexpr double kBeamGate = 16.0;
  /// Beams farther from the centre than this do not extend an arc [radii].
  static constexpr double kGrowRadii = 0.98;

  // Evidence.
  /// Distance beyond the tangent point, from where no beam returns [standard deviations].
  static constexpr double kBehindSigmas = 4.0;
  /// Chi-square by which two lines at any angle fit better, as they also fit part of the noise.
  static constexpr double kAnyCornerMargin = 12.0;
  /// Chi-square by which a line must fit worse, if the piece is not isolated.
  static constexpr double kMinShapeEvidence = 25.0;
  /// Evidence of an isolated piece: a share of the expected one, minus a slack [chi-square].
  static constexpr double kAloneShare = 0.25;
  static constexpr double kAloneSlack = 4.0;
  /// Error of the width of an arc [beams], and that of an arc of bright beams.
  static constexpr double kBlur = 1.0;
  static constexpr double kBrightBlur = 3.0;
  /// A beam this close to the centre [radii] passes through the circle; margins beside it
  /// [standard deviations of range and bearing].
  static constexpr double kThroughRadii = 0.9;
  static constexpr double kThroughSigmas = 3.0;
  static constexpr double kThroughBearingSigmas = 2.0;

  // Cones.
  /// Beams beside a cone that must not end as far as its cylinder.
  static constexpr int kBeamsBeside = 2;
  /// Margin between them and the cone [standard deviations of its bearing], and of their ranges.
  static constexpr double kBesideSigmas = 3.0;
  static constexpr double kBesideRangeSigmas = 6.0;
  /// Where the centre lies between two beams: by two points the mean square is that of all places.
  static constexpr double kBetweenBeams = 0.288675134594813;  // 1 / sqrt(12)
};

[[noreturn]] void refuse(const char* what, double value, const std::string& expected) {
  internal::refuse(std::string("CylinderDetectorConfig.") + what, value, expected);
}

void require(const char* what, double value, double min) {
  constexpr double kMax = 1e9;  // its square is finite
  if (!(value >= min && value <= kMax)) {
    std::ostringstream expected;
    expected << "a number >= " << min << " and <= " << kMax;
    refuse(what, value, expected.str());
  }
}

void require_unused(const char* what, double value, double unused) {
  if (value != unused) {
    std::ostringstream expected;
    expected << unused << ", as method cone does not use it: leave it out, or use another method";
    refuse(what, value, expected.str());
  }
}

CylinderDetectorConfig checked(const CylinderDetectorConfig& config) {
  require("sigma_range_m", config.sigma_range_m, 1e-6);
  require("sigma_bearing_rad", config.sigma_bearing_rad, 0.0);
  require("radius_m", config.radius_m, 0.0);
  require("radius_min_m", config.radius_min_m, 1e-3);
  require("radius_max_m", config.radius_max_m, config.radius_min_m);
  require("least_beams", config.least_beams, 1.0);
  require("jump_gaps", config.jump_gaps, 1.0);
  require("least_evidence", config.least_evidence, 0.0);
  require("least_corner_evidence", config.least_corner_evidence, -1e9);
  require("leg_radius_m", config.leg_radius_m, 0.0);
  require("leg_distance_m", config.leg_distance_m, 0.0);
  require("least_intensity", config.least_intensity, 0.0);
  if (!(config.misfit_probability > 0.0 && config.misfit_probability < 1.0)) {
    refuse("misfit_probability", config.misfit_probability, "a probability between 0 and 1");
  }
  if (config.method != CylinderMethod::kArcs && config.radius_m == 0.0) {
    refuse("radius_m", 0.0, "> 0, as a single beam does not determine the radius: use method arcs");
  }
  if (config.method == CylinderMethod::kCone) {
    const CylinderDetectorConfig d;
    require_unused("least_evidence", config.least_evidence, d.least_evidence);
    require_unused("least_corner_evidence", config.least_corner_evidence, d.least_corner_evidence);
    require_unused("leg_distance_m", config.leg_distance_m, d.leg_distance_m);
  }
  return config;
}

Jump jump_of(const CylinderDetectorConfig& config) {
  return {CylinderDetectorTuning::kJumpSigmas * config.sigma_range_m, config.jump_gaps};
}

/// Half the angle that a circle fills, seen from the laser.
double half_angle(const Circle& circle) {
  return std::asin(std::min(circle.radius / circle.centre.norm(), 1.0));
}

Vector<2> centre_of(const Cylinder& cylinder) {
  return cylinder.range * Vector<2>(std::cos(cylinder.bearing), std::sin(cylinder.bearing));
}

double distance_between(const Cylinder& a, const Cylinder& b) {
  return (centre_of(a) - centre_of(b)).norm();
}

/// One pass over one scan.
class Search {
 public:
  Search(const CylinderDetectorConfig& config, const std::vector<double>& gates, const Sweep& sweep)
      : config_(config),
        gates_(gates),
        sweep_(sweep),
        noise_{config.sigma_range_m, config.sigma_bearing_rad, sweep.step},
        radius_known_(config.radius_m > 0.0),
        only_bright_(config.least_intensity > 0.0),
        begin_(-sweep.size()),
        end_(2 * sweep.size()) {}

  /// Cylinders, and in `thin` the centres of all pieces as thin as a leg, if legs are expected.
  std::vector<Cylinder> cylinders(std::vector<Vector<2>>& thin) {
    const Jump jump = jump_of(config_);
    int first = 0;
    for (int j = 0; j < sweep_.size(); ++j) {
      if (j + 1 == sweep_.size() || is_edge(sweep_, j, jump)) {
        split({first, j});
        if (config_.leg_distance_m > 0.0 && is_thin({first, j})) {
          thin.push_back(0.5 * (sweep_[first].end() + sweep_[j].end()));
        }
        first = j + 1;
      }
    }
    return std::move(found_);
  }

  /// The shortest beam of each cone that stands free.
  std::vector<Cylinder> cones() {
    for (int j = 0; j < sweep_.size(); ++j) {
      if (const std::optional<Cylinder> cylinder = cone_at(j)) {
        add(*cylinder);
      }
    }
    return std::move(found_);
  }

 private:
  struct Farthest {  // point of a run from its chord
    int at;
    double behind;  // [m], negative in front of it
  };

  void split(const Run& run);
  void cut(const Run& whole, int& begin);
  [[nodiscard]] Farthest farthest_of(const Run& run) const;
  void consider(Run run);
  void add(const Cylinder& cylinder);

  [[nodiscard]] std::optional<CircleFit> fit_grown(Run& run) const;
  [[nodiscard]] std::optional<CircleFit> fit(const Run& run, const Circle& from) const;
  [[nodiscard]] bool may_be_one(const Run& run) const;
  [[nodiscard]] std::optional<Circle> start(const Run& run) const;
  [[nodiscard]] bool trim(Run& run, const Circle& circle) const;
  [[nodiscard]] bool grow(Run& run, const Circle& circle) const;
  [[nodiscard]] bool grow(int& end, int side, const Circle& circle) const;

  [[nodiscard]] bool is_cylinder(const Run& run, const CircleFit& fit) const;
  [[nodiscard]] bool passes_gate(const CircleFit& fit) const;
  [[nodiscard]] bool is_alone(const Run& run, const CircleFit& fit) const;
  [[nodiscard]] bool is_as_wide(const Run& run, const CircleFit& fit) const;
  [[nodiscard]] double expected_evidence(const Run& run, const CircleFit& fit) const;
  [[nodiscard]] bool stands_out(const Run& run, const CircleFit& fit) const;
  [[nodiscard]] bool seen_through(int end, int side, const Circle& circle) const;
  [[nodiscard]] bool is_positive(const Matrix<3, 3>& covariance) const;
  [[nodiscard]] Cylinder to_cylinder(const Run& run, const CircleFit& fit) const;
  [[nodiscard]] Cylinder by_closest_beam(const Run& run, const CircleFit& fit) const;
  [[nodiscard]] std::optional<Cylinder> cone_at(int j) const;
  [[nodiscard]] bool goes_on(int j, int reach, double from, double to) const;
  [[nodiscard]] bool ends_behind(const Run& run, const Circle& circle) const;
  [[nodiscard]] bool is_thin(const Run& run) const;
  [[nodiscard]] int returns(const Run& run) const;

  const CylinderDetectorConfig& config_;
  const std::vector<double>& gates_;
  const Sweep& sweep_;
  BeamNoise noise_;
  bool radius_known_;
  bool only_bright_;
  int begin_;  // beams before it are on cylinders that were found
  int end_;    // beams from here on belong to the first cylinder, around a full turn
  std::vector<Cylinder> found_;
};

/// Cuts what lies between two edges where it lies behind its chord, as in the corner between a wall
/// and a cylinder in front of it. The remaining pieces are convex.
void Search::split(const Run& run) {
  if (sweep_[run.first].returned() && (!only_bright_ || sweep_[run.first].bright)) {
    int begin = run.first;
    cut(run, begin);
    consider({begin, run.last});
  }
}

/// Part by part in order, without recursion, as there may be as many parts as beams.
void Search::cut(const Run& whole, int& begin) {
  struct Part {
    Run run;
    bool behind_corner;
  };
  std::vector<Part> left{{whole, false}};  // the next one last
  while (!left.empty()) {
    const auto [run, behind_corner] = left.back();
    left.pop_back();
    if (behind_corner) {
      consider({begin, run.first - 1});  // the corner may lie on either; the arc grows if it fits
      begin = run.first + 1;
    }
    const Farthest farthest = farthest_of(run);
    if (std::abs(farthest.behind) >= CylinderDetectorTuning::kChordSigmas * noise_.range) {
      left.push_back({{farthest.at, run.last}, farthest.behind > 0.0});
      left.push_back({{run.first, farthest.at}, false});
    }
  }
}

Search::Farthest Search::farthest_of(const Run& run) const {
  const Vector<2> a = sweep_[run.first].end();
  const Vector<2> chord = (sweep_[run.last].end() - a).normalized();
  Farthest farthest{run.first, 0.0};
  for (int j = run.first + 1; j < run.last; ++j) {
    const double behind = cross(sweep_[j].end() - a, chord);
    if (std::abs(behind) > std::abs(farthest.behind)) {
      farthest = {j, behind};
    }
  }
  return farthest;
}

void Search::consider(Run run) {
  run.first = std::max(run.first, begin_);
  run.last = std::min(run.last, end_ - 1);
  if (run.beams() < std::min(config_.least_beams, CylinderDetectorTuning::kMaxSparseBeams)) {
    return;
  }
  const std::optional<CircleFit> fit = fit_grown(run);
  if (!fit || !fit->covariance.allFinite() || !is_cylinder(run, *fit)) {
    return;
  }
  const Cylinder cylinder = config_.method == CylinderMethod::kClosestBeam
                                ? by_closest_beam(run, *fit)
                                : to_cylinder(run, *fit);
  if (is_positive(cylinder.covariance)) {
    add(cylinder);
    begin_ = run.last + 1;
    end_ = std::min(end_, run.first + sweep_.size());
  }
}

/// Two cylinders that overlap are one that an outlier cut in two.
void Search::add(const Cylinder& cylinder) {
  for (Cylinder& other : found_) {
    if (distance_between(cylinder, other) < std::max(cylinder.radius, other.radius)) {
      other = cylinder.beams > other.beams ? cylinder : other;
      return;
    }
  }
  found_.push_back(cylinder);
}

/// Fits, drops ends that are off the circle, adds neighbours that are on it, and repeats.
std::optional<CircleFit> Search::fit_grown(Run& run) const {
  std::optional<Circle> from = start(run);
  std::optional<CircleFit> found = from ? fit(run, *from) : std::nullopt;
  for (int k = 0; k < CylinderDetectorTuning::kMaxRounds && found; ++k) {
    const Circle circle = found->circle;
    if (!trim(run, circle) && !grow(run, circle)) {
      break;
    }
    found = returns(run) < std::min(config_.least_beams, CylinderDetectorTuning::kMaxSparseBeams)
                ? std::nullopt
                : fit(run, circle);
  }
  return found;
}

std::optional<CircleFit> Search::fit(const Run& run, const Circle& from) const {
  if (radius_known_ &&
      (run.beams() <= CylinderDetectorTuning::kMaxSparseBeams ||
       half_angle(from) < CylinderDetectorTuning::kSparseHalfWidth * sweep_.step)) {
    return fit_few(sweep_, run, config_.radius_m, noise_);
  }
  return fit_circle(sweep_, run, from, radius_known_, noise_);
}

/// Whether a run may be a cylinder of the known radius, by its length and its height over the
/// chord. Excludes walls without a fit.
bool Search::may_be_one(const Run& run) const {
  const double R = config_.radius_m;
  const Vector<2> a = sweep_[run.first].end();
  const Vector<2> chord = sweep_[run.last].end() - a;
  const double half = 0.5 * chord.norm();
  const double slack = CylinderDetectorTuning::kChordSigmas * noise_.range +
                       CylinderDetectorTuning::kChordGaps * sweep_.step * sweep_[run.first].range;
  if (half > R + slack) {
    return false;
  }
  const double height = R - std::sqrt(std::max(R * R - half * half, 0.0));
  const Vector<2> middle = sweep_[(run.first + run.last) / 2].end() - a;
  return run.beams() <= CylinderDetectorTuning::kMaxSparseBeams ||
         cross(chord, middle) / (2.0 * half) >
             CylinderDetectorTuning::kMinHeightShare * height - slack;
}

std::optional<Circle> Search::start(const Run& run) const {
  if (radius_known_) {
    return may_be_one(run) ? std::optional<Circle>(circle_behind(sweep_, run, config_.radius_m))
                           : std::nullopt;
  }
  const Ray& middle = sweep_[(run.first + run.last) / 2];
  if (run.beams() > CylinderDetectorTuning::kMaxSparseBeams) {
    std::optional<Circle> circle = algebraic_circle(sweep_, run);
    const bool bulges = circle && middle.returned() && !passes(middle, *circle, 0.0);
    if (bulges && circle->radius < CylinderDetectorTuning::kMaxStartRadii * config_.radius_max_m) {
      return circle;
    }
    if (config_.least_evidence > 0.0) {
      return std::nullopt;  // flat or hollow
    }
  }
  const double width = std::min(run.beams() * sweep_.step, CylinderDetectorTuning::kMaxStartAngle);
  const double range = sweep_[run.first].range;
  return circle_behind(sweep_, run, range * std::sin(0.5 * width));
}

bool Search::trim(Run& run, const Circle& circle) const {
  const auto worst = [&](int j) {
    const internal::Offset offset = offset_of(sweep_[j], circle, noise_);
    return offset.distance * offset.distance / offset.variance;
  };
  if (run.beams() <= CylinderDetectorTuning::kMaxSparseBeams) {
    return false;
  }
  const double first = worst(run.first);
  const double last = worst(run.last);
  if (std::max(first, last) <= CylinderDetectorTuning::kBeamGate) {
    return false;
  }
  int& end = first > last ? run.first : run.last;
  do {
    end += first > last ? 1 : -1;
  } while (!sweep_[end].returned());
  return true;
}

bool Search::grow(Run& run, const Circle& circle) const {
  const bool down = grow(run.first, -1, circle);
  const bool up = grow(run.last, 1, circle);
  return down || up;
}

bool Search::grow(int& end, int side, const Circle& circle) const {
  const int from = end;
  for (int j = end + side; std::abs(j - end) <= CylinderDetectorTuning::kMaxGapBeams + 1;
       j += side) {
    if (!sweep_.has(j) || j < begin_ || j >= end_ ||
        std::abs(cross(sweep_[j].along, circle.centre)) >
            CylinderDetectorTuning::kGrowRadii * circle.radius) {
      break;
    }
    if (sweep_[j].returned()) {
      const internal::Offset offset = offset_of(sweep_[j], circle, noise_);
      if (offset.distance * offset.distance > CylinderDetectorTuning::kBeamGate * offset.variance) {
        break;
      }
      end = j;
    }
  }
  return end != from;
}

bool Search::is_cylinder(const Run& run, const CircleFit& fit) const {
  if (returns(run) < config_.least_beams) {
    return false;
  }
  if (!passes_gate(fit)) {
    return false;
  }
  const double radius = fit.circle.radius;
  if (!radius_known_ && (radius < config_.radius_min_m || radius > config_.radius_max_m)) {
    return false;
  }
  if (only_bright_) {
    return is_as_wide(run, fit);
  }
  return !seen_through(run.first, -1, fit.circle) && !seen_through(run.last, 1, fit.circle) &&
         !ends_behind(run, fit.circle) && stands_out(run, fit);
}

bool Search::passes_gate(const CircleFit& fit) const {
  if (fit.dof == 0) {
    return true;
  }
  const int known = std::min(fit.dof, CylinderDetectorTuning::kGates - 1);
  return fit.misfit <= gates_[static_cast<std::size_t>(known)] * fit.dof / known;
}

/// Whether a straight wall, or two that meet, fit clearly worse.
bool Search::stands_out(const Run& run, const CircleFit& fit) const {
  if (run.beams() <= CylinderDetectorTuning::kMaxSparseBeams) {
    return is_alone(run, fit);
  }
  const internal::Corner corner = best_corner(sweep_, run, noise_);
  if (corner.right < fit.misfit + config_.least_corner_evidence ||
      corner.any < fit.misfit - CylinderDetectorTuning::kAnyCornerMargin) {
    return false;
  }
  const double evidence = line_misfit(sweep_, run, noise_) - fit.misfit;
  return evidence >= std::max(config_.least_evidence, CylinderDetectorTuning::kMinShapeEvidence) ||
         (evidence > CylinderDetectorTuning::kAloneShare * expected_evidence(run, fit) -
                         CylinderDetectorTuning::kAloneSlack &&
          is_alone(run, fit));
}

/// Whether the arc has as many beams as a cylinder of this radius.
bool Search::is_as_wide(const Run& run, const CircleFit& fit) const {
  const double width = 2.0 * half_angle(fit.circle) / sweep_.step;
  const double blur =
      2.0 * noise_.bearing / sweep_.step +
      (only_bright_ ? CylinderDetectorTuning::kBrightBlur : CylinderDetectorTuning::kBlur);
  return !radius_known_ || (run.beams() - 1 <= width + blur && run.beams() + 1 >= width - blur);
}

/// Whether the piece is isolated and of the right width, for arcs too short to judge by shape.
bool Search::is_alone(const Run& run, const CircleFit& fit) const {
  return fit.free_first && fit.free_last && is_as_wide(run, fit) &&
         (radius_known_ || config_.least_evidence == 0.0);
}

/// Expected chi-square by which a line fits worse than a cylinder: its residual is 4/45 of the
/// squared height of an arc.
double Search::expected_evidence(const Run& run, const CircleFit& fit) const {
  const double radius = fit.circle.radius;
  const double half = std::min(0.5 * run.beams() * sweep_.step * fit.circle.centre.norm(), radius);
  const double height = radius - std::sqrt(radius * radius - half * half);
  return run.beams() * 4.0 / 45.0 * height * height / (noise_.range * noise_.range);
}

/// Whether a beam beside the end of an arc passed through the circle.
bool Search::seen_through(int end, int side, const Circle& circle) const {
  const double reach = half_angle(circle) / sweep_.step;
  const double slack =
      circle.centre.norm() *
          (0.5 * sweep_.step + CylinderDetectorTuning::kThroughBearingSigmas * noise_.bearing) +
      CylinderDetectorTuning::kThroughSigmas * noise_.range;
  for (int k = 1; k <= 2.0 * reach && sweep_.has(end + side * k); ++k) {
    const Ray& ray = sweep_[end + side * k];
    if (std::abs(cross(ray.along, circle.centre)) >
        CylinderDetectorTuning::kThroughRadii * circle.radius - slack) {
      return false;
    }
    if (ray.returned() &&
        passes(ray, circle, CylinderDetectorTuning::kThroughSigmas * noise_.range)) {
      return true;
    }
  }
  return false;
}

/// Whether a beam of the arc came back from behind its tangent point. Not tested for a given
/// radius, which may be rough, and the tangent point with it.
bool Search::ends_behind(const Run& run, const Circle& circle) const {
  if (radius_known_ || run.beams() <= CylinderDetectorTuning::kMaxSparseBeams) {
    return false;
  }
  const double touches =
      std::sqrt(std::max(circle.centre.squaredNorm() - circle.radius * circle.radius, 0.0));
  for (int j = run.first; j <= run.last; ++j) {
    if (sweep_[j].returned() &&
        sweep_[j].range > touches + CylinderDetectorTuning::kBehindSigmas * noise_.range) {
      return true;
    }
  }
  return false;
}

bool Search::is_thin(const Run& run) const {
  const double gap = sweep_.step * sweep_[run.first].range;
  return sweep_[run.first].returned() && (sweep_[run.first].end() - sweep_[run.last].end()).norm() <
                                             2.0 * config_.leg_radius_m + gap;
}

int Search::returns(const Run& run) const {
  int count = 0;
  for (int j = run.first; j <= run.last; ++j) {
    count += sweep_[j].returned() ? 1 : 0;
  }
  return count;
}

/// Whether a covariance is positive definite; without the row of a known radius, which is 0.
bool Search::is_positive(const Matrix<3, 3>& covariance) const {
  const auto positive = [](const auto& P) { return P.llt().info() == Eigen::Success; };
  return covariance.allFinite() &&
         (radius_known_ ? positive(covariance.topLeftCorner<2, 2>()) : positive(covariance));
}

Cylinder Search::to_cylinder(const Run& run, const CircleFit& fit) const {
  const Vector<2>& c = fit.circle.centre;
  const double range = c.norm();
  Matrix<3, 3> to_polar = Matrix<3, 3>::Identity();
  to_polar.topLeftCorner<2, 2>() << c.x() / range, c.y() / range, -c.y() / (range * range),
      c.x() / (range * range);
  const Matrix<3, 3> P = to_polar * fit.covariance * to_polar.transpose();
  Cylinder cylinder;
  cylinder.range = range;
  cylinder.bearing = wrap_angle(std::atan2(c.y(), c.x()));
  cylinder.radius = fit.circle.radius;
  cylinder.covariance = 0.5 * (P + P.transpose());
  cylinder.first = sweep_[run.first].beam;
  cylinder.last = sweep_[run.last].beam;
  cylinder.beams = returns(run);
  cylinder.misfit = fit.dof > 0 ? fit.misfit / fit.dof : 0.0;
  return cylinder;
}

/// The centre by the shortest beam, with its error about the fitted circle at the two bearings that
/// stand for the fit's: docs/models/landmarks.md eq. (5.7) and (5.9).
Cylinder Search::by_closest_beam(const Run& run, const CircleFit& fit) const {
  Cylinder cylinder = to_cylinder(run, fit);
  const double distance = cylinder.range;
  const double sigma = std::sqrt(cylinder.covariance(1, 1));
  const Ray* nearest = &sweep_[run.first];
  std::vector<double> left;
  std::vector<double> right;
  for (int j = run.first; j <= run.last; ++j) {
    const Ray& ray = sweep_[j];
    if (ray.returned()) {
      nearest = ray.range < nearest->range ? &ray : nearest;
      const double offset =
          std::asin(std::clamp(cross(fit.circle.centre, ray.along) / distance, -1.0, 1.0));
      left.push_back(offset - sigma);
      right.push_back(offset + sigma);
    }
  }
  cylinder.range = nearest->range + config_.radius_m;
  cylinder.bearing = std::atan2(nearest->along.y(), nearest->along.x());
  const double of_fit = cylinder.covariance(0, 0);
  cylinder.covariance.topLeftCorner<2, 2>() =
      0.5 * (closest_beam_error(distance, config_.radius_m, left, noise_) +
             closest_beam_error(distance, config_.radius_m, right, noise_));
  cylinder.covariance(0, 0) += of_fit;
  return cylinder;
}

/// Whether one of the beams beyond `reach` ends between two ranges, on either side.
bool Search::goes_on(int j, int reach, double from, double to) const {
  for (int k = reach + 1; k <= reach + CylinderDetectorTuning::kBeamsBeside; ++k) {
    for (const int at : {j - k, j + k}) {
      if (sweep_.has(at) && sweep_[at].returned() && sweep_[at].range >= from &&
          sweep_[at].range <= to) {
        return true;
      }
    }
  }
  return false;
}

/// Cylinder whose shortest beam is `j`: no other in the cone of the cylinder behind it is shorter,
/// enough end as far as its surface, and those beside the cone do not. The cone must be in view.
std::optional<Cylinder> Search::cone_at(int j) const {
  const Ray& nearest = sweep_[j];
  if (!nearest.returned()) {
    return std::nullopt;
  }
  Cylinder cylinder;
  cylinder.range = nearest.range + config_.radius_m;
  cylinder.radius = config_.radius_m;
  const internal::Cone cone = internal::cone_of(cylinder.range, config_.radius_m);
  const int reach = static_cast<int>(cone.half_angle / sweep_.step);
  if (!sweep_.has(j - reach) || !sweep_.has(j + reach)) {
    return std::nullopt;
  }
  Run hits{j, j};
  bool bright = false;
  std::vector<double> offsets;
  for (int i = j - reach; i <= j + reach; ++i) {
    const Ray& ray = sweep_[i];
    if (ray.range < nearest.range || (ray.range == nearest.range && i < j)) {
      return std::nullopt;
    }
    if (ray.range <= cone.max_range) {
      hits = {std::min(hits.first, i), i};
      bright = bright || ray.bright;
      ++cylinder.beams;
    }
    offsets.push_back((i - j + CylinderDetectorTuning::kBetweenBeams) * sweep_.step);
  }
  if (cylinder.beams < config_.least_beams || (only_bright_ && !bright)) {
    return std::nullopt;
  }
  // Between beams on either side of the centre the two are not correlated.
  cylinder.covariance.diagonal().head<2>() =
      closest_beam_error(cylinder.range, config_.radius_m, offsets, noise_).diagonal();
  const double margin =
      CylinderDetectorTuning::kBesideSigmas * std::sqrt(cylinder.covariance(1, 1));
  if (goes_on(j, reach + static_cast<int>(std::ceil(std::min(margin, kPi) / sweep_.step)),
              nearest.range,
              cone.max_range + CylinderDetectorTuning::kBesideRangeSigmas * noise_.range) ||
      !is_positive(cylinder.covariance)) {
    return std::nullopt;
  }
  cylinder.bearing = std::atan2(nearest.along.y(), nearest.along.x());
  cylinder.first = sweep_[hits.first].beam;
  cylinder.last = sweep_[hits.last].beam;
  return cylinder;
}

/// Removes thin cylinders next to each other or to another thin piece: legs of people.
void remove_legs(std::vector<Cylinder>& cylinders, std::vector<Vector<2>> thin,
                 const CylinderDetectorConfig& config) {
  for (const Cylinder& one : cylinders) {
    if (one.radius <= config.leg_radius_m) {
      thin.push_back(centre_of(one));
    }
  }
  const auto is_another = [&](const Cylinder& one, const Vector<2>& place) {
    const Vector<2> centre = centre_of(one);
    const double aside = std::abs(cross(centre, place)) / centre.norm();
    return aside > one.radius && (place - centre).norm() < config.leg_distance_m;
  };
  std::vector<bool> is_leg(cylinders.size(), false);
  for (std::size_t i = 0; i < cylinders.size(); ++i) {
    const Cylinder& one = cylinders[i];
    is_leg[i] = one.radius <= config.leg_radius_m &&
                std::any_of(thin.begin(), thin.end(),
                            [&](const Vector<2>& place) { return is_another(one, place); });
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cylinders.size(); ++i) {
    if (!is_leg[i]) {
      cylinders[kept++] = cylinders[i];
    }
  }
  cylinders.resize(kept);
}

}  // namespace

CylinderDetector::CylinderDetector(const CylinderDetectorConfig& config)
    : config_(checked(config)) {
  gates_.push_back(0.0);
  for (int dof = 1; dof < CylinderDetectorTuning::kGates; ++dof) {
    gates_.push_back(chi_squared_quantile(dof, config_.misfit_probability));
  }
}

std::vector<Cylinder> CylinderDetector::detect(const LaserScan& scan) const {
  if (config_.least_intensity > 0.0 && scan.intensities.empty() && !scan.ranges.empty()) {
    throw std::invalid_argument(
        "LaserScan.intensities is empty, expected one per beam as "
        "CylinderDetectorConfig.least_intensity is above 0");
  }
  if (scan.ranges.size() > CylinderDetectorTuning::kMaxBeams) {
    throw std::invalid_argument("LaserScan.ranges has " + std::to_string(scan.ranges.size()) +
                                " beams, expected at most " +
                                std::to_string(CylinderDetectorTuning::kMaxBeams));
  }
  const Sweep sweep = sweep_of(scan, config_.least_intensity, jump_of(config_));
  std::vector<Vector<2>> thin;
  Search search(config_, gates_, sweep);
  std::vector<Cylinder> cylinders =
      config_.method == CylinderMethod::kCone ? search.cones() : search.cylinders(thin);
  if (config_.leg_distance_m > 0.0) {
    remove_legs(cylinders, std::move(thin), config_);
  }
  std::sort(cylinders.begin(), cylinders.end(),
            [](const Cylinder& a, const Cylinder& b) { return a.first < b.first; });
  return cylinders;
}

}  // namespace locfuse
