// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/tag_triangle_ekf.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "estimators/recipe.hpp"
#include "locfuse/error.hpp"
#include "locfuse/frontends/tag_order.hpp"
#include "locfuse/math/symmetric.hpp"

namespace locfuse {
namespace {

constexpr int kTags = TagTriangleEkf::kTags;
constexpr int kVariables = TagTriangleEkf::kVariables;
constexpr int kHalf = kVariables / 2;
constexpr double kMinSideSigma = 1e-4;    // [m]; finer than that 12 variables are not kept positive
constexpr double kMinHeightShare = 0.05;  // height of the triangle as a share of its longest side
constexpr double kMaxTapeSigmas = 3.0;
constexpr Stamp kOdometryTimeout = 1'000'000'000;  // without odometry for longer the sides are due

using Triangle = Matrix<2, kTags>;
template <int M>
using Rows = Linearization<M, kVariables>;
using Fix = Linearization<Eigen::Dynamic, kVariables, 2>;

int after(int tag) { return (tag + 1) % kTags; }

/// A measurement of the variables from `column` on, as one of all twelve.
template <int M, int N>
void place(const Linearization<M, N>& part, int column, Rows<M>& rows) {
  rows.residual = part.residual;
  rows.jacobian.setZero();
  rows.jacobian.template middleCols<N>(column) = part.jacobian;
  rows.noise = part.noise;
}

template <int M, int N>
Rows<M> placed(const Linearization<M, N>& part, int column) {
  Rows<M> rows;
  place(part, column, rows);
  return rows;
}

std::string name_of(const Tag& tag) { return "tag " + std::to_string(tag.id); }

/// The tags in body, one a column. Throws unless they make a triangle: if they lie in one point or
/// on a line, the sides say nothing of where across it a tag is.
Triangle triangle_of(const std::vector<Tag>& tags) {
  if (tags.size() != kTags) {
    throw std::invalid_argument("a triangle got " + std::to_string(tags.size()) +
                                " tags, expected 3");
  }
  Triangle body;
  for (int i = 0; i < kTags; ++i) {
    body.col(i) = tags[static_cast<std::size_t>(i)].position.head<2>();
  }
  const auto tag = [&](int i) { return name_of(tags[static_cast<std::size_t>(i)]); };
  for (int i = 0; i < kTags; ++i) {
    if (!((body.col(i) - body.col(after(i))).norm() > kMinSideSigma)) {
      throw std::invalid_argument(tag(i) + " and " + tag(after(i)) +
                                  " lie in one point of the body's plane, which makes no triangle");
    }
  }
  for (int i = 0; i < kTags; ++i) {
    const Vector<2> side = body.col(after(after(i))) - body.col(after(i));
    const Vector<2> other = body.col(i) - body.col(after(i));
    const double height = std::abs(side.x() * other.y() - side.y() * other.x()) / side.norm();
    if (!(height > kMinHeightShare * std::max(side.norm(), other.norm()))) {
      std::ostringstream text;
      text << tag(i) << " lies " << height << " m from the line through " << tag(after(i))
           << " and " << tag(after(after(i)))
           << ": on a line they make no triangle, expected more than " << kMinHeightShare
           << " of the longest side";
      throw std::invalid_argument(text.str());
    }
  }
  return body;
}

Vector<3> sides_of(const TagTriangleEkf::Config& config, const std::vector<Tag>& tags,
                   const Triangle& body) {
  if (!(config.side.sigma_m >= kMinSideSigma)) {
    throw std::invalid_argument("side.sigma_m is " + std::to_string(config.side.sigma_m) +
                                " m, expected at least 0.0001");
  }
  Vector<3> sides;
  for (int i = 0; i < kTags; ++i) {
    sides(i) = PointDistanceModel::predict(body.col(i), body.col(after(i)));
    if (config.sides_m &&
        !(std::abs((*config.sides_m)(i)-sides(i)) <= kMaxTapeSigmas * config.side.sigma_m)) {
      std::ostringstream text;
      text << "sides_m has " << (*config.sides_m)(i) << " m from "
           << name_of(tags[static_cast<std::size_t>(i)]) << " to "
           << name_of(tags[static_cast<std::size_t>(after(i))]) << ", their places in body "
           << sides(i) << " m; expected the same within " << kMaxTapeSigmas << " side.sigma_m, "
           << kMaxTapeSigmas * config.side.sigma_m << " m";
      throw std::invalid_argument(text.str());
    }
  }
  return sides;
}

/// How the place of a point of the body in world depends on the pose.
Matrix<2, 3> by_pose(const Pose2& pose, const Vector<2>& point) {
  const Vector<2> arm = pose.act(point) - pose.position();
  Matrix<2, 3> J;
  J << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x();
  return J;
}

/// What a pose says of the tags: eq. (7.2) of docs/models/poses.md.
Matrix<6, 6> covariance_of(const Triangle& body, const PoseEstimate& start, double sigma_side) {
  Matrix<6, 3> J;
  for (int i = 0; i < kTags; ++i) {
    J.middleRows<2>(2 * i) = by_pose(start.pose, body.col(i));
  }
  Matrix<6, 6> P = J * start.covariance * J.transpose();
  P.diagonal().array() += sigma_side * sigma_side;
  return 0.5 * (P + P.transpose());
}

/// The part of a fix of each tag, in their order. Throws unless they fit the triangle.
std::vector<PositionFix> in_order(const TagTriangleEkf::Config& config,
                                  const std::vector<Tag>& tags,
                                  const std::vector<PositionFix>& fixes) {
  const TagOrder order = tag_order(tags, fixes, config.position.gate);
  if (order.verdict != TagOrderVerdict::kFits) {
    std::ostringstream text;
    text << "a start: " << to_string(order) << "; sides measured, and of the tags in body [m]:";
    for (int i = 0; i < kTags; ++i) {
      const auto a = static_cast<std::size_t>(i);
      const auto b = static_cast<std::size_t>(after(i));
      const Tags known(tags);
      text << (i > 0 ? "," : "") << " " << *fixes[a].tag << "-" << *fixes[b].tag << " "
           << (fixes[a].position - fixes[b].position).norm() << " and "
           << (known.find(*fixes[a].tag)->position - known.find(*fixes[b].tag)->position)
                  .head<2>()
                  .norm();
    }
    throw std::invalid_argument(text.str());
  }
  std::vector<PositionFix> sorted;
  sorted.reserve(tags.size());
  for (const Tag& tag : tags) {
    sorted.push_back(*std::find_if(fixes.begin(), fixes.end(),
                                   [&](const PositionFix& z) { return z.tag == tag.id; }));
  }
  return sorted;
}

}  // namespace

struct TagTriangleEkf::Recipe {
  Recipe(const Config& given, const World& world)
      : config(given),
        tags(world.tags),
        body(triangle_of(world.tags)),
        lengths(sides_of(given, world.tags, body)),
        motion(given.motion),
        velocity(given.velocity),
        side(given.side),
        range(given.range, internal::anchors_of(world), world.tags),
        position(given.position),
        position_gate(given.position.gate),
        velocity_gate(given.velocity.gate),
        side_gate(given.side.gate),
        range_gate(given.range.gate) {
    validate(config.limits);
    internal::positive("sigma_start_velocity_mps", config.sigma_start_velocity_mps);
    for (int i = 0; i < 2 * kTags; ++i) {
      slots.push_back({i});
    }
  }

  /// The place of a tag among the three, or -1.
  [[nodiscard]] int find(Id id) const {
    for (int i = 0; i < kTags; ++i) {
      if (tags.all()[static_cast<std::size_t>(i)].id == id) {
        return i;
      }
    }
    return -1;
  }

  Config config;
  Tags tags;
  Triangle body;
  Vector<3> lengths;
  PointMotion motion;
  VelocityModel velocity;
  PointDistanceModel side;
  RangeModel range;
  PositionModel position;
  Gate position_gate;
  Gate velocity_gate;
  Gate side_gate;
  Gate range_gate;
  std::vector<Slot> slots;
};

/// Puts everything back, bit for bit, unless the message was fused.
class TagTriangleEkf::Transaction {
 public:
  explicit Transaction(TagTriangleEkf& ekf)
      : ekf_(&ekf),
        counted_(ekf.belief_),
        before_(ekf.belief_),
        sides_(ekf.sides_),
        sides_due_(ekf.sides_due_) {}
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  ~Transaction() {
    if (ekf_ != nullptr) {
      ekf_->belief_ = before_.belief();
      ekf_->sides_ = sides_;
      ekf_->sides_due_ = sides_due_;
    }
  }
  [[nodiscard]] Outcome close(Outcome outcome) {
    if (outcome.verdict == Verdict::kFused) {
      ekf_ = nullptr;
      outcome.interventions =
          static_cast<int>(counted_.interventions - before_.belief().interventions);
    }
    return outcome;
  }

 private:
  TagTriangleEkf* ekf_;
  const GaussianBelief& counted_;
  internal::KeptBelief before_;
  Outcome sides_;
  bool sides_due_;
};

TagTriangleEkf::TagTriangleEkf(std::shared_ptr<const Recipe> recipe, Stamp stamp,
                               const Vector<6>& positions, const Matrix<6, 6>& covariance)
    : recipe_(std::move(recipe)) {
  check_stamp(stamp);
  if (!is_covariance(covariance)) {
    throw std::invalid_argument(
        "a start of three tags needs a symmetric positive definite covariance");
  }
  GaussianBelief belief;
  belief.stamp = stamp;
  std::vector<Slot> slots;
  for (int i = 0; i < kTags; ++i) {
    const std::string name = "tag" + std::to_string(i) + ".position";
    const Vector<2> mean = positions.segment<2>(2 * i);
    const Matrix<2, 2> own = covariance.block<2, 2>(2 * i, 2 * i);
    if (i == 0) {
      slots.push_back(belief.add(name, SlotKind::kPoint2, mean, own));
      continue;
    }
    const Eigen::MatrixXd before = covariance.topLeftCorner(2 * i, 2 * i);
    const Eigen::MatrixXd shared = covariance.block(0, 2 * i, 2 * i, 2);
    const Eigen::MatrixXd J = before.llt().solve(shared).transpose();
    const Matrix<2, 2> rest = own - J * shared;
    slots.push_back(
        augment(belief, name, SlotKind::kPoint2, mean, J, 0.5 * (rest + rest.transpose()), slots));
  }
  const double sigma = recipe_->config.sigma_start_velocity_mps;
  for (int i = 0; i < kTags; ++i) {
    slots.push_back(belief.add("tag" + std::to_string(i) + ".velocity", SlotKind::kPoint2,
                               Vector<2>::Zero(), sigma * sigma * Matrix<2, 2>::Identity()));
  }
  internal::expect_correlated(belief, recipe_->config.correlation_s);
  belief_ = std::move(belief);
}

TagTriangleEkf::TagTriangleEkf(const std::shared_ptr<const Recipe>& recipe,
                               const PoseEstimate& start)
    : TagTriangleEkf(
          recipe, start.stamp,
          [&] {
            (void)GaussianBelief::of_pose(start.stamp, start.pose, start.covariance);  // checks
            Vector<6> positions;
            for (int i = 0; i < kTags; ++i) {
              positions.segment<2>(2 * i) = start.pose.act(recipe->body.col(i));
            }
            return positions;
          }(),
          covariance_of(recipe->body, start, recipe->config.side.sigma_m)) {}

TagTriangleEkf::TagTriangleEkf(const Config& config, const World& world, const PoseEstimate& start)
    : TagTriangleEkf(std::make_shared<const Recipe>(config, world), start) {}

TagTriangleEkf TagTriangleEkf::restarted(const PoseEstimate& start) const {
  TagTriangleEkf other(recipe_, start);
  other.belief_.correlated = belief_.correlated.restarted();
  return other;
}

TagTriangleEkf::TagTriangleEkf(const Config& config, const World& world,
                               const std::vector<PositionFix>& start)
    : TagTriangleEkf([&] {
        const auto recipe = std::make_shared<const Recipe>(config, world);
        const std::vector<PositionFix> fixes = in_order(config, world.tags, start);
        Vector<6> positions;
        Matrix<6, 6> covariance = Matrix<6, 6>::Zero();
        for (int i = 0; i < kTags; ++i) {
          const PositionFix& z = fixes[static_cast<std::size_t>(i)];
          positions.segment<2>(2 * i) = z.position;
          covariance.block<2, 2>(2 * i, 2 * i) = z.covariance;
        }
        return TagTriangleEkf(recipe, fixes.front().stamp, positions, covariance);
      }()) {
  (void)hold_sides();
}

const std::vector<Tag>& TagTriangleEkf::tags() const { return recipe_->tags.all(); }

template <class Linearize, class Why>
Outcome TagTriangleEkf::correct(Stamp stamp, const Gate& gate, const Linearize& linearize,
                                const Why& why) {
  if (stamp < belief_.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  Transaction transaction(*this);
  advance_to(stamp);
  const auto lin = linearize();
  const Outcome outcome =
      lin ? update(belief_, *lin, recipe_->slots, gate) : Outcome{Verdict::kNotModelled, why()};
  sides_due_ = sides_due_ || lacks_odometry();
  return transaction.close(outcome);
}

bool TagTriangleEkf::lacks_odometry() const {
  return recipe_->config.holds_sides &&
         (!odometry_until_ || belief_.stamp > *odometry_until_ + kOdometryTimeout);
}

Outcome TagTriangleEkf::on(const PositionFix& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  const int tag = z.tag ? recipe_->find(*z.tag) : -1;
  return correct(
      z.stamp, recipe_->position_gate,
      [&]() -> std::optional<Fix> {
        const auto lin =
            tag < 0 ? std::nullopt : recipe_->position.linearize_point(position(tag), z);
        if (!lin) {
          return std::nullopt;
        }
        Fix rows;
        rows.residual = lin->residual;
        rows.jacobian.setZero(lin->residual.size(), kVariables);
        rows.jacobian.middleCols<2>(2 * tag) = lin->jacobian;
        rows.noise = lin->noise;
        return internal::of_source(recipe_->config, std::optional(rows), Source::kPositions,
                                   *z.tag);
      },
      [&] { return !z.tag    ? Reason::kUnnamed
                   : tag < 0 ? Reason::kUnknownTag
                             : Reason::kNoSigma; });
}

Outcome TagTriangleEkf::on(const Range& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  const int tag = recipe_->find(z.tag);
  return correct(
      z.stamp, recipe_->range_gate,
      [&]() -> std::optional<Rows<1>> {
        const auto lin = tag < 0 ? std::nullopt : recipe_->range.linearize_point(position(tag), z);
        return internal::of_source(recipe_->config,
                                   lin ? std::optional(placed(*lin, 2 * tag)) : std::nullopt,
                                   Source::kRanges, internal::link_of(z));
      },
      [&] { return internal::why_not(recipe_->range, z); });
}

Outcome TagTriangleEkf::on(const Velocity& u) {
  validate(u);
  if (!is_plausible(u, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return take(u.stamp, u.stamp, {u.forward, u.left, u.turn_rate});
}

Outcome TagTriangleEkf::on(const Increment& u) {
  validate(u);
  if (!is_plausible(u, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (u.begin == u.stamp) {
    return u.stamp < belief_.stamp ? Outcome{Verdict::kStale, Reason::kBeforeEstimate}
                                   : Outcome{Verdict::kNotModelled, Reason::kNoDuration};
  }
  const Vector<3> twist = arc_twist(u.motion) / seconds_between(u.begin, u.stamp);
  const Velocity rate{u.stamp, twist.head<2>().norm(), twist.z()};
  if (!is_plausible(rate, recipe_->config.limits)) {  // stamps that jitter give no velocity
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return take(u.begin, u.stamp, twist);
}

Outcome TagTriangleEkf::on(const Altitude& z) { return internal::not_used(z); }
Outcome TagTriangleEkf::on(const Heading& z) { return internal::not_used(z); }

Outcome TagTriangleEkf::on(const Message& message) {
  return internal::dispatch<PoseObservation, RangeBearing, LaserScan>(*this, message);
}

/// Fuses a twist (forward, left, turn rate) that holds from `begin` to `end`, then the sides.
Outcome TagTriangleEkf::take(Stamp begin, Stamp end, const Vector<3>& twist) {
  if (end < belief_.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  Transaction transaction(*this);
  advance_to(begin);
  const RigidFit body = fit();
  if (!std::isfinite(body.pose.heading)) {
    return {Verdict::kNotModelled, Reason::kNoDirection};
  }
  const Vector<kHalf> velocities = belief_.x.tail<kHalf>();
  const double heading = body.pose.heading;
  Rows<kHalf> rows =
      placed(recipe_->velocity.linearize<kHalf>(velocities, heading, twist, recipe_->body), kHalf);
  if (!recipe_->config.heading_is_known) {  // eq. (7.7)
    Vector<kHalf> by_heading;
    for (int i = 0; i < kTags; ++i) {
      const Vector<2> expected = VelocityModel::predict(heading, twist, recipe_->body.col(i));
      by_heading.segment<2>(2 * i) << -expected.y(), expected.x();
    }
    rows.jacobian.leftCols<kHalf>() = -by_heading * pose_by_tags(body.pose).row(2);
  }
  const Outcome outcome = update(belief_, rows, recipe_->slots, recipe_->velocity_gate);
  if (outcome.verdict == Verdict::kFused) {
    (void)hold_sides();
    odometry_until_ = end;
    speed_ = twist.head<2>().norm() + std::abs(twist.z());
  }
  return transaction.close(outcome);
}

/// How the pose of the fit depends on the places of the tags.
Matrix<3, 6> TagTriangleEkf::pose_by_tags(const Pose2& pose) const {
  Matrix<kHalf, 3> J;
  for (int i = 0; i < kTags; ++i) {
    J.middleRows<2>(2 * i) = by_pose(pose, recipe_->body.col(i));
  }
  const Matrix<kHalf, kHalf> P = belief_.P.topLeftCorner<kHalf, kHalf>();
  const Matrix<kHalf, 3> weighted = P.llt().solve(J);
  const Matrix<3, 3> information = J.transpose() * weighted;
  return information.llt().solve(weighted.transpose());
}

Outcome TagTriangleEkf::hold_sides() {
  sides_due_ = false;
  Rows<kTags> rows;
  rows.jacobian.setZero();
  rows.noise.setZero();
  for (int i = 0; i < kTags; ++i) {
    const auto lin = recipe_->side.linearize(position(i), position(after(i)), recipe_->lengths(i));
    if (!lin) {
      return sides_ = {Verdict::kNotModelled, Reason::kNoDirection};
    }
    rows.residual(i) = lin->residual(0);
    rows.jacobian.block<1, 2>(i, 2 * i) = lin->jacobian.head<2>();
    rows.jacobian.block<1, 2>(i, 2 * after(i)) = lin->jacobian.tail<2>();
    rows.noise(i, i) = lin->noise(0);
  }
  return sides_ = update(belief_, rows, recipe_->slots, recipe_->side_gate);
}

void TagTriangleEkf::advance_to(Stamp stamp) {
  check_stamp(stamp);
  if (stamp <= belief_.stamp) {
    return;
  }
  if (sides_due_) {
    (void)hold_sides();
  }
  const Vector<kVariables> x = belief_.x;
  predict(belief_, recipe_->motion.propagate<kVariables>(x, seconds_between(belief_.stamp, stamp)),
          recipe_->slots);
  if (odometry_until_ && stamp <= *odometry_until_ + kOdometryTimeout) {
    const double still = std::max(0.0, 1.0 - speed_ / internal::StandingTuning::kSpeed);
    belief_.correlated.stand(still * seconds_between(belief_.stamp, stamp));
  }
  belief_.stamp = stamp;
}

RigidFit TagTriangleEkf::fit() const {
  Triangle world;
  for (int i = 0; i < kTags; ++i) {
    world.col(i) = position(i);
  }
  const Matrix<kHalf, kHalf> P = belief_.P.topLeftCorner<kHalf, kHalf>();
  return rigid_fit(recipe_->body, world, P);
}

PoseEstimate TagTriangleEkf::current() const {
  if (sides_due_) {
    TagTriangleEkf held = *this;
    (void)held.hold_sides();
    return held.current();
  }
  const RigidFit body = fit();
  if (body.status == RigidFitStatus::kNoDirection || body.status == RigidFitStatus::kNotConverged) {
    throw NumericalError("the three tags prefer no heading of the body");
  }
  if (belief_.correlated.is_empty()) {
    return {belief_.stamp, body.pose, body.covariance};
  }
  const Matrix<3, 6> G = pose_by_tags(body.pose);
  const Matrix<6, 6> D = belief_.correlated.excess().topLeftCorner<6, 6>();
  return {belief_.stamp, body.pose,
          GaussianBelief::with_excess<3>(body.covariance, G * D * G.transpose())};
}

PoseEstimate TagTriangleEkf::estimate() const {
  return estimate(std::max(belief_.stamp, odometry_until_.value_or(belief_.stamp)));
}

PoseEstimate TagTriangleEkf::estimate(Stamp stamp) const {
  internal::check_not_before(belief_.stamp, stamp);
  TagTriangleEkf ahead = *this;
  ahead.advance_to(stamp);
  return ahead.current();
}

}  // namespace locfuse
