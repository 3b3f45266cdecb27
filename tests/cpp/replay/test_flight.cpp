// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "locfuse/replay/live.hpp"
#include "locfuse/replay/replay.hpp"
#include "support/expect.hpp"
#include "support/flight.hpp"

namespace locfuse::test_flight {
namespace {

using testing::expect_refused;
using testing::kSecond;
using testing::same_bits;

/// A flight by itself, as messages: ranges, altitudes and sightings with elevations.
std::vector<Message> flown(std::uint64_t seed) {
  std::vector<Message> messages;
  for (const auto& one : testing::fly(seed, 20.0, testing::by_itself).messages) {
    std::visit(
        [&](const auto& message) {
          if constexpr (std::is_constructible_v<Message, decltype(message)>) {
            messages.emplace_back(message);
          }
        },
        one);
  }
  return messages;
}

RecoveringEkf unstarted(bool in_space = true) {
  RecoveringEkf::Config config;
  if (in_space) {
    config.tracker = testing::well_informed(AirMotion::kConstantVelocity);
  }
  config.start_height = 3.0;
  return {config,
          {std::make_shared<AnchorMap>(testing::corners()),
           {{0, {0.3, -0.2, -0.1}}},
           {std::make_shared<LandmarkMap>(testing::beacons()), {}}}};
}

PoseEstimate begin() { return {0, {2.0, -1.0, 0.4}, 0.04 * Matrix<3, 3>::Identity()}; }

RecoveringEkf started(bool in_space = true) {
  RecoveringEkf ekf = unstarted(in_space);
  ekf.start_at(begin());
  return ekf;
}

TEST(Flight, late_altitudes_and_elevations_are_fused_where_they_belong) {
  const std::vector<Message> messages = flown(4);
  RecoveringEkf sorted = started();
  for (const Message& message : messages) {
    EXPECT_NE(sorted.on(message).verdict, Verdict::kNotModelled);
  }
  MessageLog log;
  testing::Rng rng(5);
  for (const Message& message : messages) {
    const bool is_late = !std::holds_alternative<Range>(message);
    const double late = is_late ? testing::uniform(rng, 0.3, 0.9) : 0.0;
    log.add(message, stamp_of(message) + testing::at(late));
  }
  log.sort();

  const RunLog run = replay(started(), log, {});
  Live live(started());
  std::vector<std::size_t> fused(kSources, 0);
  for (const MessageLog::Arrival& arrival : log.arrivals()) {
    const Outcome outcome = live.on(arrival.message);
    fused[static_cast<std::size_t>(source_of(arrival.message))] +=
        outcome.verdict == Verdict::kFused ? 1 : 0;
  }

  EXPECT_EQ(fused[static_cast<std::size_t>(Source::kAltitudes)], 20U);
  EXPECT_EQ(fused[static_cast<std::size_t>(Source::kSightings)], 40U);
  ASSERT_FALSE(run.in_space.empty());
  // The order among messages of one stamp differs, so the last digits do.
  EXPECT_NEAR(run.in_space.back().height, sorted.current_in_space()->height, 1e-3);
  EXPECT_EQ(run.in_space.back().height, live.estimator().current_in_space()->height);
  EXPECT_TRUE(same_bits(run.last.covariance, live.estimator().estimate().covariance));
}

TEST(Flight, altitudes_and_elevations_matter) {
  double with = 0.0;
  double without = 0.0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    RecoveringEkf all = started();
    RecoveringEkf ranges = started();
    for (const Message& message : flown(seed)) {
      all.on(message);
      if (std::holds_alternative<Range>(message)) {
        ranges.on(message);
      }
    }
    with += all.current_in_space()->covariance(3, 3);
    without += ranges.current_in_space()->covariance(3, 3);
  }
  EXPECT_LT(with, 0.9 * without);
}

TEST(Flight, a_filter_in_the_plane_models_no_altitude_and_refuses_an_elevation) {
  const Altitude altitude{kSecond, 2.0, {}};
  RangeBearing sighting{kSecond, 0, 9.0, 0.1, {}};
  sighting.elevation = 0.3;
  RecoveringEkf planar = started(false);
  const GaussianBelief before = planar.belief();
  EXPECT_EQ(planar.on(altitude).verdict, Verdict::kNotModelled);
  expect_refused([&] { planar.on(sighting); }, "elevation", "AirEkf");
  expect_refused([&] { (void)planar.on_joint({sighting}); }, "elevation");
  EXPECT_TRUE(same_bits(planar.belief(), before));
  Live live(started(false));
  EXPECT_EQ(live.on(altitude).verdict, Verdict::kNotModelled);
  expect_refused([&] { live.on(sighting); }, "elevation");
  Timeline<RecoveringEkf> timeline(started(false), kSecond);
  const auto sink = [](std::size_t, const Outcome&) {};
  timeline.on(altitude, sink);
  sighting.stamp = 100 * kSecond;  // held, as it is far ahead
  expect_refused([&] { timeline.on(sighting, sink); }, "elevation");
  sighting.stamp = kSecond;
  Live searching(unstarted(false));
  expect_refused([&] { searching.on(sighting); }, "elevation");
  MessageLog log;
  log.add(sighting, kSecond);
  expect_refused([&] { (void)replay(started(false), log, {}); }, "elevation");
}

TEST(Flight, a_search_in_the_plane_leaves_out_what_is_in_space) {
  RecoveringEkf ekf = unstarted();
  RangeBearing sighting{kSecond, 0, 9.0, 0.1, {}};
  sighting.elevation = 0.3;
  EXPECT_EQ(ekf.on(sighting).verdict, Verdict::kIgnored);
  EXPECT_EQ(ekf.on(Altitude{kSecond, 2.0, {}}).verdict, Verdict::kIgnored);
  EXPECT_EQ(ekf.on_joint({sighting}).front().verdict, Verdict::kIgnored);
  sighting.elevation = 2.0;
  expect_refused([&] { ekf.on(sighting); }, "elevation");
  ekf.start_at(begin());
  expect_refused([&] { (void)ekf.on_joint({sighting}); }, "elevation");
}

TEST(Flight, an_elevation_far_ahead_is_held) {
  Timeline<AirEkf> timeline(testing::air_ekf({}, {0, {}, 3.0, Matrix<4, 4>::Identity()}), kSecond);
  const auto sink = [](std::size_t, const Outcome&) {};
  timeline.on(Altitude{kSecond, 3.0, {}}, sink);
  RangeBearing sighting{100 * kSecond, 0, {}, 0.1, {}};
  sighting.elevation = 0.3;
  EXPECT_NO_THROW(timeline.on(sighting, sink));
  EXPECT_EQ(timeline.estimator().belief().stamp, kSecond);
}

TEST(Flight, altitudes_alone_are_no_aiding) {
  RecoveringEkf ekf = started();
  for (int i = 1; i <= 300; ++i) {
    EXPECT_EQ(ekf.on(Altitude{i * kSecond / 10, 3.0, {}}).verdict, Verdict::kFused);
  }
  EXPECT_NEAR(ekf.current_in_space()->height, 3.0, 0.1);
  EXPECT_EQ(ekf.health().state, HealthState::kDeadReckoning);
  ASSERT_EQ(ekf.sources().size(), 1U);
  EXPECT_EQ(ekf.sources().front().source.kind, Source::kAltitudes);
  EXPECT_LT(ekf.sources().front().nis, 0.5);
  EXPECT_NEAR(ekf.sources().front().accepted, 1.0, 1e-9);
}

TEST(Flight, an_altimeter_that_falls_silent_is_reported) {
  RecoveringEkf ekf = started();
  for (int i = 1; i <= 300; ++i) {
    const Stamp stamp = i * kSecond / 10;
    for (const Anchor& a : testing::corners()) {
      const Vector<3> tag(2.0 + 0.3 * std::cos(0.4) + 0.2 * std::sin(0.4),
                          -1.0 + 0.3 * std::sin(0.4) - 0.2 * std::cos(0.4), 2.9);
      ekf.on(Range{stamp, 0, a.id, (tag - a.position).norm(), {}});
    }
    if (i <= 100) {
      ekf.on(Altitude{stamp, 3.05, {}});
    }
    if (i == 100) {
      EXPECT_EQ(ekf.health().state, HealthState::kOk);
    }
  }
  EXPECT_EQ(ekf.health().reason, HealthReason::kSourceIsSilent);
  ASSERT_TRUE(ekf.health().source);
  EXPECT_EQ(ekf.health().source->kind, Source::kAltitudes);
}

}  // namespace
}  // namespace locfuse::test_flight
