// SPDX-License-Identifier: Apache-2.0
#include "bfl_peer.hpp"

#include <bfl/filter/extendedkalmanfilter.h>
#include <bfl/model/analyticmeasurementmodel_gaussianuncertainty.h>
#include <bfl/model/analyticsystemmodel_gaussianuncertainty.h>
#include <bfl/pdf/analyticconditionalgaussian_additivenoise.h>

#include <memory>

#include "support/allocation_counter.hpp"

namespace {

using BFL::Gaussian;
using MatrixWrapper::ColumnVector;
using MatrixWrapper::Matrix;
using MatrixWrapper::SymmetricMatrix;

Gaussian zero_mean(const SymmetricMatrix& covariance) {
  ColumnVector zero(covariance.rows());
  zero = 0.0;
  return Gaussian(zero, covariance);
}

class Odometry : public BFL::AnalyticConditionalGaussianAdditiveNoise {
 public:
  explicit Odometry(const SymmetricMatrix& Q)
      : AnalyticConditionalGaussianAdditiveNoise(zero_mean(Q), 2) {}
  [[nodiscard]] ColumnVector ExpectedValueGet() const override {
    ColumnVector x = ConditionalArgumentGet(0);
    const ColumnVector& u = ConditionalArgumentGet(1);
    const double c = std::cos(x(3));
    const double s = std::sin(x(3));
    x(1) += c * u(1) - s * u(2);
    x(2) += s * u(1) + c * u(2);
    x(3) += u(3);
    return x;
  }
  [[nodiscard]] Matrix dfGet(unsigned int i) const override {
    Matrix F(3, 3);
    F = 0.0;
    if (i == 0) {
      const ColumnVector& x = ConditionalArgumentGet(0);
      const ColumnVector& u = ConditionalArgumentGet(1);
      const double c = std::cos(x(3));
      const double s = std::sin(x(3));
      F(1, 1) = F(2, 2) = F(3, 3) = 1.0;
      F(1, 3) = -s * u(1) - c * u(2);
      F(2, 3) = c * u(1) - s * u(2);
    }
    return F;
  }
};

class Range : public BFL::AnalyticConditionalGaussianAdditiveNoise {
 public:
  Range(const SymmetricMatrix& R, const double (&anchor)[2])
      : AnalyticConditionalGaussianAdditiveNoise(zero_mean(R), 1), ax_(anchor[0]), ay_(anchor[1]) {}
  [[nodiscard]] ColumnVector ExpectedValueGet() const override {
    ColumnVector z(1);
    const ColumnVector& x = ConditionalArgumentGet(0);
    z(1) = std::sqrt((x(1) - ax_) * (x(1) - ax_) + (x(2) - ay_) * (x(2) - ay_));
    return z;
  }
  [[nodiscard]] Matrix dfGet(unsigned int i) const override {
    Matrix H(1, 3);
    H = 0.0;
    if (i == 0) {
      const ColumnVector& x = ConditionalArgumentGet(0);
      const double r = ExpectedValueGet()(1);
      H(1, 1) = (x(1) - ax_) / r;
      H(1, 2) = (x(2) - ay_) / r;
    }
    return H;
  }

 private:
  double ax_;
  double ay_;
};

}  // namespace

std::size_t run_bfl(const Circle& input, std::vector<double>& estimates) {
  ColumnVector mean(3);
  SymmetricMatrix P(3);
  SymmetricMatrix Q(3);
  SymmetricMatrix R(1);
  P = 0.0;
  Q = 0.0;
  R(1, 1) = Circle::kSigmaRange * Circle::kSigmaRange;
  for (int i = 0; i < 3; ++i) {
    mean(static_cast<unsigned>(i + 1)) = input.start[i];
    P(static_cast<unsigned>(i + 1), static_cast<unsigned>(i + 1)) =
        Circle::kSigmaStart[i] * Circle::kSigmaStart[i];
  }
  const Gaussian prior(mean, P);
  BFL::ExtendedKalmanFilter filter(const_cast<Gaussian*>(&prior));
  Odometry odometry(Q);
  BFL::AnalyticSystemModelGaussianUncertainty system(&odometry);
  std::vector<std::unique_ptr<Range>> densities;
  std::vector<std::unique_ptr<BFL::AnalyticMeasurementModelGaussianUncertainty>> models;
  for (const auto& anchor : Circle::kAnchorXY) {
    densities.push_back(std::make_unique<Range>(R, anchor));
    models.push_back(
        std::make_unique<BFL::AnalyticMeasurementModelGaussianUncertainty>(densities.back().get()));
  }
  const double q0 = std::pow(Circle::kSigmaMotion[0], 2);
  const double q1 = std::pow(Circle::kSigmaMotion[1], 2);
  ColumnVector u(3);
  ColumnVector z(1);
  double heading = input.start[2];
  const std::size_t before = locfuse::testing::allocations();
  for (std::size_t k = 0; k < Circle::kSteps; ++k) {
    const double c = std::cos(heading);
    const double s = std::sin(heading);
    Q(1, 1) = c * c * q0 + s * s * q1;
    Q(1, 2) = Q(2, 1) = c * s * (q0 - q1);
    Q(2, 2) = s * s * q0 + c * c * q1;
    Q(3, 3) = std::pow(Circle::kSigmaMotion[2], 2);
    odometry.AdditiveNoiseSigmaSet(Q);
    for (unsigned i = 0; i < 3; ++i) {
      u(i + 1) = input.u[3 * k + i];
    }
    filter.Update(&system, u);
    for (std::size_t i = 0; i < Circle::kAnchors; ++i) {
      z(1) = input.z[5 * k + i];
      filter.Update(models[i].get(), z);
    }
    const ColumnVector x = filter.PostGet()->ExpectedValueGet();
    heading = x(3);
    for (unsigned i = 0; i < 3; ++i) {
      estimates[3 * k + i] = x(i + 1);
    }
  }
  return locfuse::testing::allocations() - before;
}
