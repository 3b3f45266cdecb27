// SPDX-License-Identifier: Apache-2.0
#include "particles.hpp"
#include "worlds.hpp"

/// Mcl with arbitrary settings and messages, within limits of memory and time.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  fuzz::Reader io(data, size);
  Mcl::Config config = fuzz::few_particles();
  fuzz::read_if_unusual(io, config);
  std::optional<Mcl> mcl;
  if (!fuzz::returns([&] {
        mcl.emplace(config,
                    World{testing::hall(),
                          testing::one_tag(),
                          {fuzz::poles(), {0.2, 0.0, 0.1}},
                          fuzz::small_room()},
                    0);
      })) {
    return 0;
  }
  Stamp now = 0;
  for (int calls = 0; !io.empty() && calls < 40; ++calls) {
    std::uint8_t call = 0;
    code(io, call, 8);
    fuzz::returns([&] {
      if (call == 0) {
        PoseHypothesis hypothesis{fuzz::read_start(io), 0.0};
        code(io, hypothesis.probability, 0.0, 1.0);
        mcl->start_at({hypothesis});
        now = hypothesis.estimate.stamp;
      } else if (call == 1) {
        double share = 0.0;
        code(io, share, 0.0, 1.0);
        mcl->inject(fuzz::read_start(io), share);
      } else if (call < 4) {
        mcl->on(fuzz::read<LaserScan>(io, now));
      } else {
        std::visit([&](const auto& message) { mcl->on(message); }, fuzz::read<Message>(io, now));
      }
    });
    fuzz::require_sound(io, *mcl);
  }
  return 0;
}
