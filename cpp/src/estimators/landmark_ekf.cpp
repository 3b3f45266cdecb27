// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/landmark_ekf.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "estimators/recipe.hpp"

namespace locfuse {
namespace {

using MapTransaction = internal::Transaction<Eigen::Dynamic>;

int at_least(int least, const char* name, int value) {
  if (value < least) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                                ", expected >= " + std::to_string(least));
  }
  return value;
}

std::string name_of(Id id) { return "landmark " + std::to_string(id); }

bool is_full(const RangeBearing& z) { return z.range && z.bearing; }

/// Numbers a belief's rows anew, so that joint compatibility needs no more of P than they name.
Eigen::MatrixXd compressed(const Covariance& P, Pairings& pairings) {
  std::vector<int> rows;
  for (const std::vector<Pairing>& of_one : pairings) {
    for (const Pairing& pairing : of_one) {
      rows.insert(rows.end(), pairing.rows.begin(), pairing.rows.end());
    }
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  for (std::vector<Pairing>& of_one : pairings) {
    for (Pairing& pairing : of_one) {
      for (int& row : pairing.rows) {
        row = static_cast<int>(std::lower_bound(rows.begin(), rows.end(), row) - rows.begin());
      }
    }
  }
  return P(rows, rows);
}

}  // namespace

LandmarkEkf::Recipe LandmarkEkf::recipe_of(const Config& config, const Pose2& T_body_sensor) {
  validate(config.limits);
  at_least(1, "min_sightings", config.min_sightings);
  at_least(0, "max_landmarks", config.max_landmarks);
  if (config.gate_new < config.landmark.gate) {
    throw std::invalid_argument("gate_new is " + std::to_string(config.gate_new) +
                                ", expected at least landmark.gate, which is " +
                                std::to_string(config.landmark.gate));
  }
  return {config,
          OdometryMotion(config.odometry),
          internal::lost_motion(config),
          RangeBearingModel(config.landmark, T_body_sensor),
          PositionModel(config.position),
          Gate(config.landmark.gate),
          Gate(config.position.gate),
          Gate(config.gate_new),
          internal::hold_of(config),
          internal::stamps_of("confirm_within_s", config.confirm_within_s)};
}

LandmarkEkf::LandmarkEkf(const Config& config, const World& world, const PoseEstimate& start)
    : recipe_(std::make_shared<const Recipe>(recipe_of(config, world.landmarks.T_body_sensor))),
      belief_(GaussianBelief::of_pose(start.stamp, start.pose, start.covariance)),
      body_(belief_.slot("body")),
      odometry_(start.stamp) {
  check_stamp(start.stamp);
  internal::expect_correlated(belief_, config.correlation_s);
  // Whatever maps has odometry: until that comes it stands, or the first landmarks would be vague.
  odometry_.take(Velocity{start.stamp, 0.0, 0.0});
  for (const KnownLandmark& landmark : config.known) {
    add_known(landmark);
  }
}

void LandmarkEkf::add_known(const KnownLandmark& landmark) {
  if (find(landmark.id) >= 0) {
    throw std::invalid_argument(name_of(landmark.id) + " is given twice");
  }
  if (!landmark.position.allFinite()) {
    throw std::invalid_argument(name_of(landmark.id) + " has a position that is not finite");
  }
  Track track{landmark.id, {}, landmark.position, 0, true, belief_.stamp};
  if (landmark.covariance) {
    track.slot = belief_.add(name_of(landmark.id), SlotKind::kPoint2, landmark.position,
                             *landmark.covariance);
  }
  tracks_.push_back(track);
}

Outcome LandmarkEkf::on(const Velocity& u) {
  return internal::take<Eigen::Dynamic>(*recipe_, odometry_, body_, belief_, u);
}

Outcome LandmarkEkf::on(const Increment& u) {
  return internal::take<Eigen::Dynamic>(*recipe_, odometry_, body_, belief_, u);
}

Outcome LandmarkEkf::on(const PositionFix& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (z.stamp < belief_.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  MapTransaction transaction(belief_, z.stamp);
  advance_to(z.stamp);
  const auto lin = internal::of_source(recipe_->config, recipe_->position.linearize(pose(), z),
                                       Source::kPositions);
  if (!lin) {
    return {Verdict::kNotModelled, internal::why_not(recipe_->position, z)};
  }
  const Eigen::VectorXd before = belief_.x;
  const Outcome outcome = update(belief_, *lin, body_, recipe_->position_gate);
  if (outcome.verdict == Verdict::kFused && belief_.dimension() > 3) {
    turn_map_with_mean(belief_, before);
  }
  return transaction.close(outcome);
}

Outcome LandmarkEkf::on(const RangeBearing& z) {
  return on_joint({z}, Association::kNearest).front();
}

Outcome LandmarkEkf::on(const Altitude& z) { return internal::not_used(z); }
Outcome LandmarkEkf::on(const Heading& z) { return internal::not_used(z); }

Outcome LandmarkEkf::on(const Message& message) {
  return internal::dispatch<Range, PoseObservation, LaserScan>(*this, message);
}

std::vector<Outcome> LandmarkEkf::on_joint(const std::vector<RangeBearing>& sightings,
                                           Association association) {
  internal::validate_together("sightings of one instant", sightings);
  if (!internal::are_plausible(sightings, recipe_->config.limits)) {
    return internal::plausible_only(sightings, recipe_->config.limits,
                                    [&](const auto& rest) { return on_joint(rest, association); });
  }
  return internal::in_order(sightings,
                            [&](const auto& sorted) { return fuse_together(sorted, association); });
}

std::vector<Outcome> LandmarkEkf::fuse_together(const std::vector<RangeBearing>& sightings,
                                                Association association) {
  std::vector<Outcome> outcomes(sightings.size(),
                                Outcome{Verdict::kStale, Reason::kBeforeEstimate});
  if (sightings.empty() || sightings.front().stamp < belief_.stamp) {
    return outcomes;
  }
  MapTransaction transaction(belief_, sightings.front().stamp);
  advance_to(sightings.front().stamp);
  const std::vector<int> tracks = associated(sightings, association);
  std::vector<bool> seen(tracks_.size(), false);
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (tracks[i] >= 0) {
      const auto track = static_cast<std::size_t>(tracks[i]);
      outcomes[i] = transaction.close(
          internal::one_of_several([&] { return correct(tracks_[track], sightings[i]); }));
      seen[track] = true;
    }
  }
  // What is new is judged and placed from the pose that what is known has corrected.
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (tracks[i] < 0) {
      outcomes[i] = transaction.close(
          internal::one_of_several([&] { return unexplained(sightings[i], seen); }));
      seen.resize(tracks_.size(), true);  // what was added now was seen now
    }
  }
  const auto fused = [](const Outcome& outcome) { return outcome.verdict == Verdict::kFused; };
  if (std::any_of(outcomes.begin(), outcomes.end(), fused)) {
    drop_tentative();
  }
  return outcomes;
}

/// For each sighting the confirmed landmark that it is of, or -1.
std::vector<int> LandmarkEkf::associated(const std::vector<RangeBearing>& sightings,
                                         Association association) const {
  Pairings pairings = candidates(sightings);
  const Eigen::MatrixXd P = compressed(belief_.P, pairings);
  const Assignment assignment = associate(association, P, pairings, recipe_->config.landmark.gate);
  std::vector<int> tracks(sightings.size(), -1);
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (assignment[i] >= 0) {
      tracks[i] = pairings[i][static_cast<std::size_t>(assignment[i])].landmark;
    }
  }
  return tracks;
}

/// Of each sighting the confirmed landmarks within the gate, nearest first.
Pairings LandmarkEkf::candidates(const std::vector<RangeBearing>& sightings) const {
  Pairings pairings(sightings.size());
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    const RangeBearing& z = sightings[i];
    for (std::size_t k = 0; k < tracks_.size(); ++k) {
      const Track& track = tracks_[k];
      if (!(z.landmark ? *z.landmark == track.id : track.confirmed) || !in_reach(track, z)) {
        continue;
      }
      const std::optional<Sighting> lin = linearize(track, z);
      const Outcome outcome = lin ? compare(track, *lin) : Outcome{};
      if (!lin || !std::isfinite(outcome.nis) || outcome.nis > outcome.limit) {
        continue;
      }
      Pairing pairing;
      pairing.landmark = static_cast<int>(k);
      pairing.rows = {0, 1, 2};
      pairing.nis = outcome.nis;
      pairing.lin.residual = lin->residual;
      pairing.lin.noise = lin->noise;
      pairing.lin.jacobian = lin->jacobian.leftCols(track.slot ? 5 : 3);
      if (track.slot) {
        const int row = belief_.offset(*track.slot);
        pairing.rows.insert(pairing.rows.end(), {row, row + 1});
      }
      pairings[i].push_back(std::move(pairing));
    }
    std::sort(pairings[i].begin(), pairings[i].end(),
              [](const Pairing& a, const Pairing& b) { return a.nis < b.nis; });
  }
  return pairings;
}

Outcome LandmarkEkf::correct(Track& track, const RangeBearing& z) {
  const std::optional<Sighting> lin = linearize(track, z);
  if (!lin) {
    return {Verdict::kNotModelled, Reason::kNoDirection};
  }
  const Eigen::VectorXd before = belief_.x;
  Outcome outcome;
  if (track.slot) {
    outcome = update(belief_, *lin, std::vector<Slot>{body_, *track.slot}, recipe_->landmark_gate);
  } else {
    const Linearization<Eigen::Dynamic, 3, 2> of_pose{lin->residual, lin->jacobian.leftCols<3>(),
                                                      lin->noise, lin->correlation};
    outcome = update(belief_, of_pose, body_, recipe_->landmark_gate);
  }
  if (outcome.verdict == Verdict::kFused) {
    if (belief_.dimension() > 3) {
      turn_map_with_mean(belief_, before);
    } else if (z.bearing) {
      turn_with_mean(belief_, body_, before.head<2>());
    }
    ++track.sightings;
    track.confirmed = true;
  }
  return outcome;
}

/// A sighting that no confirmed landmark was paired with.
Outcome LandmarkEkf::unexplained(const RangeBearing& z, std::vector<bool>& seen) {
  const bool known = z.landmark ? find(*z.landmark) >= 0 : !tracks_.empty();
  if (!is_full(z) || (z.landmark && known)) {
    return known ? Outcome{Verdict::kGated, Reason::kUnlikely}
                 : Outcome{Verdict::kNotModelled, Reason::kIncomplete};
  }
  if (z.landmark) {
    return add(z);
  }
  Match match = nearest(z);
  if (match.track < 0 || match.outcome.nis > recipe_->new_gate.limit(2)) {
    return add(z);
  }
  const auto index = static_cast<std::size_t>(match.track);
  Track& track = tracks_[index];
  const bool fits = match.outcome.nis <= match.outcome.limit;
  if (track.confirmed || seen[index] || !fits) {
    match.outcome.verdict = Verdict::kGated;
    match.outcome.reason = fits ? Reason::kAmbiguous : Reason::kUnlikely;
    return match.outcome;
  }
  seen[index] = true;
  return count(track, z, match.outcome);
}

/// The landmark with the smallest NIS among those in reach, tentative ones as well.
LandmarkEkf::Match LandmarkEkf::nearest(const RangeBearing& z) const {
  Match match;
  for (std::size_t k = 0; k < tracks_.size(); ++k) {
    if (!in_reach(tracks_[k], z)) {
      continue;
    }
    const std::optional<Sighting> lin = linearize(tracks_[k], z);
    if (!lin) {
      continue;
    }
    const Outcome outcome = compare(tracks_[k], *lin);
    if (match.track < 0 || outcome.nis < match.outcome.nis) {
      match = {static_cast<int>(k), outcome};
    }
  }
  return match;
}

Outcome LandmarkEkf::count(Track& track, const RangeBearing& z, Outcome outcome) {
  if (track.sightings + 1 >= recipe_->config.min_sightings) {
    return correct(track, z);
  }
  ++track.sightings;
  outcome.verdict = Verdict::kFused;
  outcome.reason = Reason::kNone;
  return outcome;
}

Outcome LandmarkEkf::add(const RangeBearing& z) {
  const auto in_state = std::count_if(tracks_.begin(), tracks_.end(),
                                      [](const Track& track) { return track.slot.has_value(); });
  const std::optional<RangeBearingModel::Placed> placed = recipe_->landmark.place(pose(), z);
  if (in_state >= recipe_->config.max_landmarks || !placed) {
    return {Verdict::kNotModelled, placed ? Reason::kMapFull : Reason::kNoDirection};
  }
  while (find(unnamed_) >= 0) {
    --unnamed_;
  }
  const Id id = z.landmark.value_or(unnamed_);
  const Matrix<2, 2> R = recipe_->landmark.noise(z);
  const Matrix<2, 2> noise = placed->by_observation * R * placed->by_observation.transpose();
  const Slot slot = augment(belief_, name_of(id), SlotKind::kPoint2, placed->position,
                            placed->by_pose, noise, body_);
  std::optional<Linearization<2, 2>> seen{
      {Vector<2>::Zero(), Matrix<2, 2>(placed->by_observation), R}};
  internal::name_source(recipe_->config, seen, Source::kSightings, id);
  keep_error_of_new(belief_, *seen, slot);
  const bool confirmed = z.landmark || recipe_->config.min_sightings == 1;
  tracks_.push_back({id, slot, placed->position, 1, confirmed, z.stamp});
  unnamed_ -= z.landmark ? 0 : 1;  // no other gets it, even when this one is dropped
  return {Verdict::kFused};
}

void LandmarkEkf::drop_tentative() {
  const auto dropped = [this](const Track& track) {
    return !track.confirmed && belief_.stamp - track.first_seen > recipe_->confirm_within;
  };
  for (const Track& track : tracks_) {
    if (dropped(track)) {
      belief_.remove(*track.slot);
    }
  }
  tracks_.erase(std::remove_if(tracks_.begin(), tracks_.end(), dropped), tracks_.end());
}

int LandmarkEkf::find(Id id) const {
  const auto found = std::find_if(tracks_.begin(), tracks_.end(),
                                  [id](const Track& track) { return track.id == id; });
  return found == tracks_.end() ? -1 : static_cast<int>(found - tracks_.begin());
}

Vector<2> LandmarkEkf::position_of(const Track& track) const {
  return track.slot ? Vector<2>(belief_.x.segment<2>(belief_.offset(*track.slot))) : track.exact;
}

/// Covariance of (x, y, heading) and the landmark's (x, y).
Matrix<5, 5> LandmarkEkf::covariance_with(const Track& track) const {
  Matrix<5, 5> P = Matrix<5, 5>::Zero();
  P.topLeftCorner<3, 3>() = belief_.P.topLeftCorner<3, 3>();
  if (track.slot) {
    const int row = belief_.offset(*track.slot);
    P.bottomLeftCorner<2, 3>() = belief_.P.block<2, 3>(row, 0);
    P.topRightCorner<3, 2>() = P.bottomLeftCorner<2, 3>().transpose();
    P.bottomRightCorner<2, 2>() = belief_.P.block<2, 2>(row, row);
  }
  return P;
}

/// False only where the range alone is beyond the gate of new landmarks, whatever the correlations:
/// eq. (4.6) of docs/models/landmarks.md.
bool LandmarkEkf::in_reach(const Track& track, const RangeBearing& z) const {
  if (!z.range) {
    return true;
  }
  const Pose2 sensor = pose() * recipe_->landmark.T_body_sensor();
  const double squared_arm = recipe_->landmark.T_body_sensor().position().squaredNorm();
  double spread = belief_.P(0, 0) + belief_.P(1, 1) + squared_arm * belief_.P(2, 2);
  if (track.slot) {
    const int row = belief_.offset(*track.slot);
    spread += belief_.P(row, row) + belief_.P(row + 1, row + 1);
  }
  const double variance = 3.0 * spread + recipe_->landmark.noise(z)(0, 0);
  const double off = (position_of(track) - sensor.position()).norm() - *z.range;
  return off * off <= recipe_->new_gate.limit(2) * variance;
}

std::optional<LandmarkEkf::Sighting> LandmarkEkf::linearize(const Track& track,
                                                            const RangeBearing& z) const {
  return internal::of_source(
      recipe_->config, recipe_->landmark.linearize_with_landmark(pose(), position_of(track), z),
      Source::kSightings, track.id);
}

/// How a sighting fits a landmark, all correlations counted; fuses nothing.
Outcome LandmarkEkf::compare(const Track& track, const Sighting& lin) const {
  using Noise = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 2, 2>;
  const Noise S = lin.jacobian * covariance_with(track) * lin.jacobian.transpose() + lin.noise;
  const Eigen::LLT<Noise> factor(S);
  if (factor.info() != Eigen::Success) {
    throw NumericalError("innovation covariance is not positive definite");
  }
  Outcome outcome;
  outcome.dof = static_cast<int>(lin.residual.size());
  outcome.nis = factor.matrixL().solve(lin.residual).squaredNorm();
  outcome.residual = lin.residual(0);
  outcome.scale = std::exp(2.0 * factor.matrixLLT().diagonal().array().log().mean());
  outcome.limit = recipe_->landmark_gate.limit(outcome.dof);
  return outcome;
}

void LandmarkEkf::advance_to(Stamp stamp) {
  internal::advance(*recipe_, odometry_, body_, belief_, stamp);
}

LandmarkEkf LandmarkEkf::continued_at(Stamp stamp) const {
  check_stamp(stamp);
  LandmarkEkf other = *this;
  other.advance_to(std::max(belief_.stamp, odometry_.end()));
  other.belief_.stamp = stamp;
  other.odometry_ = odometry_.restarted(stamp);
  for (Track& track : other.tracks_) {
    track.first_seen = stamp;
  }
  return other;
}

PoseEstimate LandmarkEkf::current() const {
  return {belief_.stamp, pose(), belief_.marginal_of_first<3>()};
}

PoseEstimate LandmarkEkf::estimate() const {
  return estimate(std::max(belief_.stamp, odometry_.end()));
}

PoseEstimate LandmarkEkf::estimate(Stamp stamp) const {
  internal::check_not_before(belief_.stamp, stamp);
  const PoseEstimate now = current();
  // The landmarks do not move: the pose is enough, and its slot has the same id.
  GaussianBelief body = GaussianBelief::of_pose(now.stamp, now.pose, now.covariance);
  internal::advance(*recipe_, odometry_, body_, body, stamp);
  return {body.stamp, body.pose(body_), Matrix<3, 3>(body.P)};
}

std::vector<LandmarkEstimate> LandmarkEkf::landmarks() const {
  std::vector<LandmarkEstimate> all;
  for (const Track& track : tracks_) {
    const Matrix<2, 2> covariance =
        track.slot ? Matrix<2, 2>(belief_.marginal(*track.slot)) : Matrix<2, 2>::Zero();
    all.push_back({track.id, position_of(track), covariance, track.sightings, track.confirmed});
  }
  return all;
}

}  // namespace locfuse
