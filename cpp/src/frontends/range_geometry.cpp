// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/range_geometry.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace locfuse {

namespace {

// A direction is open if its information is below this share of the largest: rounding of a double.
constexpr double kMinInformationShare = 1e-14;

Eigen::MatrixXd information_at(const AnchorTable& anchors, const RangesView& sigma,
                               const Eigen::VectorXd& point) {
  const Eigen::Index n = point.size();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < anchors.size(); ++i) {
    const Eigen::VectorXd d = point - anchors.rows.row(i).head(n).transpose();
    const double height = anchors.height ? *anchors.height - anchors.rows(i, 2) : 0.0;
    const double squared = d.squaredNorm() + height * height;
    const double weight = 1.0 / (sigma(i) * sigma(i));
    if (squared > 0.0) {
      information += weight / squared * d * d.transpose();
    }
  }
  return information;
}

Eigen::MatrixXd bounded_inverse(const Eigen::MatrixXd& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  if (!(values(0) > kMinInformationShare * values(values.size() - 1))) {
    Eigen::MatrixXd open = Eigen::MatrixXd::Zero(information.rows(), information.cols());
    open.diagonal().setConstant(std::numeric_limits<double>::infinity());
    return open;
  }
  const Eigen::MatrixXd P =
      eigen.eigenvectors() * values.cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  return 0.5 * (P + P.transpose());
}

void expect_points(const AnchorTable& anchors, const Eigen::MatrixXd& points) {
  if (points.cols() != anchors.dimensions()) {
    throw std::invalid_argument("points have " + std::to_string(points.cols()) +
                                " coordinates, expected " + std::to_string(anchors.dimensions()));
  }
  if (!(points.array().abs() <= kMaxLength).all()) {
    throw std::invalid_argument("points have a coordinate that is not finite, or over 1e12");
  }
}

}  // namespace

Dilution dilution(const AnchorTable& anchors, const Eigen::VectorXd& point) {
  expect_points(anchors, point.transpose());
  const Eigen::MatrixXd covariance =
      bounded_inverse(information_at(anchors, Eigen::VectorXd::Ones(anchors.size()), point));
  const bool space = point.size() == 3;
  return {std::sqrt(covariance.trace()), std::sqrt(covariance(0, 0) + covariance(1, 1)),
          space ? std::sqrt(covariance(2, 2)) : 0.0};
}

std::vector<Eigen::MatrixXd> cramer_rao(const AnchorTable& anchors, const RangesView& sigma,
                                        const Eigen::MatrixXd& points) {
  validate(anchors, sigma);
  expect_points(anchors, points);
  std::vector<Eigen::MatrixXd> bounds;
  bounds.reserve(static_cast<std::size_t>(points.rows()));
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    bounds.push_back(bounded_inverse(information_at(anchors, sigma, points.row(k).transpose())));
  }
  return bounds;
}

}  // namespace locfuse
