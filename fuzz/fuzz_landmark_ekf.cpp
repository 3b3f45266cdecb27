// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "settings.hpp"
#include "support/robot.hpp"

/// LandmarkEkf with arbitrary settings and messages and two known landmarks, one of them exact.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  fuzz::Reader io(data, size);
  LandmarkEkf::Config config;
  fuzz::read_if_unusual(io, config);
  config.max_landmarks = 20;  // more rows than fixed-size matrices hold
  config.known = {{0, {4.0, 3.0}, {}},
                  {1, {-5.0, 6.0}, Matrix<2, 2>(0.01 * Matrix<2, 2>::Identity())}};
  std::optional<LandmarkEkf> made;
  if (!fuzz::returns([&] {
        made.emplace(config, testing::sensor_at({0.2, 0.0, 0.1}), fuzz::read_start(io));
      })) {
    return 0;
  }
  LandmarkEkf& ekf = *made;
  Stamp now = ekf.belief().stamp;
  while (!io.empty()) {
    const std::size_t before = ekf.landmarks().size();
    std::uint8_t call = 0;
    code(io, call, 7);
    bool may_drop = false;
    if (call == 0) {
      std::vector<RangeBearing> sightings;
      std::uint8_t size_and_way = 0;
      code(io, size_and_way, 15);
      for (int i = 0; i < size_and_way / 3; ++i) {
        sightings.push_back(fuzz::read<RangeBearing>(io, now));
        sightings.back().stamp = sightings.front().stamp;
      }
      fuzz::call_and_check(ekf, [&](LandmarkEkf& e) {
        const std::vector<Outcome> outcomes =
            e.on_joint(sightings, static_cast<Association>(size_and_way % 3));
        may_drop = fuzz::is_fused(outcomes);
        return outcomes;
      });
    } else {
      const auto message = fuzz::read<Message>(io, now);
      fuzz::call_and_check(ekf, [&](LandmarkEkf& e) {
        const Outcome outcome = e.on(message);
        may_drop = fuzz::is_fused(outcome);
        return outcome;
      });
    }
    fuzz::require(may_drop || ekf.landmarks().size() == before,
                  "a message that is not fused adds and drops no landmark");
  }
  return 0;
}
