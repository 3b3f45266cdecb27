// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "settings.hpp"

/// PoseEkf with arbitrary settings and messages, with or without calibration, with any noise shape.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  fuzz::Reader io(data, size);
  PoseEkf::Config config;
  fuzz::read_if_unusual(io, config);
  code(io, config);
  const PoseEstimate start = fuzz::read_start(io);
  std::optional<PoseEkf> made;
  if (!fuzz::returns([&] {
        made.emplace(config,
                     World{testing::hall(), testing::one_tag(), {fuzz::poles(), {0.2, 0.0, 0.1}}},
                     start);
      })) {
    return 0;
  }
  PoseEkf& ekf = *made;
  Stamp now = ekf.belief().stamp;
  while (!io.empty()) {
    std::uint8_t call = 0;
    code(io, call, 10);
    if (call == 0) {
      std::vector<RangeBearing> sightings;
      std::uint8_t size_and_way = 0;
      code(io, size_and_way, 15);
      for (int i = 0; i < size_and_way / 3; ++i) {
        sightings.push_back(fuzz::read<RangeBearing>(io, now));
        sightings.back().stamp = sightings.front().stamp;
      }
      fuzz::call_and_check(ekf, [&](PoseEkf& e) {
        return e.on_joint(sightings, static_cast<Association>(size_and_way % 3));
      });
    } else if (call == 1) {
      std::vector<Range> epoch(2);
      for (Range& range : epoch) {
        code(io, range, now);
        range.stamp = epoch.front().stamp;
      }
      fuzz::call_and_check(ekf, [&](PoseEkf& e) { return e.on_joint(epoch); });
    } else {
      const auto message = fuzz::read<Message>(io, now);
      fuzz::call_and_check(ekf, [&](PoseEkf& e) { return e.on(message); });
    }
  }
  return 0;
}
