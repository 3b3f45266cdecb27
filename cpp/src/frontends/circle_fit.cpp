// SPDX-License-Identifier: Apache-2.0
#include "frontends/circle_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace locfuse::internal {
namespace {

/// Constants of the circle fit; docs/models/landmarks.md eq. (5.2) to (5.6). Values without another
/// source are empirical.
struct CircleFitTuning {
  // Gauss-Newton.
  static constexpr int kMaxIterations = 12;
  /// Length of a step below which the fit has converged [standard deviations of a range].
  static constexpr double kConvergedSigmas = 0.05;
  /// Maximum length of a step [radii]; beyond it the linearization does not hold.
  static constexpr double kMaxStepRadii = 0.5;
  /// Minimum radius of a circle, and length that is not 0 [m].
  static constexpr double kMinRadius = 1e-3;
  static constexpr double kMinLength = 1e-9;
  /// Minimum curvature of the algebraic circle [1/m]; below it the points lie on a line.
  static constexpr double kMinCurvature = 1e-9;

  // Beams at the edge of a circle.
  /// Bounds of the edge's share of the squared radius, where a beam may hit or miss: (u/R)^2 is at
  /// most 1 minus it.
  static constexpr double kMinEdge = 0.02;
  static constexpr double kMaxEdge = 0.5;
  /// A beam passes the circle if it ends this far behind its middle [standard deviations].
  static constexpr double kPassSigmas = 3.0;

  // Few beams: sums over bearings.
  static constexpr int kBearings = 16;
  /// Minimum width of the interval of bearings, and of one that is not empty [steps of the scan].
  static constexpr double kMinBearingSteps = 1e-4;
  static constexpr double kRoundingSteps = 1e-9;
  /// Maximum offset of a beam from the centre [radii].
  static constexpr double kMaxOffsetRadii = 0.98;
  /// Maximum chi-square of a weight, so that not all underflow.
  static constexpr double kMaxMisfit = 200.0;

  // Lines and corners.
  /// Minimum squared cosine of the incidence: beams that graze a wall are less precise than their
  /// geometry implies.
  static constexpr double kMinGrazing = 0.04;
  /// Corners that are tried along a run; the misfit hardly changes in between.
  static constexpr int kCorners = 16;
  /// Passes of reweighting.
  static constexpr int kLinePasses = 3;
  static constexpr int kCornerPasses = 2;
};

/// Sums of the points of a run.
struct Moments {
  double n = 0.0;
  Vector<2> sum = Vector<2>::Zero();
  double xx = 0.0, xy = 0.0, yy = 0.0;

  void add(const Vector<2>& p, double weight = 1.0) {
    n += weight;
    sum += weight * p;
    xx += weight * p.x() * p.x();
    xy += weight * p.x() * p.y();
    yy += weight * p.y() * p.y();
  }
};

Moments operator-(Moments a, const Moments& b) {
  a.n -= b.n;
  a.sum -= b.sum;
  a.xx -= b.xx;
  a.xy -= b.xy;
  a.yy -= b.yy;
  return a;
}

/// Squares of deviations from the mean, summed.
Matrix<2, 2> scatter_of(const Moments& m) {
  const Vector<2> mean = m.sum / m.n;
  Matrix<2, 2> scatter;
  scatter << m.xx - m.n * mean.x() * mean.x(), m.xy - m.n * mean.x() * mean.y(), 0.0,
      m.yy - m.n * mean.y() * mean.y();
  scatter(1, 0) = scatter(0, 1);
  return scatter;
}

/// Line through points: direction of their smallest scatter.
struct Line {
  double squares;          ///< of the distances from the line, summed
  Matrix<2, 2> projector;  ///< normal * normal': without turning to angles
};

Line line_of(const Matrix<2, 2>& scatter) {
  const double a = scatter(0, 0);
  const double b = scatter(0, 1);
  const double c = scatter(1, 1);
  const double half = std::sqrt(0.25 * (a - c) * (a - c) + b * b);
  const double largest = 0.5 * (a + c) + half;
  Line line{std::max(largest - 2.0 * half, 0.0), Matrix<2, 2>::Identity()};
  if (half > 0.0) {
    line.projector << largest - a, -b, -b, largest - c;
    line.projector /= 2.0 * half;
  }
  return line;
}

/// Variance of the end of a beam across a line with the projector onto its normal.
double variance_across(const Ray& ray, const Matrix<2, 2>& projector, const BeamNoise& noise) {
  const double along = ray.along.dot(projector * ray.along);
  const double share = std::max(along, CircleFitTuning::kMinGrazing);
  const double sideways = ray.range * noise.bearing;
  return noise.range * noise.range * share + sideways * sideways * (1.0 - along);
}

/// The same scatter, seen turned by a right angle.
Matrix<2, 2> turned(const Matrix<2, 2>& m) {
  Matrix<2, 2> t;
  t << m(1, 1), -m(0, 1), -m(0, 1), m(0, 0);
  return t;
}

/// Chi-square of two lines at a right angle, through points on both sides of a beam.
double right_angle_misfit(const Matrix<2, 2>& left, const Matrix<2, 2>& right, const Ray& ray,
                          const BeamNoise& noise) {
  Line line = line_of(left + turned(right));
  for (int pass = 0; pass < CircleFitTuning::kCornerPasses; ++pass) {  // noise depends on the lines
    const double of_left = variance_across(ray, line.projector, noise);
    const double of_right = variance_across(ray, turned(line.projector), noise);
    line = line_of(left / of_left + turned(right) / of_right);
  }
  return line.squares;
}

/// Where an arc ends: the tangent half-way between its last beam and the first that passes it.
struct Edge {
  Vector<2> along;
  double side;  ///< 1 at the largest bearing, -1 at the smallest
};

std::optional<Edge> edge_of(const Sweep& sweep, int end, int side, const Circle& circle,
                            const BeamNoise& noise) {
  if (!sweep.has(end + side) ||
      !passes(sweep[end + side], circle, CircleFitTuning::kPassSigmas * noise.range)) {
    return std::nullopt;
  }
  const Vector<2> between = sweep[end].along + sweep[end + side].along;
  return Edge{between.normalized(), static_cast<double>(side)};
}

struct CircleNormal {
  Matrix<3, 3> information = Matrix<3, 3>::Zero();
  Vector<3> gradient = Vector<3>::Zero();
  double misfit = 0.0;

  void add(const Vector<3>& row, double residual, double variance) {
    information += row * row.transpose() / variance;
    gradient += row * (residual / variance);
    misfit += residual * residual / variance;
  }
};

/// Adds the beams of a run; in scalars, as this is the hot loop.
void add_beams(CircleNormal& normal, const Sweep& sweep, const Run& run, const Circle& circle,
               const BeamNoise& noise) {
  double xx = 0.0, xy = 0.0, yy = 0.0, x = 0.0, y = 0.0, n = 0.0;
  Vector<3> gradient = Vector<3>::Zero();
  for (int j = run.first; j <= run.last; ++j) {
    if (!sweep[j].returned()) {
      continue;
    }
    const Offset offset = offset_of(sweep[j], circle, noise);
    const double weight = 1.0 / offset.variance;
    const double wx = weight * offset.outwards.x();
    const double wy = weight * offset.outwards.y();
    xx += wx * offset.outwards.x();
    xy += wx * offset.outwards.y();
    yy += wy * offset.outwards.y();
    x += wx;
    y += wy;
    n += weight;
    gradient -= offset.distance * Vector<3>(wx, wy, weight);
    normal.misfit += weight * offset.distance * offset.distance;
  }
  Matrix<3, 3> information;
  information << xx, xy, x, xy, yy, y, x, y, n;
  normal.information += information;
  normal.gradient += gradient;
}

void add_edge(CircleNormal& normal, const Edge& edge, const Circle& circle, double step,
              const BeamNoise& noise) {
  const double across = -edge.side * cross(edge.along, circle.centre);
  const double far = edge.along.dot(circle.centre);
  // The true edge is anywhere between the two beams.
  const double variance = far * far * (step * step / 12.0 + noise.bearing * noise.bearing);
  normal.add({edge.side * edge.along.y(), -edge.side * edge.along.x(), -1.0},
             across - circle.radius, variance);
}

/// Step that solves the normal equations; of x and y alone if the radius is known.
std::optional<Vector<3>> step_of(const CircleNormal& normal, bool radius_known) {
  Vector<3> step = Vector<3>::Zero();
  if (radius_known) {
    const Eigen::LLT<Matrix<2, 2>> solver(normal.information.topLeftCorner<2, 2>());
    if (solver.info() != Eigen::Success) {
      return std::nullopt;
    }
    step.head<2>() = -solver.solve(normal.gradient.head<2>());
  } else {
    const Eigen::LLT<Matrix<3, 3>> solver(normal.information);
    if (solver.info() != Eigen::Success) {
      return std::nullopt;
    }
    step = -solver.solve(normal.gradient);
  }
  return step.allFinite() ? std::optional<Vector<3>>(step) : std::nullopt;
}

Matrix<3, 3> circle_covariance(const Matrix<3, 3>& information, bool radius_known) {
  Matrix<3, 3> P = Matrix<3, 3>::Zero();
  if (radius_known) {
    P.topLeftCorner<2, 2>() =
        information.topLeftCorner<2, 2>().llt().solve(Matrix<2, 2>::Identity());
  } else {
    P = information.llt().solve(Matrix<3, 3>::Identity());
  }
  return 0.5 * (P + P.transpose());
}

/// Moves a circle by a limited step; returns its length.
double move(Circle& circle, const Vector<3>& step) {
  const double length = step.norm();
  const double max_length = CircleFitTuning::kMaxStepRadii * circle.radius;
  const double share = length > max_length ? max_length / length : 1.0;
  circle.centre += share * step.head<2>();
  circle.radius += share * step.z();
  return share * length;
}

/// Interval of the bearing of the centre, from the beams that hit it: angles from the first beam.
struct Bearings {
  double middle;
  double width;
  bool free_first;
  bool free_last;
};

Bearings bearings_of(const Sweep& sweep, const Run& run, const Circle& guess,
                     const BeamNoise& noise) {
  const auto is_free = [&](int j) {
    return sweep.has(j) && passes(sweep[j], guess, CircleFitTuning::kPassSigmas * noise.range);
  };
  const bool free_first = is_free(run.first - 1);
  const bool free_last = is_free(run.last + 1);
  const double half = std::asin(std::min(guess.radius / guess.centre.norm(), 1.0));
  const double seen = (run.beams() - 1) * sweep.step;
  const double low = free_first ? std::max(seen - half, half - sweep.step) : seen - half;
  const double high = free_last ? std::min(half, seen + sweep.step - half) : half;
  // Rounding may make an empty interval negative. With more beams than the width allows, the beams
  // themselves are wide, and the edges may be anywhere in a step.
  const double width = high - low > -CircleFitTuning::kRoundingSteps * sweep.step
                           ? std::max(high - low, CircleFitTuning::kMinBearingSteps * sweep.step)
                           : sweep.step;
  return {0.5 * (low + high), width, free_first, free_last};
}

/// Range of the centre at an angle from the first beam, and the chi-square of the beams.
Vector<2> range_and_misfit(const Sweep& sweep, const Run& run, const Circle& guess, double turn,
                           const BeamNoise& noise) {
  const double R = guess.radius;
  double sum = 0.0;
  double squares = 0.0;
  double n = 0.0;
  for (int j = run.first; j <= run.last; ++j) {
    if (sweep[j].returned()) {
      const double off = (j - run.first) * sweep.step - turn;
      const double u =
          std::clamp(guess.centre.norm() * std::sin(off), -CircleFitTuning::kMaxOffsetRadii * R,
                     CircleFitTuning::kMaxOffsetRadii * R);
      const double range = sweep[j].range * std::cos(off) + std::sqrt(R * R - u * u);
      sum += range;
      squares += range * range;
      n += 1.0;
    }
  }
  return {sum / n, std::max(squares - sum * sum / n, 0.0) / (noise.range * noise.range)};
}

/// Unit vectors along a bearing and across it, to the left, as columns.
Matrix<2, 2> axes_at(const Ray& first, double turn) {
  Matrix<2, 2> axes;
  axes.col(0) << std::cos(turn) * first.along.x() - std::sin(turn) * first.along.y(),
      std::sin(turn) * first.along.x() + std::cos(turn) * first.along.y();
  axes.col(1) << -axes(1, 0), axes(0, 0);
  return axes;
}

}  // namespace

std::optional<Circle> algebraic_circle(const Sweep& sweep, const Run& run) {
  Vector<3> mean = Vector<3>::Zero();  // of x, y, and the squared distance from the middle beam
  const Vector<2> origin = sweep[(run.first + run.last) / 2].end();
  double n = 0.0;
  Matrix<3, 3> squares = Matrix<3, 3>::Zero();
  for (int j = run.first; j <= run.last; ++j) {
    if (sweep[j].returned()) {
      const Vector<2> p = sweep[j].end() - origin;
      const Vector<3> q(p.x(), p.y(), p.squaredNorm());
      n += 1.0;
      mean += q;
      squares += q * q.transpose();
    }
  }
  mean /= n;
  Matrix<3, 3> M = squares / n - mean * mean.transpose();
  // a |p|^2 + b' p + d = 0 with a gradient of mean length 1: 4 a^2 spread + |b + 2 a mean|^2 = 1,
  // which is a sphere in (2 a sqrt(spread), b + 2 a mean).
  const double spread = M(0, 0) + M(1, 1);
  if (!(spread > 0.0)) {
    return std::nullopt;
  }
  Matrix<3, 3> to_sphere = Matrix<3, 3>::Identity();
  to_sphere.row(2) << -2.0 * mean.x(), -2.0 * mean.y(), 1.0;
  to_sphere.row(2) /= 2.0 * std::sqrt(spread);
  M = to_sphere * M * to_sphere.transpose();
  Eigen::SelfAdjointEigenSolver<Matrix<3, 3>> solver;
  solver.computeDirect(M);
  const Vector<3> best = solver.eigenvectors().col(0);
  const double a = best.z() / (2.0 * std::sqrt(spread));
  if (std::abs(a) < CircleFitTuning::kMinCurvature) {
    return std::nullopt;
  }
  const Vector<2> from_mean = -best.head<2>() / (2.0 * a);
  return Circle{origin + mean.head<2>() + from_mean, std::sqrt(from_mean.squaredNorm() + spread)};
}

Circle circle_behind(const Sweep& sweep, const Run& run, double radius) {
  const Vector<2> a = sweep[run.first].end();
  const Vector<2> b = sweep[run.last].end();
  const Vector<2> middle = 0.5 * (a + b);
  const double half = 0.5 * (b - a).norm();
  if (half < CircleFitTuning::kMinLength) {
    return {middle + radius * sweep[run.first].along, radius};
  }
  Vector<2> behind = Vector<2>(a.y() - b.y(), b.x() - a.x()) / (2.0 * half);
  behind *= behind.dot(middle) < 0.0 ? -1.0 : 1.0;
  const double deep = std::sqrt(std::max(radius * radius - half * half, 0.0));
  return {middle + deep * behind, radius};
}

Offset offset_of(const Ray& ray, const Circle& circle, const BeamNoise& noise) {
  const double per_radius = 1.0 / circle.radius;
  const double u = cross(ray.along, circle.centre) * per_radius;
  // At the edge a beam hits anywhere within half a gap, or misses.
  const double edge = std::clamp(0.5 * noise.step * ray.range * per_radius,
                                 CircleFitTuning::kMinEdge, CircleFitTuning::kMaxEdge);
  const double across = std::min(u * u, 1.0 - edge);
  const double v = noise.range * noise.range;
  const double sideways = ray.range * noise.bearing;
  const double bent = 0.5 * v * across * per_radius;  // second order: noise along a tangent
  const Vector<2> from = ray.end() - circle.centre;
  const double length = std::max(from.norm(), CircleFitTuning::kMinLength);
  return {length - circle.radius - bent,
          v * (1.0 - across) + sideways * sideways * across + 2.0 * bent * bent, from / length};
}

bool passes(const Ray& ray, const Circle& circle, double margin) {
  return !(ray.range < ray.along.dot(circle.centre) + margin);  // true without return
}

std::optional<CircleFit> fit_circle(const Sweep& sweep, const Run& run, const Circle& start,
                                    bool radius_known, const BeamNoise& noise) {
  Circle circle = start;
  CircleNormal normal;
  std::optional<Edge> edges[2];
  for (int k = 0; k < CircleFitTuning::kMaxIterations; ++k) {
    normal = {};
    add_beams(normal, sweep, run, circle, noise);
    edges[0] = edge_of(sweep, run.first, -1, circle, noise);
    edges[1] = edge_of(sweep, run.last, 1, circle, noise);
    for (const std::optional<Edge>& edge : edges) {
      if (edge) {
        add_edge(normal, *edge, circle, sweep.step, noise);
      }
    }
    const std::optional<Vector<3>> step = step_of(normal, radius_known);
    if (!step) {
      return std::nullopt;
    }
    const double moved = move(circle, *step);
    if (!(circle.radius > CircleFitTuning::kMinRadius) || circle.centre.norm() <= circle.radius) {
      return std::nullopt;  // the laser is not inside a cylinder
    }
    if (moved < CircleFitTuning::kConvergedSigmas * noise.range) {
      break;
    }
  }
  int beams = 0;
  for (int j = run.first; j <= run.last; ++j) {
    beams += sweep[j].returned() ? 1 : 0;
  }
  const int dof = beams + (edges[0] ? 1 : 0) + (edges[1] ? 1 : 0) - (radius_known ? 2 : 3);
  if (dof < 0) {
    return std::nullopt;
  }
  return CircleFit{circle,
                   circle_covariance(normal.information, radius_known),
                   normal.misfit,
                   dof,
                   edges[0].has_value(),
                   edges[1].has_value()};
}

std::optional<CircleFit> fit_few(const Sweep& sweep, const Run& run, double radius,
                                 const BeamNoise& noise) {
  const Circle guess = circle_behind(sweep, run, radius);
  const Bearings may = bearings_of(sweep, run, guess, noise);
  // Moments of range and turn about those of the guess, where squares lose no digits.
  const Vector<2> middle(guess.centre.norm(), may.middle);
  Vector<2> mean = Vector<2>::Zero();
  Matrix<2, 2> squares = Matrix<2, 2>::Zero();
  double total = 0.0;
  double misfit = std::numeric_limits<double>::infinity();
  for (int k = 0; k < CircleFitTuning::kBearings; ++k) {
    const double off = may.width * ((k + 0.5) / CircleFitTuning::kBearings - 0.5);
    const Vector<2> found = range_and_misfit(sweep, run, guess, may.middle + off, noise);
    const double weight = std::exp(-0.5 * std::min(found.y(), CircleFitTuning::kMaxMisfit));
    const Vector<2> at(found.x() - middle.x(), off);
    misfit = std::min(misfit, found.y());
    total += weight;
    mean += weight * at;
    squares += weight * (at * at.transpose());
  }
  mean /= total;
  Matrix<2, 2> P = squares / total - mean * mean.transpose();
  P(0, 0) += noise.range * noise.range / run.beams();
  P(1, 1) +=
      noise.bearing * noise.bearing +
      may.width * may.width / (12.0 * CircleFitTuning::kBearings * CircleFitTuning::kBearings);
  mean += middle;
  const Matrix<2, 2> axes = axes_at(sweep[run.first], mean.y());
  Matrix<2, 2> to_plane = axes;
  to_plane.col(1) *= mean.x();
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();
  covariance.topLeftCorner<2, 2>() = to_plane * P * to_plane.transpose();
  return CircleFit{{mean.x() * axes.col(0), radius},
                   covariance,
                   misfit,
                   run.beams() - 1,
                   may.free_first,
                   may.free_last};
}

double line_misfit(const Sweep& sweep, const Run& run, const BeamNoise& noise) {
  Line line{};
  for (int pass = 0; pass < CircleFitTuning::kLinePasses; ++pass) {
    Moments moments;
    const Vector<2> origin = sweep[run.first].end();  // sums of squares stay small
    for (int j = run.first; j <= run.last; ++j) {
      if (sweep[j].returned()) {
        const double weight =
            pass == 0 ? 1.0 : 1.0 / variance_across(sweep[j], line.projector, noise);
        moments.add(sweep[j].end() - origin, weight);
      }
    }
    line = line_of(scatter_of(moments));
  }
  return line.squares;
}

Corner best_corner(const Sweep& sweep, const Run& run, const BeamNoise& noise) {
  const Vector<2> origin = sweep[run.first].end();
  Moments all;
  for (int j = run.first; j <= run.last; ++j) {
    if (sweep[j].returned()) {
      all.add(sweep[j].end() - origin);
    }
  }
  Corner best{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Moments before;
  const int stride = 1 + run.beams() / CircleFitTuning::kCorners;
  for (int j = run.first; j < run.last; ++j) {
    if (!sweep[j].returned()) {
      continue;
    }
    before.add(sweep[j].end() - origin);
    const Moments behind = all - before;
    if (before.n < 2.0 || behind.n < 2.0 || (j - run.first) % stride != 0) {
      continue;
    }
    const Matrix<2, 2> left = scatter_of(before);
    const Matrix<2, 2> right = scatter_of(behind);
    const Line a = line_of(left);
    const Line b = line_of(right);
    best.any = std::min(best.any, a.squares / variance_across(sweep[j], a.projector, noise) +
                                      b.squares / variance_across(sweep[j], b.projector, noise));
    best.right = std::min(best.right, right_angle_misfit(left, right, sweep[j], noise));
  }
  return best;
}

}  // namespace locfuse::internal
