// SPDX-License-Identifier: Apache-2.0
#include "frontends/scan_refine.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace locfuse::internal {
namespace {

using Solver3 = Eigen::SelfAdjointEigenSolver<Matrix<3, 3>>;

constexpr double kOffsetSigma = 0.5;  // of a surface about its line: it lies in its cell [cells]
constexpr double kCellSigma = 0.28867513;  // of a point that is anywhere in its cell [cells]
constexpr double kLineSigma = 0.12909944;  // of a line through the five cells of a fit [cells]
constexpr double kLeastMapSigma = 0.05;    // no map is better than this [cells]
constexpr double kMostAtFirst = 1.0;       // nor, while the pose is rough, worse than this
constexpr double kMostMapSigma = 4.0;      // nor ever worse than this
constexpr double kPriorRuns = 4.0;         // weight of kLineSigma against the residuals
constexpr double kKernelSigmas = 4.0;
constexpr double kInlierSigmas = 3.0;
constexpr double kExplainedCells = 2.0;
constexpr double kStill = 0.005;       // a step below this is none [cells]
constexpr double kSettled = 0.1;       // share of a kernel below which steps leave it
constexpr double kNearlyStill = 0.05;  // where it jumps; a millimetre or two
constexpr int kFullSteps = 10;
constexpr double kWide = 2.0;        // a kernel for which few beams do [cells]
constexpr std::size_t kStride = 4;   // then
constexpr double kLeastReach = 3.0;  // of a beam to its wall, so that all explained ones are seen
constexpr std::size_t kLeastMatches = 6;
// Lines of a straight wall turn by up to 0.11 rad as its cells come out rounded: below twice the
// square of that, information is no more than what rounding makes up.
constexpr double kWeakShare = 0.024;

/// Normal equations over (x, y, heading, offset); docs/models/scan_matching.md.
struct Normal {
  Matrix<4, 4> H = Matrix<4, 4>::Zero();
  Vector<4> g = Vector<4>::Zero();
  double lever = 0.0;  // sum of weighted squared distances to the body
  double weight = 0.0;
};

/// The scan's word on the pose alone: offset eliminated, weak directions taken out.
struct Reduced {
  Matrix<3, 3> information;
  Vector<3> gradient;
  Vector<3> per_scale;  // to cells, for each of (x, y, heading)
  std::optional<Vector<3>> weak;
};

constexpr int kLanes = 4;
constexpr float kFitted = 5.0F;  // cells of a line, its shortest run
using Lanes = Eigen::Array<float, kLanes, 1>;
using Line = ScanMap::CompactLine;

/// Four beams, in single precision, which is right to 1e-3 cells on the largest maps.
struct Beam4 {
  Lanes x, y;         // end points in body
  Lanes per_spacing;  // end points of a beam and the next, per cell of wall
  Lanes used;         // 0 for those that fill up the last four
};

/// Four end points and the walls next to them.
struct Match4 {
  Lanes rx, ry;             // from the body, in the field's axes
  Lanes x, y, nx, ny, run;  // the lines
  Lanes used;               // 1, or 0 without a line
  Lanes e;                  // eq. (4); kFar without a line
  Lanes alike;              // k of eq. (6)
};

class Refinement {
 public:
  Refinement(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
             const Prior& prior, const Pose2& start)
      : field_(map.surface()),
        lines_(map.compact_lines()),
        beams_(beams),
        prior_(prior),
        exact_(config.exact_neighbours),
        last_column_(Lanes::Constant(static_cast<float>(map.surface().width() - 1))),
        last_row_(Lanes::Constant(static_cast<float>(map.surface().height() - 1))),
        sigma_beam_(config.sigma_range_m / map.grid().resolution()),
        start_(start) {
    fit_.pose = start;
    set_map_variance(kCellSigma * kCellSigma);
    const std::size_t count = beams.x.size();
    beams4_.resize((count + kLanes - 1) / std::size_t{kLanes});
    matches4_.resize(beams4_.size());
    for (std::size_t i = 0; i < std::size_t{kLanes} * beams4_.size(); ++i) {
      Beam4& four = beams4_[i / std::size_t{kLanes}];
      const auto k = static_cast<int>(i % std::size_t{kLanes});
      const std::size_t beam = std::min(i, count - 1);
      four.x(k) = static_cast<float>(beams.x[beam]);
      four.y(k) = static_cast<float>(beams.y[beam]);
      four.per_spacing(k) =
          static_cast<float>(1.0 / std::max(beams.range[beam] * beams.step, 1e-6));
      four.used(k) = i < count ? 1.0F : 0.0F;
    }
  }

  Fit run(int max_iterations, double capture) {
    double kernel = capture;
    bool narrow = false;
    for (fit_.iterations = 1; fit_.iterations <= max_iterations; ++fit_.iterations) {
      // While the kernel is wide, every fourth beam shows the way.
      const Normal normal = accumulate(kernel, false, !narrow && kernel > kWide ? kStride : 1);
      if (matches_ < kLeastMatches) {
        return ended(ScanMatch::Reason::kTooFewMatches);
      }
      // Near a wall's end the nearest cell may jump back and forth; shorter steps settle between.
      const bool jumps = fit_.iterations > kFullSteps;
      const double moved = step(normal, jumps ? 0.5 : 1.0);
      if (!inside()) {
        return ended(ScanMatch::Reason::kOutsideMap);
      }
      if (narrow && moved < (jumps ? kNearlyStill : kStill)) {
        estimate_sigma(kMostMapSigma);
        step(accumulate(floor(), false, 1), 1.0);
        return finished();
      }
      if (!narrow && kernel <= floor()) {
        narrow = true;
        estimate_sigma(kMostAtFirst);
      }
      if (narrow || moved < kSettled * kernel) {
        kernel = std::max(0.5 * kernel, floor());
      }
    }
    fit_.iterations = max_iterations;
    return ended(ScanMatch::Reason::kNoConvergence);
  }

 private:
  [[nodiscard]] double floor() const { return kKernelSigmas * fit_.sigma; }

  void set_map_variance(double variance) {
    map_variance_ = variance;
    fit_.sigma = std::sqrt(variance + sigma_beam_ * sigma_beam_);
  }

  [[nodiscard]] bool inside() const {
    return fit_.pose.x >= 0.0 && fit_.pose.x < field_.width() && fit_.pose.y >= 0.0 &&
           fit_.pose.y < field_.height();
  }

  /// Finds the wall next to each of four end points. One off the field gets the line that is
  /// nearest to the field's edge, and is farther than the margin from it.
  void look_up(const Beam4& beam, float c, float s, Match4& match) const {
    using Indices = Eigen::Array<int, kLanes, 1>;
    match.rx = c * beam.x - s * beam.y;
    match.ry = s * beam.x + c * beam.y;
    const Lanes x = match.rx + static_cast<float>(fit_.pose.x);
    const Lanes y = match.ry + static_cast<float>(fit_.pose.y);
    Indices targets;
    if (exact_) {
      for (int k = 0; k < kLanes; ++k) {
        targets(k) =
            field_.nearest_in_field(static_cast<double>(x(k)), static_cast<double>(y(k))).target;
      }
    } else {
      const Indices column = x.max(zeros_).min(last_column_).cast<int>();
      const Indices row = y.max(zeros_).min(last_row_).cast<int>();
      const std::int32_t* const nearest = field_.nearest_targets().data();
      for (int k = 0; k < kLanes; ++k) {
        targets(k) = nearest[row(k) * field_.width() + column(k)];
      }
    }
    const Line* const lines = lines_.data();
    for (int k = 0; k < kLanes; ++k) {
      const Line& line = lines[targets(k)];
      match.x(k) = line.x;
      match.y(k) = line.y;
      match.nx(k) = line.nx;
      match.ny(k) = line.ny;
      match.run(k) = line.run;
    }
  }

  /// 1 where a value is above 0, else 0. Eigen's select is no vector instruction, this is.
  [[nodiscard]] static Lanes positive(const Lanes& value) {
    return (value * 1e30F).max(Lanes::Zero()).min(Lanes::Ones());
  }

  /// Turns the normals to the laser, and back along the beam where there are none; eq. (4).
  void measure(Match4& match, const Vector<2>& laser, float reach_squared) const {
    const Lanes bx = match.rx - static_cast<float>(laser.x());
    const Lanes by = match.ry - static_cast<float>(laser.y());
    const Lanes ex = match.rx + static_cast<float>(fit_.pose.x) - match.x;
    const Lanes ey = match.ry + static_cast<float>(fit_.pose.y) - match.y;
    const Lanes none = 1.0F - match.nx.square() - match.ny.square();
    if (none.maxCoeff() > 0.5F) {
      const Lanes back = none * (bx.square() + by.square() + 1e-6F).sqrt().inverse();
      match.nx -= bx * back;
      match.ny -= by * back;
    }
    const Lanes along = match.nx * bx + match.ny * by;
    const Lanes side = -along * (along.abs() + 1e-30F).inverse();
    match.nx *= side;
    match.ny *= side;
    match.used *=
        positive(reach_squared - ex.square() - ey.square()) * match.run.min(Lanes::Ones());
    match.e = match.nx * ex + match.ny * ey - static_cast<float>(fit_.offset) +
              kFar * (1.0F - match.used);
  }

  /// Normal equations of eq. (4) and (5), weighted by eq. (6): by a smooth kernel, or all of those
  /// within `kernel` alike if `hard`. Takes every `stride`-th four.
  Normal accumulate(double kernel, bool hard, std::size_t stride) {
    const double reach =
        std::min(std::max(3.0 * kernel, kLeastReach), static_cast<double>(field_.margin_cells()));
    const Vector<2> laser = Pose2{0.0, 0.0, fit_.pose.heading}.act(beams_.laser);
    const auto c = static_cast<float>(std::cos(fit_.pose.heading));
    const auto s = static_cast<float>(std::sin(fit_.pose.heading));
    const auto per_kernel = static_cast<float>(1.0 / (kernel * kernel));
    const auto beam_variance = static_cast<float>(sigma_beam_ * sigma_beam_);
    std::array<Lanes, 16> sums;
    sums.fill(Lanes::Zero());
    // Two loops: what was just written one by one cannot be read at once, four at a time.
    used_ = 0;
    for (std::size_t i = 0; i < beams4_.size(); i += stride) {
      look_up(beams4_[i], c, s, matches4_[used_++]);
    }
    for (std::size_t i = 0; i < used_; ++i) {
      Match4& match = matches4_[i];
      const Beam4& beam = beams4_[i * stride];
      match.used = beam.used;
      measure(match, laser, static_cast<float>(reach * reach));
      match.alike = (match.run * beam.per_spacing).max(Lanes::Ones());
      // The rounding of eq. (6); without a line there is no run, and no weight either.
      const Lanes rounding =
          (kFitted / 12.0F) * (1.0F / kFitted - match.run.max(kFitted).inverse());
      const Lanes noise =
          (rounding + static_cast<float>(map_variance_)) * match.alike + beam_variance;
      const Lanes ratio = match.e.square() * per_kernel;
      const Lanes inside = match.used * positive(hard ? Lanes(1.0F - ratio) : Lanes::Ones());
      const Lanes robust = hard ? Lanes::Ones() : Lanes((1.0F + ratio).square());
      sums[15] += inside;
      add(match, inside * (robust * noise).inverse(), sums);
    }
    return normal_of(sums);
  }

  static void add(const Match4& match, const Lanes& w, std::array<Lanes, 16>& sums) {
    const Lanes jt = match.ny * match.rx - match.nx * match.ry;
    const Lanes wx = w * match.nx;
    const Lanes wy = w * match.ny;
    const Lanes wt = w * jt;
    sums[0] += wx * match.nx;
    sums[1] += wx * match.ny;
    sums[2] += wx * jt;
    sums[3] += wx;
    sums[4] += wy * match.ny;
    sums[5] += wy * jt;
    sums[6] += wy;
    sums[7] += wt * jt;
    sums[8] += wt;
    sums[9] += w;
    sums[10] += wx * match.e;
    sums[11] += wy * match.e;
    sums[12] += wt * match.e;
    sums[13] += w * match.e;
    sums[14] += w * (match.rx * match.rx + match.ry * match.ry);
  }

  Normal normal_of(const std::array<Lanes, 16>& lanes) {
    std::array<double, 16> sums{};
    std::transform(lanes.begin(), lanes.end(), sums.begin(),
                   [](const Lanes& sum) { return static_cast<double>(sum.sum()); });
    Normal normal;
    normal.H << sums[0], sums[1], sums[2], -sums[3],  //
        sums[1], sums[4], sums[5], -sums[6],          //
        sums[2], sums[5], sums[7], -sums[8],          //
        -sums[3], -sums[6], -sums[8], sums[9] + 1.0 / (kOffsetSigma * kOffsetSigma);
    normal.g << sums[10], sums[11], sums[12],
        fit_.offset / (kOffsetSigma * kOffsetSigma) - sums[13];
    normal.lever = sums[14];
    normal.weight = sums[9];
    matches_ = static_cast<std::size_t>(sums[15]);
    return normal;
  }

  /// Eq. (7): eliminates the offset and what rounding alone would say.
  [[nodiscard]] static Reduced reduce(const Normal& normal) {
    const Vector<3> h = normal.H.block<3, 1>(0, 3);
    const double length = std::max(std::sqrt(normal.lever / normal.weight), 1.0);
    const Vector<3> per_scale(1.0, 1.0, 1.0 / length);  // a radian counts as the typical lever
    Reduced reduced{normal.H.topLeftCorner<3, 3>() - h * h.transpose() / normal.H(3, 3),
                    normal.g.head<3>() - h * (normal.g(3) / normal.H(3, 3)),
                    per_scale,
                    {}};
    const Matrix<3, 3> scaled =
        per_scale.asDiagonal() * reduced.information * per_scale.asDiagonal();
    // The product of the larger two eigenvalues is at most a quarter of the squared trace.
    const double trace = scaled.trace();
    if (4.0 * scaled.determinant() > kWeakShare * trace * trace * trace) {
      return reduced;
    }
    const Solver3 eigen(scaled);
    for (int i = 0; i < 2 && eigen.eigenvalues()(i) < kWeakShare * eigen.eigenvalues()(2); ++i) {
      const Vector<3> v = eigen.eigenvectors().col(i);
      const Vector<3> row = v.cwiseQuotient(per_scale);
      reduced.information -= eigen.eigenvalues()(i) * row * row.transpose();
      reduced.gradient -= row * v.dot(per_scale.cwiseProduct(reduced.gradient));
      if (!reduced.weak) {
        reduced.weak = v.cwiseProduct(per_scale);
      }
    }
    return reduced;
  }

  /// Smallest solution of A x = b where A may leave directions open, at which b is zero.
  [[nodiscard]] static Vector<3> solve(const Matrix<3, 3>& A, const Vector<3>& b, bool open) {
    if (!open) {
      return A.llt().solve(b);
    }
    const Solver3 eigen(A);
    Vector<3> x = eigen.eigenvectors().transpose() * b;
    for (int i = 0; i < 3; ++i) {
      const double lambda = eigen.eigenvalues()(i);
      x(i) = lambda > 1e-9 * eigen.eigenvalues()(2) ? x(i) / lambda : 0.0;
    }
    return eigen.eigenvectors() * x;
  }

  /// One step over the directions that scan or prior know; its length [cells].
  double step(const Normal& normal, double damping) {
    const Reduced reduced = reduce(normal);
    const Matrix<3, 3> information = reduced.information + prior_.information;
    const Vector<3> gradient =
        reduced.gradient + prior_.information * local(fit_.pose, prior_.mean);
    const Matrix<3, 3> scaled =
        reduced.per_scale.asDiagonal() * information * reduced.per_scale.asDiagonal();
    const Vector<3> moved = -damping * solve(scaled, reduced.per_scale.cwiseProduct(gradient),
                                             reduced.weak.has_value());
    const Vector<3> delta = reduced.per_scale.cwiseProduct(moved);
    fit_.pose = retract(fit_.pose, delta);
    fit_.offset -= (normal.g(3) + normal.H.block<1, 3>(3, 0) * delta) / normal.H(3, 3);
    return moved.norm();
  }

  /// Map errors from the residuals: their spread without outliers, less the beams' own noise.
  void estimate_sigma(double most) {
    constexpr float kBins = 64.0F;  // per cell, up to 4 cells
    std::array<int, 256> histogram{};
    int count = 0;
    for_each_match([&](float e, float) {
      if (std::abs(e) < 4.0F) {
        ++histogram[static_cast<std::size_t>(std::abs(e) * kBins)];
        ++count;
      }
    });
    std::size_t middle = 0;
    for (int below = histogram[0]; 2 * below < count; below += histogram[++middle]) {
    }
    const double median = (static_cast<double>(middle) + 0.5) / static_cast<double>(kBins);
    const double bound =
        kInlierSigmas * std::max(1.4826 * median, std::hypot(kLeastMapSigma, sigma_beam_));
    double runs = 0.0;
    double sum = 0.0;
    for_each_match([&](float e, float alike) {
      if (static_cast<double>(std::abs(e)) < bound) {
        const double square = static_cast<double>(e) * static_cast<double>(e);
        runs += 1.0 / static_cast<double>(alike);
        sum += (square - sigma_beam_ * sigma_beam_) / static_cast<double>(alike);
      }
    });
    const double free = std::max(runs - 4.0, 0.0);  // four are fitted
    const double variance =
        (kPriorRuns * kLineSigma * kLineSigma + std::max(sum, 0.0)) / (kPriorRuns + free);
    set_map_variance(std::min(std::max(variance, kLeastMapSigma * kLeastMapSigma), most * most));
  }

  template <class Each>
  void for_each_match(const Each& each) const {
    for (std::size_t i = 0; i < used_; ++i) {
      for (int k = 0; k < kLanes; ++k) {
        each(matches4_[i].e(k), matches4_[i].alike(k));
      }
    }
  }

  Fit ended(ScanMatch::Reason reason) {
    fit_.pose = start_;
    fit_.reason = reason;
    return fit_;
  }

  Fit finished() {
    const Reduced reduced = reduce(accumulate(kInlierSigmas * fit_.sigma, true, 1));
    if (matches_ < kLeastMatches) {
      return ended(ScanMatch::Reason::kTooFewMatches);
    }
    fit_.information = reduced.information;
    fit_.weak = reduced.weak;
    const double bound = std::max(kExplainedCells, kInlierSigmas * fit_.sigma);
    double sum = 0.0;
    double count = 0.0;
    for_each_match([&](float e, float) {
      if (static_cast<double>(std::abs(e)) <= bound) {
        sum += static_cast<double>(e) * static_cast<double>(e);
        count += 1.0;
      }
    });
    fit_.explained = count / static_cast<double>(beams_.x.size());
    fit_.rms = std::sqrt(sum / std::max(count, 1.0));
    fit_.reason = ScanMatch::Reason::kConverged;
    return fit_;
  }

  static constexpr float kFar = 1e6F;  // residual of a beam without a wall

  const DistanceField& field_;
  const std::vector<Line>& lines_;
  const Beams& beams_;
  const Prior& prior_;
  bool exact_;
  Lanes zeros_ = Lanes::Zero();
  Lanes last_column_;
  Lanes last_row_;
  double sigma_beam_;
  Pose2 start_;
  double map_variance_ = 0.0;
  std::vector<Beam4> beams4_;
  std::vector<Match4> matches4_;
  std::size_t used_ = 0;  // of matches4_
  std::size_t matches_ = 0;
  Fit fit_;
};

}  // namespace

Fit refine(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
           const Pose2& start, const Prior& prior, double capture) {
  return Refinement(map, config, beams, prior, start).run(config.max_iterations, capture);
}

Fit refine_around(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
                  const Prior& prior, double capture) {
  constexpr double kGood = 0.85;  // of the returns explained
  constexpr double kTurn = 0.06;  // rad; beams of 10 m then end 0.6 m elsewhere
  Fit best = refine(map, config, beams, prior.mean, prior, capture);
  for (const double turn : {kTurn, -kTurn}) {
    if (best.reason == ScanMatch::Reason::kConverged && best.explained >= kGood) {
      break;
    }
    const Pose2 start = retract(prior.mean, {0.0, 0.0, turn});
    const Fit fit = refine(map, config, beams, start, prior, capture);
    if (fit.explained > best.explained) {
      best = fit;
    }
  }
  return best;
}

ScanMatch to_match(const Fit& fit, const OccupancyGrid& grid, int margin_cells, const Pose2& guess,
                   const Prior& prior) {
  ScanMatch match;
  match.iterations = fit.iterations;
  match.reason = fit.reason;
  match.converged = fit.reason == ScanMatch::Reason::kConverged;
  match.pose = match.converged ? to_world(fit.pose, grid, margin_cells) : guess;
  if (!match.converged) {
    return match;
  }
  match.explained = fit.explained;
  match.rms = fit.rms * grid.resolution();
  const double c = std::cos(grid.origin().heading);
  const double s = std::sin(grid.origin().heading);
  Matrix<3, 3> world_from_field;                                           // of small changes
  world_from_field << c * grid.resolution(), -s * grid.resolution(), 0.0,  //
      s * grid.resolution(), c * grid.resolution(), 0.0, 0.0, 0.0, 1.0;
  Matrix<3, 3> field_from_world;
  field_from_world << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, grid.resolution();
  field_from_world /= grid.resolution();
  const auto turned = [&](const Matrix<3, 3>& m) {
    const Matrix<3, 3> t = field_from_world.transpose() * m * field_from_world;
    return Matrix<3, 3>(0.5 * (t + t.transpose()));
  };
  match.information = turned(fit.information);
  if (fit.weak) {
    const Vector<3> weak = world_from_field * *fit.weak;
    match.weak_direction = weak / weak.norm();
  }
  const Matrix<3, 3> all = turned(fit.information + prior.information);
  const double place = 1.0 / std::sqrt(std::max(all(0, 0) + all(1, 1), 1e-12));
  const double turn = 1.0 / std::sqrt(std::max(all(2, 2), 1e-12));
  const Vector<3> scale(place, place, turn);
  const Matrix<3, 3> unit = scale.asDiagonal() * all * scale.asDiagonal();
  const Solver3 eigen(unit);
  if (eigen.eigenvalues()(0) > 1e-9) {  // else a direction is known from neither
    const Vector<3> inverse = eigen.eigenvalues().cwiseInverse();
    const Matrix<3, 3> P = scale.asDiagonal() * eigen.eigenvectors() * inverse.asDiagonal() *
                           eigen.eigenvectors().transpose() * scale.asDiagonal();
    match.covariance = 0.5 * (P + P.transpose());
  }
  return match;
}

}  // namespace locfuse::internal
