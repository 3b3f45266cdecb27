// SPDX-License-Identifier: Apache-2.0
// Ranges from three anchors correct a start that is 36 cm off. Returns 0 on success.
#include <cmath>
#include <locfuse/locfuse.hpp>

int main() {
  const Eigen::Vector3d anchors[] = {{0.0, 0.0, 0.0}, {10.0, 0.0, 0.0}, {0.0, 10.0, 0.0}};
  const Eigen::Vector2d truth(3.0, 4.0);

  std::vector<locfuse::Anchor> map;
  for (const Eigen::Vector3d& position : anchors) {
    map.push_back({static_cast<locfuse::Id>(map.size()), position});
  }
  locfuse::PoseEkf ekf({}, {std::make_shared<locfuse::AnchorMap>(map), {locfuse::Tag{}}},
                       {0, {3.3, 3.8, 0.0}, locfuse::Matrix<3, 3>::Identity()});
  for (int round = 1; round <= 20; ++round) {
    for (const locfuse::Anchor& anchor : map) {
      locfuse::Range z;
      z.stamp = round * 1'000'000;
      z.anchor = anchor.id;
      z.range = (anchor.position.head<2>() - truth).norm();
      if (ekf.on(z).verdict != locfuse::Verdict::kFused) {
        return 1;
      }
    }
  }
#ifdef WITHOUT_CERES
  try {
    (void)locfuse::smooth({}, {}, {}, {});
    return 4;
  } catch (const std::invalid_argument& error) {
    if (std::string(error.what()).find("LOCFUSE_WITH_CERES") == std::string::npos) {
      return 5;
    }
  }
#endif
  // Of a kd-tree, symbols of the PCL libraries must be found, too.
  const auto grid = std::make_shared<locfuse::OccupancyGrid>(
      2, 1, 1.0, locfuse::Pose2{},
      std::vector<locfuse::Cell>{locfuse::Cell::kFree, locfuse::Cell::kOccupied});
  if (locfuse::ScanMap(grid).nearest_by_kdtree({0.5, 0.5}) != 1.0) {
    return 3;
  }
  return (ekf.pose().position() - truth).norm() < 0.02 ? 0 : 2;
}
