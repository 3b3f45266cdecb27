// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "settings.hpp"

/// GyroOdometry with arbitrary settings on arbitrary samples and motions.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  fuzz::Reader io(data, size);
  GyroOdometry::Config config;
  fuzz::read_if_unusual(io, config);
  fuzz::returns([&] {
    GyroOdometry odometry(config);
    const auto require_motion = [&](const std::optional<GyroOdometry::Motion>& motion) {
      if (!motion) {
        return;
      }
      validate(motion->increment);
      fuzz::require(motion->increment.variance.has_value() ==
                        (motion->verdict != GyroOdometry::Verdict::kNoGyro),
                    "a motion by the gyro has a variance, and no other");
    };
    Stamp now = 0;
    while (!io.empty()) {
      fuzz::returns([&] {
        std::uint8_t call = 0;
        code(io, call, 3);
        switch (call) {
          case 0:
            odometry.on(fuzz::read<Imu>(io, now));
            break;
          case 1:
            require_motion(odometry.on(fuzz::read<Velocity>(io, now)));
            break;
          default:
            require_motion(odometry.on(fuzz::read<Increment>(io, now)));
        }
      });
      fuzz::require(std::isfinite(odometry.bias()) && odometry.sigma_bias() >= 0.0,
                    "the bias is finite");
    }
  });
  return 0;
}
