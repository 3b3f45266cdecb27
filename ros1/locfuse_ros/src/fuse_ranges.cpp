// SPDX-License-Identifier: Apache-2.0
// Node that uses the C++ library directly: subscribes to odometry and UWB ranges, publishes the
// pose of the body in the map. For robots that need no more, and as an example. It requires the
// initial pose ~start. Stamps of odometry must increase; ranges may arrive late.
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <locfuse_msgs/UwbRanges.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>

#include <cmath>
#include <cstdint>
#include <locfuse/locfuse.hpp>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using locfuse::Id;
using locfuse::Stamp;

constexpr Stamp kHistory = 1'000'000'000;  // maximum delay of a range [ns]
constexpr double kDegree = 3.14159265358979323846 / 180.0;

Stamp stamp_of(const ros::Time& time) { return static_cast<Stamp>(time.toNSec()); }

double heading_of(const geometry_msgs::Quaternion& q) {
  return std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
}

// Ids of names, numbered in order of first use.
using Names = std::map<std::string, Id>;

std::vector<double> numbers_of(XmlRpc::XmlRpcValue& value, const std::string& what, int count) {
  if (value.getType() != XmlRpc::XmlRpcValue::TypeArray || value.size() != count) {
    throw std::invalid_argument(what + ": expected a list of " + std::to_string(count) +
                                " numbers");
  }
  std::vector<double> numbers;
  for (int i = 0; i < count; ++i) {
    const bool whole = value[i].getType() == XmlRpc::XmlRpcValue::TypeInt;
    if (!whole && value[i].getType() != XmlRpc::XmlRpcValue::TypeDouble) {
      throw std::invalid_argument(what + ": expected a list of numbers");
    }
    numbers.push_back(whole ? static_cast<int>(value[i]) : static_cast<double>(value[i]));
  }
  return numbers;
}

// Anchors or tags of a parameter {NAME: [x, y, z]}.
template <class Point>
std::vector<Point> points_of(const ros::NodeHandle& own, const std::string& parameter,
                             Names& names) {
  XmlRpc::XmlRpcValue parameter_value;
  if (!own.getParam(parameter, parameter_value) ||
      parameter_value.getType() != XmlRpc::XmlRpcValue::TypeStruct) {
    throw std::invalid_argument("parameter ~" + parameter + ": expected {NAME: [x, y, z]}");
  }
  std::vector<Point> points;
  for (auto& [name, value] : parameter_value) {
    const std::vector<double> at = numbers_of(value, "~" + parameter + "/" + name, 3);
    Point point;
    point.id = names.emplace(name, static_cast<Id>(names.size())).first->second;
    point.position = {at[0], at[1], at[2]};
    points.push_back(point);
  }
  return points;
}

class Node {
 public:
  Node(ros::NodeHandle& node, const ros::NodeHandle& own)
      : map_frame_(own.param<std::string>("map_frame", "map")), start_(estimator(own)) {
    // Without Nagle's algorithm, which delays small messages.
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    pose_ = node.advertise<geometry_msgs::PoseWithCovarianceStamped>("locfuse/pose", 100);
    odometry_ = node.subscribe("odom", 1000, &Node::on_odometry, this, hints);
    ranges_ = node.subscribe("uwb", 1000, &Node::on_ranges, this, hints);
  }

 private:
  locfuse::PoseEkf estimator(const ros::NodeHandle& own) {
    auto anchors = points_of<locfuse::Anchor>(own, "anchors", anchors_);
    auto tags = points_of<locfuse::Tag>(own, "tags", tags_);
    XmlRpc::XmlRpcValue parameter_value;
    if (!own.getParam("start", parameter_value)) {
      throw std::invalid_argument("parameter ~start: expected [x_m, y_m, heading_deg]");
    }
    const std::vector<double> start = numbers_of(parameter_value, "parameter ~start", 3);
    const double sigma = own.param("start_sigma_m", 0.5);
    const double turn = own.param("start_sigma_heading_deg", 10.0) * kDegree;
    const locfuse::Vector<3> variances(sigma * sigma, sigma * sigma, turn * turn);
    locfuse::PoseEkf::Config config;
    config.range.sigma_m = own.param("sigma_range_m", config.range.sigma_m);
    return {config,
            {std::make_shared<const locfuse::AnchorMap>(std::move(anchors)), std::move(tags)},
            {0, {start[0], start[1], start[2] * kDegree}, variances.asDiagonal()}};
  }

  void on_odometry(const nav_msgs::Odometry& message) {
    const geometry_msgs::Pose& pose = message.pose.pose;
    const locfuse::Pose2 now{pose.position.x, pose.position.y, heading_of(pose.orientation)};
    const Stamp stamp = stamp_of(message.header.stamp);
    if (!last_) {
      locfuse::PoseEstimate start = start_.current();
      start.stamp = stamp;
      timeline_.emplace(start_.restarted(start), kHistory);
    } else if (stamp > last_->stamp) {
      fuse(locfuse::Increment{last_->stamp, stamp, inverse(last_->pose) * now});
    } else {
      return;
    }
    last_ = {stamp, now};
    publish();
  }

  void on_ranges(const locfuse_msgs::UwbRanges& message) {
    for (const locfuse_msgs::UwbRange& z : message.ranges) {
      const auto anchor = anchors_.find(z.anchor);
      const auto tag = tags_.find(z.tag);
      if (anchor == anchors_.end() || tag == tags_.end()) {
        ROS_WARN_THROTTLE(
            10.0,
            "range from tag '%s' to anchor '%s' ignored: expected names in ~tags and ~anchors",
            z.tag.c_str(), z.anchor.c_str());
        continue;
      }
      const ros::Time& stamp = z.header.stamp.isZero() ? message.header.stamp : z.header.stamp;
      locfuse::Range range{stamp_of(stamp), tag->second, anchor->second, z.range, {}};
      if (z.sigma > 0.0) {
        range.sigma = z.sigma;
      }
      fuse(range);
    }
  }

  void fuse(const locfuse::Message& message) {
    if (!timeline_) {
      return;
    }
    try {
      timeline_->on(message, [](std::size_t, const locfuse::Outcome&) {});
    } catch (const std::exception& error) {
      ROS_WARN_THROTTLE(1.0, "message ignored: %s", error.what());
    }
  }

  // Publishes the pose at the end of the latest odometry, or at a later range.
  void publish() {
    const locfuse::PoseEstimate estimate = timeline_->estimator().estimate();
    geometry_msgs::PoseWithCovarianceStamped message;
    message.header.stamp.fromNSec(static_cast<std::uint64_t>(estimate.stamp));
    message.header.frame_id = map_frame_;
    message.pose.pose.position.x = estimate.pose.x;
    message.pose.pose.position.y = estimate.pose.y;
    message.pose.pose.orientation.z = std::sin(0.5 * estimate.pose.heading);
    message.pose.pose.orientation.w = std::cos(0.5 * estimate.pose.heading);
    constexpr std::size_t kRow[] = {0, 1, 5};  // rows of x, y and yaw in the 6x6 covariance
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        message.pose.covariance[6 * kRow[i] + kRow[j]] = estimate.covariance(i, j);
      }
    }
    pose_.publish(message);
  }

  struct Last {
    Stamp stamp;
    locfuse::Pose2 pose;
  };

  std::string map_frame_;
  Names anchors_;
  Names tags_;
  locfuse::PoseEkf start_;
  std::optional<locfuse::Timeline<locfuse::PoseEkf>> timeline_;  // created by the first odometry
  std::optional<Last> last_;
  ros::Publisher pose_;
  ros::Subscriber odometry_;
  ros::Subscriber ranges_;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "fuse_ranges");
  ros::NodeHandle node;
  try {
    Node fuser(node, ros::NodeHandle("~"));
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
}
