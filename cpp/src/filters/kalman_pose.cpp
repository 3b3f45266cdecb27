// SPDX-License-Identifier: Apache-2.0
// update() for the shapes of a pose.
#include <cmath>

#include "locfuse/filters/kalman.hpp"

namespace locfuse {

namespace {

Outcome update_kept(GaussianBelief& belief, const Linearization<1, 3>& lin, const Gate& gate) {
  const double a = lin.jacobian(0);
  const double b = lin.jacobian(1);
  const double c = lin.jacobian(2);
  double* const P = belief.P.data();  // of a whole belief: without gaps
  const double Ca = P[0] * a + P[1] * b + P[2] * c;
  const double Cb = P[1] * a + P[4] * b + P[5] * c;
  const double Cc = P[2] * a + P[5] * b + P[8] * c;
  const double S = a * Ca + b * Cb + c * Cc + lin.noise(0);
  const Outcome outcome = internal::compare_row(lin.residual(0), S, gate);
  if (outcome.verdict == Verdict::kGated) {
    return outcome;
  }
  const double inverse = 1.0 / S;
  const double Ka = Ca * inverse;
  const double Kb = Cb * inverse;
  const double Kc = Cc * inverse;
  double* const x = belief.x.data();
  const double xa = x[0] + Ka * outcome.residual;
  const double xb = x[1] + Kb * outcome.residual;
  const double xc = x[2] + Kc * outcome.residual;
  const double aa = P[0] - Ka * Ca;
  const double ab = P[1] - Ka * Cb;
  const double ac = P[2] - Ka * Cc;
  const double bb = P[4] - Kb * Cb;
  const double bc = P[5] - Kb * Cc;
  const double cc = P[8] - Kc * Cc;
  const double all = ((xa + xb) + (xc + aa)) + ((ab + ac) + (bb + bc)) + (cc + S);
  if (!std::isfinite(all) || !(aa > 0.0 && bb > 0.0 && cc > 0.0)) {
    internal::refuse_result();
  }
  x[0] = xa;
  x[1] = xb;
  x[2] = xc;
  internal::wrap_angles(belief.x, belief.angle_rows());
  P[0] = aa;
  P[1] = P[3] = ab;
  P[2] = P[6] = ac;
  P[4] = bb;
  P[5] = P[7] = bc;
  P[8] = cc;
  internal::take_correlated(belief, lin, Vector<3>(Ka, Kb, Kc), Matrix<1, 1>(S),
                            internal::kRowsOfWhole<3>.data());
  const auto is_inside = [&](std::size_t row, double variance) {
    const SigmaBounds& bounds = belief.variance_bounds()[row];
    return variance >= bounds.min && variance <= bounds.max;
  };
  if (!is_inside(0, aa) || !is_inside(1, bb) || !is_inside(2, cc) ||
      !internal::is_pose_positive_definite(belief.P)) {
    internal::keep_in_bounds(belief, 0, 3);
  }
  return outcome;
}

}  // namespace

Outcome internal::update_three(GaussianBelief& belief, const Linearization<1, 3>& lin,
                               const Gate& gate) {
  const Matrix<1, 3>& H = lin.jacobian;
  const double R = lin.noise(0);
  const double reach =
      H(0) * H(0) * belief.P(0, 0) + H(1) * H(1) * belief.P(1, 1) + H(2) * H(2) * belief.P(2, 2);
  if (R >= GuardTuning::kMinNoiseShare * (R + reach)) {
    return update_kept(belief, lin, gate);
  }
  return count_fused(belief, update_kept(belief, with_noise_kept(lin, Matrix<1, 1>(reach)), gate));
}

template Outcome update(GaussianBelief&, const Linearization<1, 3>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<2, 3>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 2>&, Slots,
                        const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 3>&, Slots,
                        const Gate&);

}  // namespace locfuse
