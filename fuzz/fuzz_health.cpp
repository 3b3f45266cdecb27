// SPDX-License-Identifier: Apache-2.0
#include "health.hpp"
#include "messages.hpp"

namespace {

using namespace locfuse;

/// Outcome that a filter could produce; empty if none could.
std::optional<Outcome> read_outcome(fuzz::Reader& io) {
  std::uint8_t verdict = 0;
  std::uint8_t dof = 0;
  Outcome outcome{};
  code(io, verdict, 3);
  code(io, dof, 4);
  code(io, outcome.nis, 0.0, 50.0);
  code(io, outcome.residual, -10.0, 10.0);
  code(io, outcome.scale, 0.0, 10.0);
  outcome.verdict = verdict == 0   ? Verdict::kFused
                    : verdict == 1 ? Verdict::kGated
                                   : Verdict::kStale;
  outcome.dof = dof;
  const bool is_possible = outcome.nis >= 0.0 && std::isfinite(outcome.nis) &&
                           outcome.scale > 0.0 && std::isfinite(outcome.scale) &&
                           std::isfinite(outcome.residual);
  return is_possible ? std::optional(outcome) : std::nullopt;
}

ScanEvidence read_evidence(fuzz::Reader& io, Stamp& now) {
  ScanEvidence scan;
  std::array<std::uint8_t, 5> of_255{};
  code(io, scan.stamp, now);
  for (std::uint8_t& byte : of_255) {
    code(io, byte, 256);
  }
  scan.explained = of_255[0] / 255.0;
  scan.by_chance = of_255[1] / 255.0;
  scan.covered = of_255[2] / 255.0;
  scan.independent = 1.0 + of_255[3];
  scan.novelty = of_255[4] / 255.0;
  return scan;
}

NamedSource read_source(fuzz::Reader& io) {
  std::uint8_t kind = 0;
  NamedSource source;
  code(io, kind, static_cast<int>(kSources));
  code(io, source.name);
  source.kind = static_cast<Source>(kind);
  return source;
}

void send(fuzz::Reader& io, Health& health, std::uint8_t call, Stamp& now) {
  if (call == 0) {
    Stamp stamp = 0;
    double wrong = 0.0;
    code(io, stamp, now);
    code(io, wrong, 0.0, 1.0);
    health.start(stamp, wrong);
  } else if (call == 1) {
    Stamp stamp = 0;
    code(io, stamp, now);
    health.advance(stamp);
  } else if (call == 2) {
    health.record(read_evidence(io, now));
  } else {
    Stamp stamp = 0;
    code(io, stamp, now);
    const NamedSource source = read_source(io);
    constexpr double kLimit = 10.8;
    constexpr double kBreadth = 20.0;
    if (const std::optional<Outcome> outcome = read_outcome(io)) {
      health.record(source, stamp, *outcome, kLimit, kBreadth);
    }
  }
}

}  // namespace

/// Health with arbitrary settings, outcomes and stamps: its probabilities stay in [0, 1], and
/// rejected input does not change its report.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Reader io(data, size);
  Health::Config config;
  code(io, config);
  std::optional<Health> health;
  if (!fuzz::returns([&] { health.emplace(config); })) {
    return 0;
  }
  Stamp now = 0;
  while (!io.empty()) {
    std::uint8_t call = 0;
    code(io, call, 8);
    const HealthReport before = health->report({now, {}, Matrix<3, 3>::Identity()});
    const Stamp then = now;
    if (!fuzz::returns([&] { send(io, *health, call, now); })) {
      const HealthReport after = health->report({then, {}, Matrix<3, 3>::Identity()});
      fuzz::require(before.stamp == after.stamp && before.wrong == after.wrong &&
                        before.within == after.within && before.state == after.state,
                    "rejected input changes nothing");
    }
    fuzz::require_probability(health->wrong(), "the probability of a wrong pose is in [0, 1]");
    fuzz::require_sound(health->sources());
    fuzz::require_sound(health->report({now, {}, Matrix<3, 3>::Identity()}));
  }
  return 0;
}
