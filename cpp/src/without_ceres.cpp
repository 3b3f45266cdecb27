// SPDX-License-Identifier: Apache-2.0
// What needs Ceres, in a build without it: one sentence each.
#include <stdexcept>

#include "locfuse/frontends/range_fit.hpp"
#include "locfuse/smoothing/pose_graph.hpp"
#include "locfuse/smoothing/smoother.hpp"

namespace locfuse {

template <int N>
RangeFit<N> fit_ranges_ceres(const RangeLayout<N>& /*layout*/, const RangesView& /*ranges*/,
                             const Vector<N>& /*start*/, const RangeLoss& /*loss*/,
                             const PositionPrior<N>& /*prior*/, const CeresOptions& /*options*/,
                             std::string* /*termination*/) {
  throw std::invalid_argument(
      "maximum likelihood by Ceres was asked for, but this locfuse is built without Ceres "
      "(LOCFUSE_WITH_CERES=OFF): use ml 'newton'");
}

template RangeFit<2> fit_ranges_ceres<2>(const RangeLayout<2>&, const RangesView&, const Vector<2>&,
                                         const RangeLoss&, const PositionPrior<2>&,
                                         const CeresOptions&, std::string*);
template RangeFit<3> fit_ranges_ceres<3>(const RangeLayout<3>&, const RangesView&, const Vector<3>&,
                                         const RangeLoss&, const PositionPrior<3>&,
                                         const CeresOptions&, std::string*);

Smoothed smooth(const SmootherConfig& /*config*/, const World& /*world*/,
                const PoseEstimate& /*start*/, const std::vector<Message>& /*messages*/) {
  throw std::invalid_argument(
      "smoothing needs Ceres, but this locfuse is built without it (LOCFUSE_WITH_CERES=OFF)");
}

SolvedPoseGraph solve_pose_graph(const std::vector<Pose2>& /*guess*/,
                                 const std::vector<PoseRelation>& /*relations*/,
                                 const PoseGraphConfig& /*config*/) {
  throw std::invalid_argument(
      "pose graphs, and with them maps, need Ceres, but this locfuse is built without it "
      "(LOCFUSE_WITH_CERES=OFF)");
}

}  // namespace locfuse
