// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "settings.hpp"
#include "support/scrubber.hpp"

namespace {

using namespace locfuse;

/// Whether a message passes the conditioner; replaces a fix by the conditioned one.
bool passes(TagConditioner& conditioner, Message& message) {
  if (const auto* const velocity = std::get_if<Velocity>(&message)) {
    conditioner.on(*velocity);
  } else if (const auto* const increment = std::get_if<Increment>(&message)) {
    conditioner.on(*increment);
  } else if (auto* const received = std::get_if<PositionFix>(&message)) {
    const ConditionedFix conditioned = conditioner.on(*received);
    fuzz::require(conditioned.fix.has_value() == (conditioned.verdict == TagVerdict::kPassed ||
                                                  conditioned.verdict == TagVerdict::kRestarted),
                  "a fix is returned exactly if it passes");
    if (!conditioned.fix) {
      return false;
    }
    fuzz::require(conditioned.fix->position.allFinite(), "a fix that passes is finite");
    *received = *conditioned.fix;
  }
  return true;
}

}  // namespace

/// TagTriangleEkf with arbitrary settings and messages, with known or estimated heading, and with
/// raw or conditioned fixes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Reader io(data, size);
  TagTriangleEkf::Config config;
  fuzz::read_if_unusual(io, config);
  code(io, config.heading_is_known);
  std::optional<TagTriangleEkf> made;
  if (!fuzz::returns([&] {
        made.emplace(config, World{testing::hall(), testing::triangle()}, fuzz::read_start(io));
      })) {
    return 0;
  }
  TagTriangleEkf& ekf = *made;
  std::optional<TagConditioner> conditioner;
  Stamp now = ekf.belief().stamp;
  // Over hours without messages, unmeasured variances exceed those of the sides by all digits.
  for (int calls = 0; !io.empty() && calls < 60; ++calls) {
    std::uint8_t call = 0;
    code(io, call, 8);
    if (call == 0) {
      fuzz::call_and_check(ekf, [](TagTriangleEkf& e) { return e.hold_sides(); });
    } else if (call == 2) {
      TagConditioner::Config settings;
      fuzz::read_if_unusual(io, settings);
      fuzz::returns([&] { conditioner.emplace(settings, testing::triangle()); });
    } else {
      auto message = fuzz::read<Message>(io, now);
      bool passed = !conditioner;
      if (conditioner) {
        fuzz::returns([&] { passed = passes(*conditioner, message); });
      }
      if (passed) {
        fuzz::call_and_check(ekf, [&](TagTriangleEkf& e) { return e.on(message); });
      }
    }
  }
  return 0;
}
