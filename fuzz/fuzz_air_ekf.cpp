// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "settings.hpp"
#include "support/flight.hpp"

namespace {

using namespace locfuse;

template <class M>
void send(fuzz::Reader& io, AirEkf& ekf, Stamp& now) {
  const M message = fuzz::read<M>(io, now);
  if constexpr (std::is_same_v<M, Velocity> || std::is_same_v<M, Increment>) {
    double climb_rate = 0.0;
    code(io, climb_rate, -3.0, 3.0);
    fuzz::call_and_check(ekf, [&](AirEkf& e) { return e.on(message, climb_rate); });
  } else {
    fuzz::call_and_check(ekf, [&](AirEkf& e) { return e.on(message); });
  }
}

}  // namespace

/// AirEkf with arbitrary settings and messages, with odometry, constant velocity or a sensor.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Reader io(data, size);
  AirEkf::Config config;
  fuzz::read_if_unusual(io, config);
  std::uint8_t motion = 0;
  code(io, motion, 3);
  AirEstimate start;
  Stamp now = 0;
  code(io, start.stamp, now);
  code(io, start.pose, 30.0);
  code(io, start.height, -10.0, 30.0);
  code(io, start.covariance, 10.0);
  config.motion = AirMotion{motion};
  std::optional<AirEkf> ekf;
  if (!fuzz::returns([&] { ekf.emplace(testing::air_ekf(config, start)); })) {
    return 0;
  }
  while (!io.empty()) {
    std::uint8_t call = 0;
    code(io, call, 8);
    using Send = void (*)(fuzz::Reader&, AirEkf&, Stamp&);
    static constexpr Send kSend[] = {send<Velocity>,     send<Increment>, send<Range>,
                                     send<PositionFix>,  send<Altitude>,  send<PoseObservation>,
                                     send<RangeBearing>, send<Imu>};
    kSend[call](io, *ekf, now);
    const Matrix<3, 3> R = ekf->attitude();
    fuzz::require((R * R.transpose() - Matrix<3, 3>::Identity()).norm() < 1e-9,
                  "the attitude is a rotation");
  }
  return 0;
}
