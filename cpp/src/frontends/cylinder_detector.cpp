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
#include "locfuse/math/angle.hpp"
#include "locfuse/math/chi_squared.hpp"

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

constexpr std::size_t kMostBeams = 100'000;  // at worst the time grows with their square
constexpr int kGates = 256;
constexpr int kFew = 3;             // beams up to which the bearing comes from which of them hit
constexpr int kLargestGap = 3;      // beams without return that an arc may go on behind
constexpr double kBeamGate = 16.0;  // four sigma squared, of one beam on an arc
// A beam cannot come back from behind the point where it would touch the circle; so many sigma off.
constexpr double kBehind = 4.0;
// Two lines at any angle can always take some of the noise with them, this much at most.
constexpr double kBluntMargin = 12.0;

[[noreturn]] void refuse(const char* what, double value, const std::string& expected) {
  std::ostringstream text;
  text << "CylinderDetectorConfig." << what << " is " << value << ", expected " << expected;
  throw std::invalid_argument(text.str());
}

void require(const char* what, double value, double least) {
  constexpr double kMost = 1e9;  // its square is finite
  if (!(value >= least && value <= kMost)) {
    std::ostringstream expected;
    expected << "a number >= " << least << " and <= " << kMost;
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
  return config;
}

Jump jump_of(const CylinderDetectorConfig& config) {
  return {6.0 * config.sigma_range_m, config.jump_gaps};
}

/// Half the angle that a circle takes, from the laser.
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

  /// Also the middles of what is as thin as a leg, if somebody may walk here, cylinder or not.
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

 private:
  struct Farthest {  // of a run's points from its chord
    int at;
    double behind;  // negative before it
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
  [[nodiscard]] Cylinder told(const Run& run, const CircleFit& fit) const;
  [[nodiscard]] bool ends_behind(const Run& run, const Circle& circle) const;
  [[nodiscard]] bool is_thin(const Run& run) const;
  [[nodiscard]] int returns(const Run& run) const;

  const CylinderDetectorConfig& config_;
  const std::vector<double>& gates_;
  const Sweep& sweep_;
  BeamNoise noise_;
  bool radius_known_;
  bool only_bright_;
  int begin_;  // beams before are on cylinders that were found
  int end_;    // so are those from here on, those of the first one around a full turn
  std::vector<Cylinder> found_;
};

/// What lies between two edges is cut where it lies behind its chord, as in the corner between a
/// wall and a cylinder before it. What is left bulges.
void Search::split(const Run& run) {
  if (sweep_[run.first].returned() && (!only_bright_ || sweep_[run.first].bright)) {
    int begin = run.first;
    cut(run, begin);
    consider({begin, run.last});
  }
}

/// Part by part in order, without recursion: there may be as many parts as beams.
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
    if (std::abs(farthest.behind) >= 4.0 * noise_.range) {
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
  if (run.beams() < std::min(config_.least_beams, kFew)) {
    return;
  }
  const std::optional<CircleFit> fit = fit_grown(run);
  if (!fit || !fit->covariance.allFinite() || !is_cylinder(run, *fit)) {
    return;
  }
  const Cylinder cylinder = told(run, *fit);
  if (is_positive(cylinder.covariance)) {
    add(cylinder);
    begin_ = run.last + 1;
    end_ = std::min(end_, run.first + sweep_.size());
  }
}

/// Two that overlap are one, cut in two by a beam that is far off.
void Search::add(const Cylinder& cylinder) {
  for (Cylinder& other : found_) {
    if (distance_between(cylinder, other) < std::max(cylinder.radius, other.radius)) {
      other = cylinder.beams > other.beams ? cylinder : other;
      return;
    }
  }
  found_.push_back(cylinder);
}

/// Fits, leaves out ends that do not lie on the circle, takes neighbours in that do.
std::optional<CircleFit> Search::fit_grown(Run& run) const {
  constexpr int kRounds = 8;
  std::optional<Circle> from = start(run);
  std::optional<CircleFit> found = from ? fit(run, *from) : std::nullopt;
  for (int k = 0; k < kRounds && found; ++k) {
    const Circle circle = found->circle;
    if (!trim(run, circle) && !grow(run, circle)) {
      break;
    }
    found = returns(run) < std::min(config_.least_beams, kFew) ? std::nullopt : fit(run, circle);
  }
  return found;
}

std::optional<CircleFit> Search::fit(const Run& run, const Circle& from) const {
  // Which beams hit it says as much as their ranges.
  if (radius_known_ && (run.beams() <= kFew || half_angle(from) < 2.0 * sweep_.step)) {
    return fit_few(sweep_, run, config_.radius_m, noise_);
  }
  return fit_circle(sweep_, run, from, radius_known_, noise_);
}

/// Whether a run is not longer than a cylinder of the known radius, and about as high as that over
/// its chord: walls are neither, and need no fit.
bool Search::may_be_one(const Run& run) const {
  const double R = config_.radius_m;
  const Vector<2> a = sweep_[run.first].end();
  const Vector<2> chord = sweep_[run.last].end() - a;
  const double half = 0.5 * chord.norm();
  const double slack = 4.0 * noise_.range + 2.0 * sweep_.step * sweep_[run.first].range;
  if (half > R + slack) {
    return false;
  }
  const double height = R - std::sqrt(std::max(R * R - half * half, 0.0));
  const Vector<2> middle = sweep_[(run.first + run.last) / 2].end() - a;
  return run.beams() <= kFew || cross(chord, middle) / (2.0 * half) > 0.4 * height - slack;
}

std::optional<Circle> Search::start(const Run& run) const {
  if (radius_known_) {
    return may_be_one(run) ? std::optional<Circle>(circle_behind(sweep_, run, config_.radius_m))
                           : std::nullopt;
  }
  const Ray& middle = sweep_[(run.first + run.last) / 2];
  if (run.beams() > kFew) {
    std::optional<Circle> circle = algebraic_circle(sweep_, run);
    const bool bulges = circle && middle.returned() && !passes(middle, *circle, 0.0);
    if (bulges && circle->radius < 3.0 * config_.radius_max_m) {
      return circle;
    }
    if (config_.least_evidence > 0.0) {
      return std::nullopt;  // flat or hollow
    }
  }
  const double wide = std::min(run.beams() * sweep_.step, 1.0);
  const double range = sweep_[run.first].range;
  return circle_behind(sweep_, run, range * std::sin(0.5 * wide));
}

bool Search::trim(Run& run, const Circle& circle) const {
  const auto worst = [&](int j) {
    const internal::Offset offset = offset_of(sweep_[j], circle, noise_);
    return offset.distance * offset.distance / offset.variance;
  };
  if (run.beams() <= kFew) {
    return false;
  }
  const double first = worst(run.first);
  const double last = worst(run.last);
  if (std::max(first, last) <= kBeamGate) {
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
  for (int j = end + side; std::abs(j - end) <= kLargestGap + 1; j += side) {
    if (!sweep_.has(j) || j < begin_ || j >= end_ ||
        std::abs(cross(sweep_[j].along, circle.centre)) > 0.98 * circle.radius) {
      break;
    }
    if (sweep_[j].returned()) {
      const internal::Offset offset = offset_of(sweep_[j], circle, noise_);
      if (offset.distance * offset.distance > kBeamGate * offset.variance) {
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
    return true;  // nothing to say against it
  }
  const int known = std::min(fit.dof, kGates - 1);
  return fit.misfit <= gates_[static_cast<std::size_t>(known)] * fit.dof / known;
}

/// A straight wall, or two that meet, do not fit as well.
bool Search::stands_out(const Run& run, const CircleFit& fit) const {
  if (run.beams() <= kFew) {
    return is_alone(run, fit);
  }
  const internal::Corner corner = best_corner(sweep_, run, noise_);
  if (corner.right < fit.misfit + config_.least_corner_evidence ||
      corner.any < fit.misfit - kBluntMargin) {
    return false;
  }
  const double evidence = line_misfit(sweep_, run, noise_) - fit.misfit;
  return evidence >= std::max(config_.least_evidence, 25.0) ||
         (evidence > 0.25 * expected_evidence(run, fit) - 4.0 && is_alone(run, fit));
}

/// As many beams as a cylinder of this radius would have.
bool Search::is_as_wide(const Run& run, const CircleFit& fit) const {
  const double wide = 2.0 * half_angle(fit.circle) / sweep_.step;
  const double blur = 2.0 * noise_.bearing / sweep_.step + (only_bright_ ? 3.0 : 1.0);
  return !radius_known_ || (run.beams() - 1 <= wide + blur && run.beams() + 1 >= wide - blur);
}

/// A thing of its own, of the right width, where its shape tells too little.
bool Search::is_alone(const Run& run, const CircleFit& fit) const {
  return fit.free_first && fit.free_last && is_as_wide(run, fit) &&
         (radius_known_ || config_.least_evidence == 0.0);
}

/// By how much a line should fit worse than a cylinder: a line leaves 4/45 of the squared height of
/// an arc.
double Search::expected_evidence(const Run& run, const CircleFit& fit) const {
  const double radius = fit.circle.radius;
  const double half = std::min(0.5 * run.beams() * sweep_.step * fit.circle.centre.norm(), radius);
  const double height = radius - std::sqrt(radius * radius - half * half);
  return run.beams() * 4.0 / 45.0 * height * height / (noise_.range * noise_.range);
}

/// Beside the end of an arc, a beam went where the circle should be.
bool Search::seen_through(int end, int side, const Circle& circle) const {
  const double reach = half_angle(circle) / sweep_.step;
  const double slack =
      circle.centre.norm() * (0.5 * sweep_.step + 2.0 * noise_.bearing) + 3.0 * noise_.range;
  for (int k = 1; k <= 2.0 * reach && sweep_.has(end + side * k); ++k) {
    const Ray& ray = sweep_[end + side * k];
    if (std::abs(cross(ray.along, circle.centre)) > 0.9 * circle.radius - slack) {
      return false;
    }
    if (ray.returned() && passes(ray, circle, 3.0 * noise_.range)) {
      return true;
    }
  }
  return false;
}

/// A beam of the arc came back from behind where it would touch the circle. A radius that was given
/// is known roughly at times, and with it where that is.
bool Search::ends_behind(const Run& run, const Circle& circle) const {
  if (radius_known_ || run.beams() <= kFew) {
    return false;
  }
  const double touches =
      std::sqrt(std::max(circle.centre.squaredNorm() - circle.radius * circle.radius, 0.0));
  for (int j = run.first; j <= run.last; ++j) {
    if (sweep_[j].returned() && sweep_[j].range > touches + kBehind * noise_.range) {
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

/// Numbers of any size may leave no covariance; that of a radius that is known is 0.
bool Search::is_positive(const Matrix<3, 3>& covariance) const {
  const auto positive = [](const auto& P) { return P.llt().info() == Eigen::Success; };
  return covariance.allFinite() &&
         (radius_known_ ? positive(covariance.topLeftCorner<2, 2>()) : positive(covariance));
}

Cylinder Search::told(const Run& run, const CircleFit& fit) const {
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

/// Leaves out thin cylinders next to each other, or to something thin of which too little is seen:
/// somebody stands or walks there.
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
  for (int dof = 1; dof < kGates; ++dof) {
    gates_.push_back(chi_squared_quantile(dof, config_.misfit_probability));
  }
}

std::vector<Cylinder> CylinderDetector::detect(const LaserScan& scan) const {
  if (config_.least_intensity > 0.0 && scan.intensities.empty() && !scan.ranges.empty()) {
    throw std::invalid_argument(
        "LaserScan.intensities is empty, expected one per beam as "
        "CylinderDetectorConfig.least_intensity is above 0");
  }
  if (scan.ranges.size() > kMostBeams) {
    throw std::invalid_argument("LaserScan.ranges has " + std::to_string(scan.ranges.size()) +
                                " beams, expected at most " + std::to_string(kMostBeams));
  }
  const Sweep sweep = sweep_of(scan, config_.least_intensity, jump_of(config_));
  std::vector<Vector<2>> thin;
  std::vector<Cylinder> cylinders = Search(config_, gates_, sweep).cylinders(thin);
  if (config_.leg_distance_m > 0.0) {
    remove_legs(cylinders, std::move(thin), config_);
  }
  std::sort(cylinders.begin(), cylinders.end(),
            [](const Cylinder& a, const Cylinder& b) { return a.first < b.first; });
  return cylinders;
}

}  // namespace locfuse
