// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "settings.hpp"
#include "support/scrubber.hpp"

/// A TagTriangleEkf of any settings, whose heading is taken as known or not, is told anything.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  fuzz::Reader io(data, size);
  TagTriangleEkf::Config config;
  fuzz::read_if_unusual(io, config);
  code(io, config.heading_is_known);
  std::optional<TagTriangleEkf> made;
  if (!fuzz::returns([&] {
        made.emplace(config, testing::triangle(), fuzz::read_start(io), testing::hall());
      })) {
    return 0;
  }
  TagTriangleEkf& ekf = *made;
  Stamp now = ekf.belief().stamp;
  // In hours of silence what nobody measures outgrows the tape's millimetres by all digits.
  for (int calls = 0; !io.empty() && calls < 60; ++calls) {
    std::uint8_t call = 0;
    code(io, call, 8);
    if (call == 0) {
      fuzz::tell(ekf, [](TagTriangleEkf& e) { return e.hold_sides(); });
    } else {
      const auto message = fuzz::read<Message>(io, now);
      fuzz::tell(ekf, [&](TagTriangleEkf& e) { return e.on(message); });
    }
  }
  return 0;
}
