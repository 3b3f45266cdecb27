// SPDX-License-Identifier: Apache-2.0
#include "locfuse/smoothing/scan_mapper.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "locfuse/frontends/scan_matcher.hpp"
#include "locfuse/math/chi_squared.hpp"
#include "smoothing/graph_covariance.hpp"
#include "smoothing/scan_chain.hpp"
#include "smoothing/submap.hpp"

namespace locfuse {
namespace {

using internal::GraphCovariance;
using internal::ScanChain;
using internal::ScanFrame;
using internal::ScanNode;
using internal::Submap;

/// Constants of closing loops; docs/map.md. Values without another source are empirical.
struct ScanMapperTuning {
  static constexpr double kPlace = 1.0;    ///< way between two places [m]
  static constexpr double kLoop = 10.0;    ///< way after which a place may be seen again [m]
  static constexpr double kReach = 2.5;    ///< distance of places that see the same [m]
  static constexpr double kSegment = 5.0;  ///< way of which one place is compared [m]
  static constexpr std::size_t kMaxCompared = 40;
  /// What three sigma must be below for a fit from where the place is expected [m], [rad].
  static constexpr double kNear = 0.5;
  static constexpr double kNearTurn = 0.25;
  static constexpr double kMinExplained = 0.6;
  static constexpr double kMinAgreement = 0.8;
  static constexpr double kMinOverlap = 0.3;
  static constexpr double kConfidence = 0.999;
  /// Of a search about one place [m].
  static constexpr double kSearchSigma = 0.7;
  static constexpr double kSearchOff = 1.5;
  static constexpr std::size_t kMaxHypotheses = 3;
  /// Places that agree before they are believed, where it is not known where to expect them.
  static constexpr std::size_t kConfirmed = 4;
  static constexpr double kConfirmedWay = 4.0;  ///< that they span at least [m]
  /// By how much a group of them is more likely than any other that is half as large [nats], and
  /// what it costs if all that both surroundings show contradicts [nats].
  static constexpr double kLead = 2.0;
  static constexpr double kContradiction = 50.0;
  static constexpr double kForgottenWay = 20.0;  ///< after which they count no more [m]
  static constexpr std::size_t kMaxUnsolved = 20;
  static constexpr std::size_t kMaxSubmaps = 64;
};
/// Covariance of what a fit of a loop is off beside its own.
Matrix<3, 3> of_loop() { return Vector<3>(0.02, 0.02, 0.005).cwiseAbs2().asDiagonal(); }

/// A place seen again, if it is one.
struct Hypothesis {
  std::size_t from = 0;  // nodes
  std::size_t to = 0;
  ScanLoop loop;
  Matrix<3, 3> information = Matrix<3, 3>::Zero();
  Pose2 in_world;     // of `to`, by this
  double cost = 0.0;  // negative log of how likely it is
};

class Mapper {
 public:
  Mapper(const ScanMapperConfig& config, ScanChain chain, const ScanMapperProgress& progress)
      : config_(config), chain_(std::move(chain)), progress_(progress) {
    poses_.push_back({});
    for (const ScanNode& node : chain_.nodes) {
      poses_.push_back(config.start.pose * node.pose);
    }
    PoseRelation start{0, 1, config.start.pose};
    start.information = config.onto ? Matrix<3, 3>(config.start.covariance.inverse())
                                    : Matrix<3, 3>(Matrix<3, 3>::Identity() * 1e12);
    relations_.push_back(start);
    for (PoseRelation relation : chain_.relations) {
      ++relation.from;
      ++relation.to;
      relations_.push_back(relation);
    }
    kept_.assign(relations_.size(), true);
    fixed_ = relations_.size();
    double next = 0.0;
    for (std::size_t i = 0; i < chain_.nodes.size(); ++i) {
      if (chain_.nodes[i].path >= next) {
        places_.push_back(i);
        next = chain_.nodes[i].path + ScanMapperTuning::kPlace;
      }
    }
    if (config.onto) {
      matcher_.emplace(config.onto);
    }
    covariance_.emplace(poses_, relations_, kept_);
  }

  void close() {
    for (std::size_t p = 0; p < places_.size(); ++p) {
      close_at(p, p);
      progress_(0.8 * static_cast<double>(p) / static_cast<double>(places_.size()));
    }
    solve();
    pending_.clear();
    for (std::size_t p = 0; p < places_.size(); ++p) {
      close_at(p, places_.size());
      progress_(0.8 + 0.2 * static_cast<double>(p) / static_cast<double>(places_.size()));
    }
    solve();
  }

  ScanMapping result() {
    std::vector<PlacedScan> scans;
    for (std::size_t i = 0; i < chain_.nodes.size(); ++i) {
      for (const PlacedScan& placed : chain_.nodes[i].scans) {
        scans.push_back({placed.scan, at(i) * placed.pose});
      }
    }
    ScanMapping found{draw_grid(scans, config_.resolution_m, config_.onto), {}, {}};
    add_poses(found.poses);
    for (std::size_t k = 0; k < loops_.size(); ++k) {
      found.loops.push_back(loops_[k]);
      found.loops.back().kept = kept_[fixed_ + k];
    }
    found.scans = chain_.frames.size();
    found.keys = chain_.nodes.size();
    found.unmatched = chain_.unmatched;
    found.weak = chain_.weak;
    return found;
  }

 private:
  std::shared_ptr<const Submap> submap(std::size_t node) {
    Used& one = submaps_[node];
    if (!one.submap) {
      one.submap = std::make_shared<const Submap>(chain_, node, config_.drive.scans.map);
    }
    one.last = ++uses_;
    std::shared_ptr<const Submap> found = one.submap;
    if (submaps_.size() > ScanMapperTuning::kMaxSubmaps) {
      submaps_.erase(std::min_element(
          submaps_.begin(), submaps_.end(),
          [](const auto& a, const auto& b) { return a.second.last < b.second.last; }));
    }
    return found;
  }

  [[nodiscard]] const Pose2& at(std::size_t node) const { return poses_[node + 1]; }

  /// Compares a place with those before `end` that are not of the way to it.
  void close_at(std::size_t p, std::size_t end) {
    const std::size_t node = places_[p];
    if (matcher_) {
      place_on_map(node);
    }
    std::vector<std::size_t> others;
    for (std::size_t q = 0; q < end; ++q) {
      if (way_between(node, places_[q]) > ScanMapperTuning::kLoop) {
        others.push_back(places_[q]);
      }
    }
    if (others.empty()) {
      return;
    }
    const std::size_t nearest = *std::min_element(
        others.begin(), others.end(),
        [&](std::size_t a, std::size_t b) { return distance(a, node) < distance(b, node); });
    const Matrix<3, 3> P = covariance_->between(nearest + 1, node + 1);
    const bool is_near = is_expected(P);
    const std::size_t before = pending_.size();
    for (const std::size_t other :
         compared(others, node, (is_near ? 0.0 : 3.0 * sigma_of(P)) + ScanMapperTuning::kReach,
                  is_near ? ScanMapperTuning::kSegment : 1.5 * ScanMapperTuning::kPlace)) {
      if (is_closed(other, node)) {
        continue;
      }
      if (is_near) {
        if (const auto found = fitted(other, node)) {
          take(*found);
        }
      } else {
        search(other, node);
      }
    }
    if (pending_.size() > before) {
      confirm(node);
    }
    if (unsolved_ >=
        std::max(ScanMapperTuning::kMaxUnsolved, loops_.size() / ScanMapperTuning::kMaxUnsolved)) {
      solve();
    }
  }

  [[nodiscard]] double distance(std::size_t a, std::size_t b) const {
    return (at(a).position() - at(b).position()).norm();
  }
  [[nodiscard]] double way_between(std::size_t a, std::size_t b) const {
    return std::abs(chain_.nodes[a].path - chain_.nodes[b].path);
  }

  /// Whether a loop from about the one place to about the other is known.
  [[nodiscard]] bool is_closed(std::size_t from, std::size_t to) const {
    const auto leads_to = [&](std::size_t one, std::size_t other) {
      const auto partners = closed_.find(one);
      return partners != closed_.end() &&
             std::any_of(partners->second.begin(), partners->second.end(), [&](std::size_t end) {
               return way_between(end, other) < ScanMapperTuning::kSegment;
             });
    };
    return leads_to(from, to) || leads_to(to, from);
  }

  [[nodiscard]] static double sigma_of(const Matrix<3, 3>& P) {
    return std::sqrt(
        Eigen::SelfAdjointEigenSolver<Matrix<2, 2>>(P.topLeftCorner<2, 2>()).eigenvalues()(1));
  }

  /// Whether a fit begins where a place is expected, with that covariance.
  [[nodiscard]] static bool is_expected(const Matrix<3, 3>& P) {
    return 3.0 * sigma_of(P) <= ScanMapperTuning::kNear &&
           3.0 * std::sqrt(P(2, 2)) <= ScanMapperTuning::kNearTurn;
  }

  /// Those within reach, the nearest first, of which no two are within `way` of the drive.
  [[nodiscard]] std::vector<std::size_t> compared(std::vector<std::size_t> others, std::size_t node,
                                                  double reach, double way) const {
    others.erase(std::remove_if(others.begin(), others.end(),
                                [&](std::size_t other) { return distance(other, node) > reach; }),
                 others.end());
    std::sort(others.begin(), others.end(),
              [&](std::size_t a, std::size_t b) { return distance(a, node) < distance(b, node); });
    std::vector<std::size_t> chosen;
    for (const std::size_t other : others) {
      const bool is_apart = std::none_of(chosen.begin(), chosen.end(), [&](std::size_t one) {
        return way_between(one, other) < way;
      });
      if (is_apart && chosen.size() < ScanMapperTuning::kMaxCompared) {
        chosen.push_back(other);
      }
    }
    return chosen;
  }

  [[nodiscard]] const LaserScan& scan_of(std::size_t node) const {
    return chain_.nodes[node].scans.front().scan;
  }

  /// The loop that a fit says, if both surroundings agree and it is where it may be.
  [[nodiscard]] std::optional<Hypothesis> judged(std::size_t from, std::size_t to,
                                                 const ScanMatch& match, const Matrix<3, 3>& P) {
    if (!match.converged || match.explained < ScanMapperTuning::kMinExplained) {
      return std::nullopt;
    }
    const Pose2 expected = inverse(at(from)) * at(to);
    const Vector<3> off = local(match.pose, expected);
    const Matrix<3, 3> S = P + of_loop();
    const double squared = off.dot(S.llt().solve(off));
    if (squared > limit_) {
      return std::nullopt;
    }
    const Submap::Agreement found = submap(from)->agreement(*submap(to), match.pose);
    if (found.share < ScanMapperTuning::kMinAgreement ||
        found.overlap < ScanMapperTuning::kMinOverlap) {
      return std::nullopt;
    }
    const ScanLoop loop{chain_.nodes[from].stamp,
                        chain_.nodes[to].stamp,
                        match.pose,
                        match.explained,
                        found.share,
                        false,
                        false};
    return Hypothesis{from,
                      to,
                      loop,
                      internal::less_sure(match.information, of_loop()),
                      at(from) * match.pose,
                      0.5 * squared + ScanMapperTuning::kContradiction * (1.0 - found.share)};
  }

  std::optional<Hypothesis> fitted(std::size_t from, std::size_t to) {
    const Matrix<3, 3> P = covariance_->between(from + 1, to + 1);
    const Matrix<3, 3> prior = P + of_loop();
    return judged(from, to,
                  submap(from)->local().match(scan_of(to), inverse(at(from)) * at(to), prior), P);
  }

  /// Adds where a place may be, seen from another, to what is to be confirmed.
  void search(std::size_t from, std::size_t to) {
    const std::shared_ptr<const Submap> there = submap(from);
    if (!there->grid()) {
      return;
    }
    const Pose2 expected = inverse(at(from)) * at(to);
    Vector<2> about = expected.position();
    if (about.norm() > ScanMapperTuning::kSearchOff) {
      about *= ScanMapperTuning::kSearchOff / about.norm();
    }
    const Matrix<3, 3> P = covariance_->between(from + 1, to + 1);
    const double sigma = std::min(sigma_of(P), ScanMapperTuning::kSearchSigma);
    ScanSearch found;
    try {
      const ScanMatcher matcher(there->grid());
      found = matcher.search(scan_of(to), about, sigma * sigma * Matrix<2, 2>::Identity());
    } catch (const std::invalid_argument&) {  // no wall
      return;
    }
    std::size_t tried = 0;
    for (const ScanHypothesis& one : found.hypotheses) {
      if (tried++ == ScanMapperTuning::kMaxHypotheses) {
        break;
      }
      const ScanMatch match = there->local().match(scan_of(to), one.match.pose);
      if (const auto hypothesis = judged(from, to, match, P)) {
        pending_.push_back(*hypothesis);
      }
    }
  }

  [[nodiscard]] bool agree(const Hypothesis& a, const Hypothesis& b) const {
    const Pose2 by_b = b.in_world * (inverse(at(b.to)) * at(a.to));
    const Vector<3> off = local(by_b, a.in_world);
    return off.head<2>().norm() < 0.3 + 0.02 * way_between(a.to, b.to) && std::abs(off.z()) < 0.1;
  }

  /// Hypotheses that agree with one.
  struct Group {
    std::vector<std::size_t> members;
    std::size_t places = 0;  // of the drive
    double way = 0.0;        // from the first of them to the last [m]
    double cost = 0.0;       // mean over the places of the least of each
  };
  [[nodiscard]] Group group_of(std::size_t one) const {
    Group group;
    std::map<std::size_t, double> costs;  // by place
    for (std::size_t k = 0; k < pending_.size(); ++k) {
      if (agree(pending_[k], pending_[one])) {
        group.members.push_back(k);
        const auto place = costs.emplace(pending_[k].to, pending_[k].cost).first;
        place->second = std::min(place->second, pending_[k].cost);
      }
    }
    group.places = costs.size();
    group.way = chain_.nodes[costs.rbegin()->first].path - chain_.nodes[costs.begin()->first].path;
    for (const auto& [_, cost] : costs) {
      group.cost += cost / static_cast<double>(costs.size());
    }
    return group;
  }

  /// Takes the loops that agree, where they are enough and no others are as likely.
  void confirm(std::size_t node) {
    const double path = chain_.nodes[node].path;
    pending_.erase(std::remove_if(pending_.begin(), pending_.end(),
                                  [&](const Hypothesis& one) {
                                    return path - chain_.nodes[one.to].path >
                                           ScanMapperTuning::kForgottenWay;
                                  }),
                   pending_.end());
    std::vector<Group> groups;
    std::vector<bool> is_grouped(pending_.size(), false);
    for (std::size_t i = 0; i < pending_.size(); ++i) {
      if (pending_[i].to == node && !is_grouped[i]) {
        groups.push_back(group_of(i));
        for (const std::size_t member : groups.back().members) {
          is_grouped[member] = true;
        }
      }
    }
    const auto best =
        std::max_element(groups.begin(), groups.end(), [](const Group& a, const Group& b) {
          return a.places < b.places || (a.places == b.places && a.cost > b.cost);
        });
    const bool is_likeliest = std::all_of(groups.begin(), groups.end(), [&](const Group& other) {
      return &other == &*best || 2 * other.places < best->places ||
             other.cost > best->cost + ScanMapperTuning::kLead;
    });
    if (best->places < ScanMapperTuning::kConfirmed ||
        best->way < ScanMapperTuning::kConfirmedWay || !is_likeliest) {
      return;
    }
    for (const std::size_t i : best->members) {
      take(pending_[i]);
    }
    pending_.clear();
    solve();
  }

  void take(const Hypothesis& one) {
    PoseRelation relation{one.from + 1, one.to + 1, one.loop.motion, one.information, true};
    add(relation, one.loop);
    closed_[one.from].push_back(one.to);
    closed_[one.to].push_back(one.from);
  }

  void add(const PoseRelation& relation, const ScanLoop& loop) {
    relations_.push_back(relation);
    kept_.push_back(true);
    loops_.push_back(loop);
    ++unsolved_;
  }

  /// Where a scan lies on the old map.
  void place_on_map(std::size_t node) {
    if (placed_.count(node) > 0) {
      return;
    }
    const Matrix<3, 3> P = covariance_->of(node + 1) + of_loop();
    ScanMatch match;
    if (is_expected(P)) {
      match = matcher_->refine(scan_of(node), at(node), P);
    } else {
      const ScanSearch found =
          matcher_->search(scan_of(node), at(node).position(), P.topLeftCorner<2, 2>());
      if (found.status == ScanSearch::Status::kReady) {
        match = found.hypotheses.front().match;
      }
    }
    const Vector<3> off = local(match.pose, at(node));
    if (!match.converged || match.explained < ScanMapperTuning::kMinExplained ||
        off.dot(P.llt().solve(off)) > limit_) {
      return;
    }
    placed_.insert(node);
    PoseRelation relation{0, node + 1, match.pose,
                          internal::less_sure(match.information, of_loop()), true};
    add(relation, {0, chain_.nodes[node].stamp, match.pose, match.explained, 0.0, false, true});
  }

  void solve() {
    if (unsolved_ == 0) {
      return;
    }
    const SolvedPoseGraph solved = solve_pose_graph(poses_, relations_, config_.graph);
    poses_ = solved.poses;
    kept_ = solved.kept;
    covariance_.emplace(poses_, relations_, kept_);
    unsolved_ = 0;
  }

  /// Poses of all scans, and between them by wheels whose end is moved to where the scan is.
  void add_poses(std::vector<PoseEstimate>& found) const {
    std::optional<Pose2> before;
    Stamp begin = 0;
    std::optional<std::size_t> of_node;  // whose covariance P_node is
    Matrix<3, 3> P_node = Matrix<3, 3>::Zero();
    for (const ScanFrame& frame : chain_.frames) {
      const Pose2& node = at(frame.node);
      const Pose2 pose = node * frame.in_node;
      if (frame.node != of_node) {
        of_node = frame.node;
        P_node = covariance_->of(frame.node + 1);
      }
      const Matrix<3, 3> P = covariance_after(node, P_node, frame.in_node, frame.covariance);
      const Vector<3> off =
          before ? local(inverse(*before) * pose, frame.way.back().second) : Vector<3>::Zero();
      for (std::size_t i = 0; before && i + 1 < frame.way.size(); ++i) {
        const auto& [stamp, moved] = frame.way[i];
        const double share = seconds_between(begin, stamp) / seconds_between(begin, frame.stamp);
        if (stamp > begin) {
          found.push_back({stamp, *before * retract(moved, share * off), P});
        }
      }
      found.push_back({frame.stamp, pose, P});
      before = pose;
      begin = frame.stamp;
    }
  }

  const ScanMapperConfig& config_;
  ScanChain chain_;
  const ScanMapperProgress& progress_;
  std::vector<Pose2> poses_;             // of the world, then of the nodes
  std::vector<PoseRelation> relations_;  // of the start, the drive, then the loops
  std::vector<bool> kept_;
  // Of the squared error of a loop, in sigmas of where it is expected.
  const double limit_ = chi_squared_quantile(3, ScanMapperTuning::kConfidence);
  std::size_t fixed_ = 0;        // relations that are no loops
  std::vector<ScanLoop> loops_;  // in the order of their relations
  std::vector<std::size_t> places_;
  struct Used {
    std::shared_ptr<const Submap> submap;
    std::size_t last = 0;  // when it was asked for, in uses
  };
  std::map<std::size_t, Used> submaps_;
  std::size_t uses_ = 0;
  std::optional<ScanMatcher> matcher_;
  std::optional<GraphCovariance> covariance_;
  std::vector<Hypothesis> pending_;
  std::map<std::size_t, std::vector<std::size_t>> closed_;  // nodes by those that they lead to
  std::set<std::size_t> placed_;                            // nodes on the old map
  std::size_t unsolved_ = 0;
};

}  // namespace

ScanMapping map_scans(const ScanMapperConfig& config, const std::vector<Message>& messages,
                      const ScanMapperProgress& progress) {
  const auto part = [&](double from, double to) -> ScanMapperProgress {
    return [&progress, from, to](double share) {
      if (progress) {
        progress(from + share * (to - from));
      }
    };
  };
  const ScanMapperProgress chaining = part(0.0, 0.4);
  const ScanMapperProgress closing = part(0.4, 0.95);
  Mapper mapper(config, internal::make_scan_chain(config.drive, messages, chaining), closing);
  mapper.close();
  ScanMapping made = mapper.result();
  part(0.95, 1.0)(1.0);
  return made;
}

}  // namespace locfuse
