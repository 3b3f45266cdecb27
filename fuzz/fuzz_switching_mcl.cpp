// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/switching_mcl.hpp"
#include "particles.hpp"
#include "worlds.hpp"

/// SwitchingMcl with arbitrary messages.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  static const Mcl particles(fuzz::few_particles(),
                             {{}, {}, {fuzz::poles(), {}}, fuzz::small_room()}, 0);
  static const RecoveringEkf uwb({}, {testing::hall(), testing::one_tag()});
  fuzz::Reader io(data, size);
  SwitchingMcl::Config config;
  bool as_usual = true;
  code(io, as_usual);
  if (!as_usual) {
    code(io,
         {&config.sigma_unsure_m, &config.sigma_sure_m, &config.sigma_unsure_rad,
          &config.sigma_sure_rad, &config.elsewhere_m, &config.elsewhere_rad, &config.doubt_s,
          &config.uwb_sigma_m, &config.uwb_sigma_rad, &config.uwb_age_s, &config.uwb_nis},
         0.0, 3.0);
    code(io, config.share, 0.0, 1.0);
  }
  std::optional<SwitchingMcl> robot;
  if (!fuzz::returns([&] {
        const PoseEstimate start = fuzz::read_start(io);
        Mcl started = particles;
        started.start_at({{start, 1.0}});
        RecoveringEkf beside = uwb;
        beside.start_at(start);
        robot.emplace(config, std::move(started), std::move(beside));
      })) {
    return 0;
  }
  Stamp now = robot->mcl().belief().stamp;
  for (int calls = 0; !io.empty() && calls < 60; ++calls) {
    std::uint8_t call = 0;
    code(io, call, 6);
    fuzz::returns([&] {
      if (call == 0) {
        robot->on(fuzz::read<LaserScan>(io, now));
      } else {
        std::visit([&](const auto& message) { robot->on(message); }, fuzz::read<Message>(io, now));
      }
    });
    fuzz::require_sound(io, robot->mcl());
    if (!robot->uwb().is_lost()) {
      fuzz::require_sound(robot->uwb().estimator()->belief());
    }
  }
  return 0;
}
