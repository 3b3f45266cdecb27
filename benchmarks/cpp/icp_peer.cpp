// SPDX-License-Identifier: Apache-2.0
// PCL's registration headers stay in this file: they take a minute to compile.
#include "icp_peer.hpp"

#include <benchmark/benchmark.h>
#include <pcl/point_types.h>
#include <pcl/registration/icp.h>

#include "scan_room.hpp"

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using locfuse::Pose2;

Cloud::Ptr cloud_of(const locfuse::LaserScan& scan) {
  const Cloud::Ptr cloud(new Cloud);
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const double angle =
        scan.geometry->angle_min + static_cast<double>(i) * scan.geometry->angle_increment;
    cloud->push_back({static_cast<float>(scan.ranges[i] * std::cos(angle)),
                      static_cast<float>(scan.ranges[i] * std::sin(angle)), 0.0F});
  }
  return cloud;
}

Eigen::Matrix4f matrix_of(const Pose2& pose) {
  const auto c = static_cast<float>(std::cos(pose.heading));
  const auto s = static_cast<float>(std::sin(pose.heading));
  Eigen::Matrix4f T = Eigen::Matrix4f::Identity();
  T.topLeftCorner<2, 2>() << c, -s, s, c;
  T(0, 3) = static_cast<float>(pose.x);
  T(1, 3) = static_cast<float>(pose.y);
  return T;
}

void pcl_icp(benchmark::State& state) {
  const locfuse::testing::ScanRoom room = locfuse::testing::scan_room();
  const Cloud::Ptr map(new Cloud);
  for (const locfuse::Vector<2>& p : room.surface) {
    map->push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F});
  }
  pcl::IterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> icp;
  icp.setInputTarget(map);
  icp.setMaxCorrespondenceDistance(1.0);
  icp.setMaximumIterations(50);
  icp.setTransformationEpsilon(1e-6);
  std::vector<Cloud::Ptr> scans;
  for (const locfuse::LaserScan& scan : room.scans) {
    scans.push_back(cloud_of(scan));
  }
  std::size_t k = 0;
  double squares = 0.0;
  int right = 0;
  int count = 0;
  for (auto _ : state) {
    icp.setInputSource(scans[k]);
    Cloud out;
    icp.align(out, matrix_of(room.guess[k]));
    const Eigen::Matrix4f T = icp.getFinalTransformation();
    const Pose2& truth = room.truth[k];
    const double off =
        std::hypot(static_cast<double>(T(0, 3)) - truth.x, static_cast<double>(T(1, 3)) - truth.y);
    const double turned =
        locfuse::angle_difference(static_cast<double>(std::atan2(T(1, 0), T(0, 0))), truth.heading);
    right += static_cast<int>(off < 0.05 && std::abs(turned) < locfuse::kPi / 180.0);
    squares += off * off;
    ++count;
    k = (k + 1) % scans.size();
  }
  state.counters["within_5cm_1deg"] = static_cast<double>(right) / count;
  state.counters["rmse_m"] = std::sqrt(squares / count);
}

}  // namespace

void register_icp_peer() {
  benchmark::RegisterBenchmark("registration/pcl_icp", pcl_icp)->Unit(benchmark::kMicrosecond);
}
