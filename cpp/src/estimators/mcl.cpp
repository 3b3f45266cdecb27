// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/mcl.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "estimators/outlier.hpp"
#include "locfuse/error.hpp"
#include "locfuse/math/counter_random.hpp"

namespace locfuse {
namespace {

constexpr int kGroup = 8;
constexpr int kMostClusters = 32;
constexpr int kRereads = 10;  // scans that a body reads where it stands when it was just started
constexpr double kTurnPerMetre = 2.0;   // shape of the boxes that particles stand for [rad / m]
constexpr double kFarthest = 0.5;       // driven before particles are moved, for want of a scan [m]
constexpr double kFarthestTurn = 0.3;   // likewise [rad]
constexpr double kLeastSpacing = 1e-6;  // of scans that are news [m, rad]
constexpr int kDraws = 16;              // per particle, of a body that may be anywhere
constexpr int kMostDraws = 1 << 20;
constexpr double kPlacePower = 0.5;     // of a place's weight, by which it gets particles
constexpr double kLeastPlace = 1e-9;    // weight of a place that is given up
constexpr double kCovered = 0.1;        // of the returns, by something right before the laser
constexpr double kMostlyCovered = 0.5;  // likewise: the scan says nothing
const Gate kGate(0.999);                // of what health counts as accepted

double in_range(const char* name, double value, double low, double high) {
  if (!(value >= low && value <= high)) {
    throw std::invalid_argument("Mcl." + std::string(name) + " is " + std::to_string(value) +
                                ", expected " + std::to_string(low) + " to " +
                                std::to_string(high));
  }
  return value;
}

const Mcl::Config& checked(const Mcl::Config& config) {
  in_range("min_particles", config.min_particles, 1, ParticleBelief::kMost);
  in_range("max_particles", config.max_particles, config.min_particles, ParticleBelief::kMost);
  in_range("kld_error", config.kld_error, 1e-6, 1.0);
  in_range("kld_quantile", config.kld_quantile, 0.0, 10.0);
  in_range("beams", config.beams, 1, 100000);
  in_range("independent_beams", config.independent_beams, 1e-3, 1e6);
  in_range("independent_beams_searching", config.independent_beams_searching, 1e-3, 1e6);
  in_range("sigma_map_m", config.sigma_map_m, 0.0, 1e3);
  in_range("sigma_map_rad", config.sigma_map_rad, 0.0, 10.0);
  in_range("refine_up_to", config.refine_up_to, 0, ParticleBelief::kMost);
  in_range("effective_share", config.effective_share, 0.0, 1.0);
  in_range("outlier_share", config.outlier_share, 0.0, 0.999);
  in_range("resample_below", config.resample_below, 0.0, 1.0);
  in_range("spacing_m", config.spacing_m, 0.0, 1e6);
  in_range("spacing_heading_rad", config.spacing_heading_rad, 0.0, 1e6);
  in_range("most_gain", config.most_gain, 0.1, 1e6);
  in_range("most_drop", config.most_drop, 0.0, 1e6);
  in_range("min_explained", config.min_explained, 0.0, 1.0);
  in_range("scouts", config.scouts, 0, 100000);
  in_range("scout_draws", config.scout_draws, config.scouts, ParticleBelief::kMost);
  in_range("kidnapping_probability", config.kidnapping_probability, 0.0, 0.5);
  in_range("hold_s", config.hold_s, 1e-9, 1e9);
  in_range("sigma_lost_xy_per_sqrt_s", config.sigma_lost_xy_per_sqrt_s, 0.0, 1e6);
  in_range("sigma_lost_heading_per_sqrt_s", config.sigma_lost_heading_per_sqrt_s, 0.0, 1e6);
  in_range("probability_ready", config.probability_ready, 0.5, 1.0);
  in_range("sigma_xy_ready_m", config.sigma_xy_ready_m, 0.0, 1e6);
  in_range("sigma_heading_ready_rad", config.sigma_heading_ready_rad, 0.0, 10.0);
  in_range("sigma_widest_m", config.sigma_widest_m, config.field.sigma_hit_m, 1e3);
  in_range("bin_m", config.bin_m, 1e-3, 1e6);
  in_range("bin_headings", config.bin_headings, 1, 3600);
  BeamModel::checked(config.beam_model);
  validate(config.limits);
  return config;
}

/// In single precision, in which particles are kept, more is infinite.
void check_start(const PoseEstimate& start, const Limits& limits) {
  const Vector<3> mean(start.pose.x, start.pose.y, start.pose.heading);
  if (!mean.allFinite() || !start.covariance.allFinite() ||
      start.covariance.llt().info() != Eigen::Success) {
    throw std::invalid_argument(
        "a start has a pose that is not finite or a covariance that is not positive definite");
  }
  const double farthest = std::max(start.pose.position().norm(), start.sigma_position());
  if (!(farthest <= limits.distance_m)) {
    throw std::invalid_argument("a start has a position or its sigma of " +
                                std::to_string(farthest) + " m, expected at most " +
                                std::to_string(limits.distance_m) + " m (limits.distance_m)");
  }
}

OdometryMotion lost_motion(const Mcl::Config& config) {
  OdometryMotion::Config lost = config.odometry;
  lost.sigma_xy_per_sqrt_s = config.sigma_lost_xy_per_sqrt_s;
  lost.sigma_heading_per_sqrt_s = config.sigma_lost_heading_per_sqrt_s;
  return OdometryMotion(lost);
}

/// Appends a motion to one with its covariance, as a pose in the frame where that one began.
void extend(UncertainMotion& so_far, const OdometryMotion& model, const Pose2& motion,
            double seconds) {
  const Propagation<Pose2, 3> step = model.propagate(so_far.motion, motion, seconds);
  so_far.motion = step.moved;
  so_far.covariance = step.jacobian * so_far.covariance * step.jacobian.transpose() + step.noise;
}

std::vector<std::int32_t> free_cells(const OccupancyGrid& grid) {
  std::vector<std::int32_t> free;
  for (std::size_t cell = 0; cell < grid.cells().size(); ++cell) {
    if (grid.cells()[cell] == Cell::kFree) {
      free.push_back(static_cast<std::int32_t>(cell));
    }
  }
  return free;
}

}  // namespace

PoseEstimate Mcl::carried(const PoseEstimate& from, const UncertainMotion& by, Stamp stamp) {
  PoseEstimate to{stamp, from.pose * by.motion,
                  covariance_after(from.pose, from.covariance, by.motion, by.covariance)};
  // A way back takes off what the way there added; what rounding left of both is not known either.
  constexpr double kRounding = 1e-14;
  const double summed = from.covariance.topLeftCorner<2, 2>().trace() +
                        to.covariance.topLeftCorner<2, 2>().trace() +
                        by.motion.position().squaredNorm() * from.covariance(2, 2);
  to.covariance.diagonal().head<2>().array() += kRounding * summed;
  return to;
}

Mcl::Mcl(const Config& config, const std::shared_ptr<const OccupancyGrid>& grid, Stamp start,
         std::shared_ptr<const AnchorMap> anchors, std::vector<Tag> tags, LandmarkSight landmarks)
    : odometry_(start), stamp_(start), health_(config.health) {
  const Config& c = checked(config);
  std::vector<LikelihoodField> fields = LikelihoodField::doubling(c.field, grid, c.sigma_widest_m);
  std::vector<std::int32_t> free = free_cells(*grid);
  std::optional<BeamModel> beams;
  if (c.likelihood == Likelihood::kBeams) {
    beams.emplace(c.beam_model, grid);
  }
  std::optional<RangeModel> range;
  if (anchors) {
    range.emplace(c.range, std::move(anchors), tags);
  }
  recipe_ = std::make_shared<const Recipe>(
      Recipe{c, OdometryMotion(c.odometry), lost_motion(c), std::move(fields), std::move(beams),
             std::move(range), PositionModel(c.position, std::move(tags)), PoseModel(c.pose),
             RangeBearingModel(c.landmark, landmarks.sensor_in_body), std::move(landmarks.map),
             static_cast<Stamp>(c.hold_s * kNanosecondsPerSecond), std::move(free),
             std::make_shared<Workers>(c.threads),
             c.refine_up_to > 0 ? std::make_shared<const ScanMatcher>(grid) : nullptr});
  start_anywhere(start);
}

std::uint64_t Mcl::next_key() { return random_bits(recipe_->config.seed, step_++); }

Pose2 Mcl::to_world(const Pose2& cells) const {
  const Vector<2> p = grid().to_world(cells.position());
  return {p.x(), p.y(), wrap_angle(cells.heading + grid().origin().heading)};
}

Pose2 Mcl::to_cells(const Pose2& world) const {
  const Vector<2> p = grid().to_grid(world.position());
  return {p.x(), p.y(), wrap_angle(world.heading - grid().origin().heading)};
}

/// Turns an error of a pose in cells into one in world.
Matrix<3, 3> Mcl::metres_per_cell() const {
  const double c = grid().resolution() * std::cos(grid().origin().heading);
  const double s = grid().resolution() * std::sin(grid().origin().heading);
  Matrix<3, 3> scale = Matrix<3, 3>::Identity();
  scale.topLeftCorner<2, 2>() << c, -s, s, c;
  return scale;
}

void Mcl::draw_free(ParticleBelief& belief, int k, std::uint64_t key) const {
  const std::uint64_t n = 4 * static_cast<std::uint64_t>(k);
  const auto cell = recipe_->free[static_cast<std::size_t>(
      random_uniform(key, n) * static_cast<double>(recipe_->free.size()))];
  const std::int32_t row = cell / grid().width();
  belief.put(static_cast<std::size_t>(k),
             {cell % grid().width() + random_uniform(key, n + 1), row + random_uniform(key, n + 2),
              2.0 * kPi * random_uniform(key, n + 3)});
}

/// Forgets everything but the seed; particles of equal weight are left to be put somewhere.
void Mcl::begin(Stamp stamp, int particles) {
  check_stamp(stamp);
  belief_.resize(particles);
  belief_.stamp = stamp_ = stamp;
  std::fill(belief_.weight.begin(), belief_.weight.begin() + particles,
            1.0F / static_cast<float>(particles));
  odometry_ = HeldMotion(stamp);
  target_ = recipe_->config.max_particles;
  pending_ = {};
  spread_.setZero();
  scanned_ = tracking_ = searching_ = false;
  rereads_ = kRereads;
  lately_explained_ = 1.0;
  evidence_.clear();
  scouts_ = {};
  level_ = recipe_->fields.size() - 1;
  explained_ = used_share_ = 0.0;
  is_found_ = false;
}

void Mcl::start_anywhere(Stamp stamp) {
  const int most = recipe_->config.max_particles;
  begin(stamp, most < kMostDraws / kDraws ? kDraws * most : std::max(most, kMostDraws));
  searching_ = true;
  const std::uint64_t key = next_key();
  // Boxes of side a and of turn_per_cell a in the heading that fill the free space and all
  // headings.
  belief_.turn_per_cell = kTurnPerMetre * grid().resolution();
  const double space = 2.0 * kPi * static_cast<double>(recipe_->free.size()) / belief_.size;
  const auto box = static_cast<float>(std::cbrt(space / belief_.turn_per_cell));
  recipe_->workers->share(belief_.size, 1, [&](int from, int to) {
    for (int k = from; k < to; ++k) {
      draw_free(belief_, k, key);
      belief_.box[static_cast<std::size_t>(k)] = box;
    }
  });
  summarize();
}

void Mcl::start_at(const std::vector<PoseHypothesis>& hypotheses) {
  double total = 0.0;
  for (const PoseHypothesis& h : hypotheses) {
    check_stamp(h.estimate.stamp);
    check_start(h.estimate, recipe_->config.limits);
    total += h.probability;
    if (!(h.probability > 0.0 && std::isfinite(total)) ||
        h.estimate.stamp != hypotheses.front().estimate.stamp) {
      throw std::invalid_argument("starts need finite probabilities > 0 and one stamp");
    }
  }
  if (hypotheses.empty()) {
    throw std::invalid_argument("there is no pose to start at");
  }
  begin(hypotheses.front().estimate.stamp, recipe_->config.max_particles);
  ++step_;  // so that what is drawn now is what it always was
  const std::uint64_t key = next_key();
  int k = 0;
  double passed = 0.0;
  for (const PoseHypothesis& h : hypotheses) {
    passed += h.probability / total;
    const auto share = static_cast<int>(std::ceil(passed * belief_.size + 1e-9 - 0.5));
    const int end = std::clamp(share, k, belief_.size);
    draw_near(k, end, h.estimate, key);
    k = end;
  }
  summarize();
}

/// Particles begin to end - 1 become draws from a pose.
void Mcl::draw_near(int begin, int end, const PoseEstimate& pose, std::uint64_t key) {
  const Matrix<3, 3> L = pose.covariance.llt().matrixL();
  for (int k = begin; k < end; ++k) {
    const Pose2 drawn = retract(pose.pose, L * random_normal3(key, static_cast<std::uint64_t>(k)));
    belief_.put(static_cast<std::size_t>(k), to_cells(drawn));
  }
}

void Mcl::inject(const PoseEstimate& pose, double share) {
  in_range("inject.share", share, 1e-9, 1.0);
  if (pose.stamp < stamp_) {
    throw std::invalid_argument("a pose is injected at " + std::to_string(pose.stamp) +
                                " ns, before the last message at " + std::to_string(stamp_) +
                                " ns");
  }
  check_start(pose, recipe_->config.limits);
  advance_to(pose.stamp);
  if (share == 1.0) {
    const HeldMotion odometry = odometry_;
    const bool is_found = is_found_;
    start_at({{pose, 1.0}});
    odometry_ = odometry;
    is_found_ = is_found;
    health_.start(pose.stamp);
    return;
  }
  settle();
  const int count = belief_.size;
  const int kept = std::clamp(static_cast<int>(std::lround((1.0 - share) * count)), 1, count);
  resample(belief_, kept, {}, next_key(), scratch_);
  belief_.resize(count);
  draw_near(kept, count, pose, next_key());
  std::fill(belief_.weight.begin(), belief_.weight.begin() + count,
            1.0F / static_cast<float>(count));
  std::fill(belief_.weight.begin() + count, belief_.weight.end(), 0.0F);
  level_ = recipe_->fields.size() - 1;
  tracking_ = false;
  rereads_ = kRereads;
  summarize();
}

void Mcl::start_with(Stamp stamp, const Matrix<4, Eigen::Dynamic>& particles) {
  const double total = particles.row(3).sum();
  const double farthest = recipe_->config.limits.distance_m;
  if (!particles.allFinite() || particles.cols() == 0 || particles.row(3).minCoeff() < 0.0 ||
      !(total > 0.0 && std::isfinite(total)) ||
      particles.topRows<2>().cwiseAbs().maxCoeff() > farthest) {
    throw std::invalid_argument(
        "particles need finite x, y, heading and weight >= 0, some weight > 0, and x and y of at "
        "most " +
        std::to_string(farthest) + " m (limits.distance_m)");
  }
  begin(stamp, static_cast<int>(particles.cols()));
  ++step_;
  for (int k = 0; k < belief_.size; ++k) {
    const Pose2 world{particles(0, k), particles(1, k), wrap_angle(particles(2, k))};
    belief_.put(static_cast<std::size_t>(k), to_cells(world));
    belief_.weight[static_cast<std::size_t>(k)] = static_cast<float>(particles(3, k) / total);
  }
  summarize();
}

void Mcl::advance_to(Stamp stamp) {
  check_stamp(stamp);
  odometry_.advance(
      stamp_, stamp, recipe_->hold,
      [&](const Pose2& motion, Stamp until) { drive(recipe_->motion, motion, until); },
      [&](Stamp until) { drive(recipe_->lost, Pose2{}, until); });
}

void Mcl::drive(const OdometryMotion& model, const Pose2& motion, Stamp until) {
  extend(pending_, model, motion, seconds_between(stamp_, until));
  stamp_ = until;
  since_scan_.x += motion.position().norm();
  since_scan_.heading += std::abs(motion.heading);
  since_judged_ +=
      motion.position().norm() / std::max(recipe_->config.spacing_m, kLeastSpacing) +
      std::abs(motion.heading) / std::max(recipe_->config.spacing_heading_rad, kLeastSpacing);
  if (pending_.motion.position().norm() > kFarthest ||
      std::abs(pending_.motion.heading) > kFarthestTurn) {
    settle();
  }
}

void Mcl::settle(const LaserScan* scan) {
  if (belief_.stamp == stamp_) {
    return;
  }
  const double per_cell = 1.0 / grid().resolution();
  const Vector<3> scale(per_cell, per_cell, 1.0);
  UncertainMotion step = pending_;
  step.motion.x *= per_cell;
  step.motion.y *= per_cell;
  step.covariance = scale.asDiagonal() * step.covariance * scale.asDiagonal();
  if (!(scan != nullptr && settle_by_match(*scan, step.motion))) {
    move(belief_, step, next_key(), *recipe_->workers);
  }
  spread_ += step.covariance.diagonal();
  if (scouts_.size > 0) {  // they find their way by themselves
    move(scouts_, {step.motion, Matrix<3, 3>::Zero()}, next_key(), *recipe_->workers);
  }
  for (PoseHypothesis& h : hypotheses_) {
    h.estimate = carried(h.estimate, pending_, stamp_);
  }
  belief_.stamp = stamp_;
  pending_ = {};
}

Outcome Mcl::on(const Velocity& u) {
  validate(u);
  if (!is_plausible(u, recipe_->config.limits)) {
    return {Verdict::kImplausible};
  }
  if (u.stamp < stamp_) {
    return {Verdict::kStale};
  }
  advance_to(u.stamp);
  odometry_.take(u);
  return {Verdict::kFused};
}

Outcome Mcl::on(const Increment& u) {
  validate(u);
  if (!is_plausible(u, recipe_->config.limits)) {
    return {Verdict::kImplausible};
  }
  if (u.stamp < stamp_) {
    return {Verdict::kStale};
  }
  advance_to(u.begin);
  if (u.begin == u.stamp) {  // a displacement without duration
    drive(recipe_->motion, u.motion, u.stamp);
  }
  odometry_.take(u, recipe_->config.limits);
  return {Verdict::kFused};
}

Outcome Mcl::on(const LaserScan& z) {
  const Config& config = recipe_->config;
  validate(z);
  if (z.stamp < stamp_) {
    return {Verdict::kStale};
  }
  advance_to(z.stamp);
  const ScanEvidence before =
      is_found_ ? evidence_of(z, carried(hypotheses_.front().estimate, pending_, stamp_))
                : ScanEvidence{};
  if (before.covered >= kMostlyCovered) {
    tell(before);
    return {Verdict::kGated};
  }
  const std::optional<LaserScan> clear =
      before.covered > kCovered ? std::optional(uncovered(z)) : std::nullopt;
  const LaserScan& seen = clear ? *clear : z;
  const EndPoints points = recipe_->fields.front().end_points(seen, config.beams);
  const bool moved = !scanned_ || since_scan_.x >= config.spacing_m ||
                     since_scan_.heading >= config.spacing_heading_rad;
  if (points.x.empty() || !(moved || (tracking_ && rereads_ > 0))) {
    tell(before);
    return {Verdict::kNotModelled};
  }
  settle(&seen);
  fit(recipe_->fields[level_], points, belief_);
  const double beams = static_cast<double>(points.x.size());
  scanned_ = true;
  since_scan_ = {};
  // Once found it stays the one to beat, until another is likelier than all else.
  const bool was_tracking = tracking_;
  tracking_ = fits_as_ever() && !health_.is_lost() &&
              (ready() || (tracking_ && hypotheses_.front().probability > 0.5));
  const double independent =
      tracking_ ? config.independent_beams : config.independent_beams_searching;
  const double share = std::min(1.0, independent / beams);
  const double best =
      *std::max_element(log_likelihood_.begin(), log_likelihood_.begin() + belief_.size);
  if (recipe_->beams) {
    fit_beams(seen);
  }
  reweigh_and_resample(share);
  searching_ = searching_ && !tracking_;
  if (is_found_) {
    ScanEvidence after = evidence_of(z, hypotheses_.front().estimate);
    after.news = before.news;
    tell(after);
  }
  const bool sharp = choose_level(points);
  rereads_ = tracking_ && sharp ? 0 : rereads_ - (moved ? 0 : 1);
  challenge(points, share, best, was_tracking && !tracking_);
  if (!is_found_ && ready()) {
    is_found_ = true;
    health_.start(z.stamp, std::max(1.0 - hypotheses_.front().probability, 0.0));
  }
  return {Verdict::kFused};
}

/// Log likelihoods of a scan from each particle, up to a constant.
void Mcl::fit(const LikelihoodField& field, const EndPoints& points, const ParticleBelief& belief) {
  costs_.resize(belief.x.size());
  log_likelihood_.resize(belief.x.size());
  const auto unit = static_cast<float>(field.unit());
  recipe_->workers->share(static_cast<int>(belief.x.size()), kGroup, [&](int begin, int end) {
    field.costs(points, belief.x.data(), belief.y.data(), belief.c.data(), belief.s.data(), begin,
                end, costs_.data());
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      log_likelihood_[k] = -unit * static_cast<float>(costs_[k]);
    }
  });
}

/// Likewise by the beam model, which knows what walls hide.
void Mcl::fit_beams(const LaserScan& scan) {
  const BeamModel& model = *recipe_->beams;
  const Beams beams = model.beams_of(scan, recipe_->config.beams);
  recipe_->workers->share(belief_.size, 1, [&](int begin, int end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      log_likelihood_[k] =
          static_cast<float>(model.log_likelihood(to_world(belief_.pose(k)), beams));
    }
  });
}

/// The sigma under which the scans that were used are the likeliest, seen from the best cluster.
/// Returns whether the field in use is as narrow as that, and the cluster narrower.
bool Mcl::choose_level(const EndPoints& points) {
  const EndPoints seen = points.seen_from(to_cells(hypotheses_.front().estimate.pose));
  const bool first = evidence_.empty();
  std::vector<double> sums(recipe_->fields.size(), 0.0);
  evidence_.resize(sums.size(), 0.0);
  for (std::size_t k = 0; k < seen.x.size(); ++k) {
    for (std::size_t l = 0; l < sums.size(); ++l) {
      sums[l] += recipe_->fields[l].log_density(seen.x[k], seen.y[k]);
    }
  }
  for (std::size_t l = 0; l < evidence_.size(); ++l) {
    const double now = sums[l] / static_cast<double>(points.x.size());
    evidence_[l] = first ? now : evidence_[l] + 0.2 * (now - evidence_[l]);
  }
  const auto likeliest = static_cast<std::size_t>(
      std::max_element(evidence_.begin(), evidence_.end()) - evidence_.begin());
  std::size_t fitting = likeliest;
  // A field narrower than the cluster, or than the particles of other places are apart, would judge
  // by chance: none lies where it is.
  const Matrix<3, 3>& P = hypotheses_.front().estimate.covariance;
  const double spread =
      std::max(std::sqrt(std::max(P(0, 0), P(1, 1))), searching_ ? spacing() : 0.0);
  while (fitting + 1 < recipe_->fields.size() &&
         recipe_->fields[fitting].config().sigma_hit_m < spread) {
    ++fitting;
  }
  level_ = fitting < level_ ? level_ - 1 : fitting;
  explained_ = recipe_->fields.back().explained(seen);
  const double now = *std::max_element(evidence_.begin(), evidence_.end());
  usual_evidence_ = first ? now : usual_evidence_ + 0.02 * (now - usual_evidence_);
  lately_explained_ += 0.1 * (explained_ - lately_explained_);
  return level_ <= likeliest && spread < 0.5 * sigma_hit();
}

/// Whether scans fit where the body is thought to be: as well as usual, and not badly.
bool Mcl::fits_as_ever() const {
  return evidence_.empty() || (lately_explained_ >= recipe_->config.min_explained &&
                               *std::max_element(evidence_.begin(), evidence_.end()) >=
                                   usual_evidence_ - recipe_->config.most_drop);
}

/// A measurement against the likeliest cluster before it: what health hears of it.
template <class Model, class Message>
Outcome Mcl::compare(const Model& model, const Message& z) {
  const PoseEstimate& here = hypotheses_.front().estimate;
  const auto lin = model.linearize(here.pose, z);
  if (!lin) {
    return {Verdict::kFused};
  }
  using Lin = std::decay_t<decltype(*lin)>;
  using Noise = decltype(Lin::noise);
  const Noise S = lin->jacobian * here.covariance * lin->jacobian.transpose() + lin->noise;
  const auto rows = static_cast<int>(lin->residual.size());
  Outcome outcome{Verdict::kFused, rows, squared_mahalanobis(lin->residual, S), lin->residual(0),
                  std::pow(S.determinant(), 1.0 / rows)};
  if (!(outcome.nis >= 0.0 && outcome.scale > 0.0 && std::isfinite(outcome.scale))) {
    throw NumericalError("the innovation covariance is not positive definite");
  }
  if (is_found_) {
    const double limit = kGate.limit(rows);
    Outcome heard = outcome;
    heard.verdict = outcome.nis > limit ? Verdict::kGated : Verdict::kFused;
    health_.hear(named_source_of(z), z.stamp, heard, limit, health_.breadth_of(z));
  }
  return outcome;
}

template <class Model, class Message>
Outcome Mcl::weigh(const Model& model, const Message& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible};
  }
  if (z.stamp < stamp_) {
    return {Verdict::kStale};
  }
  // One pose may have no direction to an anchor; two have none only if the anchor is not known.
  const Pose2 here = hypotheses_.front().estimate.pose;
  const Pose2 beside{here.x + 1.0, here.y, here.heading};
  if (!model.linearize(here, z) && !model.linearize(beside, z)) {
    return {Verdict::kNotModelled};
  }
  advance_to(z.stamp);
  settle();
  const Outcome outcome = compare(model, z);
  const double log_right = std::log1p(-recipe_->config.outlier_share);
  const double log_wrong = std::log(recipe_->config.outlier_share);
  log_likelihood_.resize(belief_.x.size());
  recipe_->workers->share(static_cast<int>(belief_.x.size()), kGroup, [&](int begin, int end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      const auto lin = model.linearize(to_world(belief_.pose(k)), z);
      // An outlier is as likely as what is off by four standard deviations in each row.
      const double floor = -8.0 * static_cast<double>(lin ? lin->residual.size() : 1);
      const double good = lin ? -0.5 * squared_mahalanobis(lin->residual, lin->noise) : floor;
      log_likelihood_[k] =
          static_cast<float>(internal::log_sum(log_right + good, log_wrong + floor));
    }
  });
  reweigh_and_resample(1.0);
  return outcome;
}

namespace {

/// Whichever landmark fits a pose best, or the one that is named.
struct Nearest {
  const RangeBearingModel& model;
  const LandmarkMap& map;
  using Lin = Linearization<Eigen::Dynamic, 3, 2>;
  [[nodiscard]] std::optional<Lin> linearize(const Pose2& pose, const RangeBearing& z) const {
    if (z.landmark) {
      const Landmark* landmark = map.find(*z.landmark);
      return landmark == nullptr ? std::nullopt : model.linearize(pose, landmark->position, z);
    }
    std::optional<Lin> best;
    double least = 0.0;
    for (const Landmark& landmark : map.landmarks()) {
      const std::optional<Lin> lin = model.linearize(pose, landmark.position, z);
      if (!lin) {
        continue;
      }
      const double nis = squared_mahalanobis(lin->residual, lin->noise);
      if (!best || nis < least) {
        best = lin;
        least = nis;
      }
    }
    return best;
  }
};

}  // namespace

Outcome Mcl::on(const RangeBearing& z) {
  if (!recipe_->landmarks) {
    validate(z);
    return {Verdict::kNotModelled};
  }
  return weigh(Nearest{recipe_->landmark, *recipe_->landmarks}, z);
}

Outcome Mcl::on(const Range& z) {
  if (!recipe_->range) {
    validate(z);
    return {Verdict::kNotModelled};
  }
  return weigh(*recipe_->range, z);
}

Outcome Mcl::on(const PositionFix& z) { return weigh(recipe_->position, z); }

Outcome Mcl::on(const PoseObservation& z) { return weigh(recipe_->pose, z); }

void Mcl::reweigh_and_resample(double most_share) {
  const Config& config = recipe_->config;
  used_share_ = reweigh(belief_, log_likelihood_, most_share,
                        config.effective_share * effective_size(belief_));
  if (belief_.size > config.max_particles ||
      effective_size(belief_) < config.resample_below * belief_.size) {
    if (searching_) {
      resample_by_bin(belief_, target_, bins(), kPlacePower, kLeastPlace, next_key(), scratch_);
    } else {
      resample(belief_, target_, {}, next_key(), scratch_);
    }
    if (ready()) {
      roughen();
    }
    if (config.min_particles < config.max_particles) {
      const double wanted =
          kld_particles(occupied_bins(belief_, bins(), 0.0), config.kld_error, config.kld_quantile);
      target_ = static_cast<int>(
          std::min(std::max({wanted, 0.5 * target_, static_cast<double>(config.min_particles)}),
                   static_cast<double>(config.max_particles)));
    }
  }
  summarize();
}

/// Copies of a particle part by the kernel of a density estimate (Silverman), unless they have been
/// moved as far since the last resampling: a body that stands must not be left with one particle.
void Mcl::roughen() {
  const Matrix<3, 3>& P = hypotheses_.front().estimate.covariance;
  const double kernel = std::pow(4.0 / (5.0 * belief_.size), 2.0 / 7.0);
  const double xy = 0.5 * (P(0, 0) + P(1, 1)) / (grid().resolution() * grid().resolution());
  const Vector<3> wanted = kernel * Vector<3>(xy, xy, P(2, 2));
  const Vector<3> missing = (wanted - spread_).cwiseMax(0.0);
  move(belief_, {{}, missing.asDiagonal()}, next_key(), *recipe_->workers);
  spread_.setZero();
}

/// How far the particles of a bin are apart, on average [m].
double Mcl::spacing() const {
  const double per_bin = belief_.size / static_cast<double>(occupied_bins(belief_, bins(), 0.0));
  return recipe_->config.bin_m / std::cbrt(per_bin);
}

ParticleBins Mcl::bins() const {
  return {recipe_->config.bin_m / grid().resolution(),
          static_cast<double>(recipe_->config.bin_headings)};
}

void Mcl::summarize() {
  const std::vector<ParticleCluster> clusters = clusters_of(belief_, bins(), kMostClusters);
  hypotheses_.clear();
  const Matrix<3, 3> to_metres = metres_per_cell();
  const Vector<3> map_sigma(recipe_->config.sigma_map_m, recipe_->config.sigma_map_m,
                            recipe_->config.sigma_map_rad);
  constexpr double kLeast = 1e-6;  // or particles in one place would have no covariance
  const Matrix<3, 3> map_covariance = map_sigma.cwiseMax(kLeast).cwiseAbs2().asDiagonal();
  for (const ParticleCluster& cluster : clusters) {
    const Matrix<3, 3> P = to_metres * cluster.covariance * to_metres.transpose() + map_covariance;
    hypotheses_.push_back(
        {{belief_.stamp, to_world(cluster.mean), 0.5 * (P + P.transpose())}, cluster.weight});
  }
}

bool Mcl::ready() const {
  const Config& config = recipe_->config;
  const PoseHypothesis& best = hypotheses_.front();
  const Matrix<3, 3>& P = best.estimate.covariance;
  return scanned_ && best.probability >= config.probability_ready &&
         std::sqrt(std::max(P(0, 0), P(1, 1))) <= config.sigma_xy_ready_m &&
         std::sqrt(P(2, 2)) <= config.sigma_heading_ready_rad;
}

PoseEstimate Mcl::estimate() const { return carried_on(hypotheses_.front().estimate); }

/// A pose at the belief's stamp, carried to where odometry ends.
PoseEstimate Mcl::carried_on(const PoseEstimate& from) const {
  const Stamp now = std::max(stamp_, odometry_.end());
  UncertainMotion ahead = pending_;
  Stamp at = stamp_;
  odometry_.advance(
      stamp_, now, recipe_->hold,
      [&](const Pose2& motion, Stamp until) {
        extend(ahead, recipe_->motion, motion, seconds_between(at, until));
        at = until;
      },
      [&](Stamp until) {
        extend(ahead, recipe_->lost, Pose2{}, seconds_between(at, until));
        at = until;
      });
  return carried(from, ahead, now);
}

/// Eq. (1) of docs/models/switching_mcl.md.
PoseEstimate Mcl::spread() const {
  const PoseEstimate& best = hypotheses_.front().estimate;
  double total = 0.0;
  Vector<3> mean = Vector<3>::Zero();
  Matrix<3, 3> square = Matrix<3, 3>::Zero();
  for (const PoseHypothesis& cluster : hypotheses_) {
    const Vector<3> off = local(cluster.estimate.pose, best.pose);
    total += cluster.probability;
    mean += cluster.probability * off;
    square += cluster.probability * (cluster.estimate.covariance + off * off.transpose());
  }
  mean /= total;
  const Matrix<3, 3> P = square / total - mean * mean.transpose();
  return carried_on({best.stamp, best.pose, 0.5 * (P + P.transpose())});
}

}  // namespace locfuse
