// SPDX-License-Identifier: Apache-2.0
// Wheels, fixes of a metre and a compass that nobody aligned: what it reads more is learnt.
#include <cmath>
#include <cstdio>
#include <locfuse/locfuse.hpp>

int main() {
  using namespace locfuse;
  const Matrix<3, 3> vague = Vector<3>(1.0, 1.0, 1.0).asDiagonal();
  PoseEkf ekf({}, {}, {0, {0.0, 0.0, 0.5}, vague});
  double x = 0.0;
  double y = 0.0;
  double heading = 0.0;
  for (int step = 0; step < 600; ++step) {  // ten a second along a circle
    const Stamp now = step * 100'000'000LL;
    ekf.on(Velocity{now, 1.5, 0.1});
    ekf.on(Heading{now, heading + 1.7});
    if (step % 10 == 0) {
      ekf.on(PositionFix{now, {x, y}, Matrix<2, 2>::Identity()});
    }
    x += 0.15 * std::cos(heading + 0.005);
    y += 0.15 * std::sin(heading + 0.005);
    heading += 0.01;
  }
  for (const CalibratedError& error : ekf.errors()) {
    std::printf("%s: %.1f rad\n", error.name.c_str(), error.value);
  }
}
