// SPDX-License-Identifier: Apache-2.0
#include <deque>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>

#include "health.hpp"
#include "settings.hpp"
#include "support/discs.hpp"
#include "support/flight.hpp"
#include "support/inertial_flight.hpp"
#include "support/scrubber.hpp"
#include "support/simulation.hpp"

/// Writes a corpus of realistic streams for the fuzz targets: `write_corpus DIR`.
namespace locfuse::fuzz {
namespace {

/// One input file, written on destruction.
class Input {
 public:
  explicit Input(std::filesystem::path file) : file_(std::move(file)) {}
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;
  ~Input() {
    std::filesystem::create_directories(file_.parent_path());
    std::ofstream(file_, std::ios::binary)
        .write(reinterpret_cast<const char*>(io_.bytes().data()),
               static_cast<std::streamsize>(io_.bytes().size()));
  }

  Input& choice(std::uint8_t value) {
    code(io_, value, 256);
    return *this;
  }
  Input& flag(bool value) {
    code(io_, value);
    return *this;
  }
  Input& number(double value, double low, double high) {
    code(io_, value, low, high);
    return *this;
  }
  Input& integer(std::int32_t value) {
    code(io_, value);
    return *this;
  }
  Input& start(PoseEstimate start) {
    code(io_, start);
    return *this;
  }
  template <class T, class... Bounds>
  Input& part(T value, Bounds... bounds) {
    code(io_, value, bounds...);
    return *this;
  }
  /// Default settings, as a flag or number by number.
  template <class... Config>
  Input& settings(bool as_usual) {
    flag(as_usual);
    if (!as_usual) {
      (write_settings(Config{}), ...);
    }
    return *this;
  }
  template <class M>
  Input& message(M message) {
    code(io_, message, now_);
    return *this;
  }

 private:
  template <class Config>
  void write_settings(Config config) {
    code_settings(io_, config);
  }

  std::filesystem::path file_;
  Writer io_;
  Stamp now_ = 0;
};

using Messages = std::vector<Message>;

Messages first(Messages messages, std::size_t count) {
  messages.resize(std::min(messages.size(), count));
  return messages;
}

Messages with_ranges() { return first(testing::simulate(3, 2.0).messages, 40); }

Messages with_tags() {
  testing::Scrubber run;
  testing::drive(run, 1, 5.0);
  return first(run.messages, 40);
}

/// Observations of poles near `start`, with and without ids, during slow motion.
Messages with_landmarks() {
  Messages messages;
  testing::Rng rng(5);
  for (Stamp stamp = testing::kSecond; stamp <= 4 * testing::kSecond; stamp += testing::kSecond) {
    messages.emplace_back(Velocity{stamp, 0.1, 0.02});
    for (const Landmark& pole : poles()->landmarks()) {
      const Vector<2> seen = (inverse(start().pose * Pose2{0.2, 0.0, 0.1})).act(pole.position);
      RangeBearing z;
      z.stamp = stamp;
      if (stamp % (2 * testing::kSecond) == 0) {
        z.landmark = pole.id;
      }
      z.range = seen.norm() + testing::normal(rng, 0.05);
      z.bearing = std::atan2(seen.y(), seen.x()) + testing::normal(rng, 0.01);
      messages.emplace_back(z);
    }
  }
  return messages;
}

/// Position fixes and poses of another localizer around `start`, with one outlier.
Messages with_fixes() {
  Messages messages;
  testing::Rng rng(6);
  for (int i = 1; i <= 8; ++i) {
    const Stamp stamp = i * testing::kSecond / 2;
    PositionFix fix{stamp, start().pose.position(), 0.01 * Matrix<2, 2>::Identity()};
    fix.position.x() += i == 5 ? 20.0 : testing::normal(rng, 0.1);
    messages.emplace_back(fix);
    messages.emplace_back(
        PoseObservation{stamp, start().pose, Vector<3>(0.01, 0.01, 0.001).asDiagonal()});
  }
  return messages;
}

/// Delays every fourth message by three places.
Messages late(Messages messages) {
  for (std::size_t i = 0; i + 3 < messages.size(); i += 4) {
    std::rotate(messages.begin() + static_cast<std::ptrdiff_t>(i),
                messages.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                messages.begin() + static_cast<std::ptrdiff_t>(i) + 4);
  }
  return messages;
}

struct Stream {
  const char* name;
  Messages messages;
};

std::vector<Stream> streams() {
  return {{"ranges", with_ranges()},
          {"tags", with_tags()},
          {"landmarks", with_landmarks()},
          {"fixes", with_fixes()}};
}

LaserScan scan_at(const Pose2& pose, Stamp stamp) {
  testing::Rng rng(7);
  LaserScan scan =
      testing::scan_from(testing::room_around({}), pose, rng, 0.02, testing::laser(60), 60);
  scan.stamp = stamp;
  return scan;
}

/// Default settings, or calibration with every robust noise shape.
PoseEkf::Config settings(bool robust) {
  PoseEkf::Config config;
  if (robust) {
    config.calibration.sigma_scale = 0.05;
    config.range.noise = NoiseKind::kOneSided;
    config.position.noise = NoiseKind::kStudentT;
    config.pose.noise = NoiseKind::kCauchy;
  }
  return config;
}

/// Header of an input for the RecoveringEkf target; if `live`, inside a Live with histories of 2 s.
void begin_recovering(Input& input, bool live, const PoseEkf::Config& config) {
  input.settings<PoseEkf::Config>(!live).flag(live).flag(true).part(Health::Config{}).part(config);
  if (live) {
    constexpr Stamp kHistory = 2'000'000'000;
    input.part(kHistory, Stamp{0}).part(kHistory, Stamp{0}).part(TimelineOptions{});
  }
}

void write_estimators(const std::filesystem::path& folder) {
  for (const Stream& stream : streams()) {
    const std::string name = stream.name;
    for (const bool flag : {false, true}) {
      const std::string file = name + (flag ? "_1" : "_0");
      Input pose(folder / "pose_ekf" / file);
      Input tags(folder / "tag_triangle_ekf" / file);
      pose.settings<PoseEkf::Config>(!flag).part(settings(flag)).start(start());
      tags.settings<TagTriangleEkf::Config>(!flag).flag(flag).start(start());
      for (const Message& message : stream.messages) {
        pose.choice(2).message(message);
        tags.choice(1).message(message);
      }
    }
    Input conditioned(folder / "tag_triangle_ekf" / (name + "_conditioned"));
    conditioned.flag(true).flag(true).start(start()).choice(2).flag(true);
    Input landmark(folder / "landmark_ekf" / name);
    landmark.settings<LandmarkEkf::Config>(name != "landmarks").start(start());
    Input tracking(folder / "recovering_ekf" / (name + "_tracking"));
    begin_recovering(tracking, false, settings(false));
    tracking.choice(2).start(start());
    Input lost(folder / "recovering_ekf" / (name + "_lost"));
    begin_recovering(lost, false, settings(true));
    Input live(folder / "recovering_ekf" / (name + "_live"));
    begin_recovering(live, true, settings(false));
    Input in_order(folder / "timeline" / name);
    in_order.message(Stamp{2'000'000'000}).part(TimelineOptions{});
    std::deque<Input> trackers;
    for (std::uint8_t kind = 0; kind < 4; ++kind) {
      trackers.emplace_back(folder / "trackers" / (name + std::to_string(kind)));
      trackers.back().choice(kind).message(Stamp{2'000'000'000}).part(TimelineOptions{});
    }
    Input mcl(folder / "mcl" / name);
    mcl.flag(true).choice(0).start(start()).number(1.0, 0.0, 1.0);
    Input switching(folder / "switching_mcl" / name);
    switching.flag(true).start(start());
    for (const Message& message : stream.messages) {
      conditioned.choice(1).message(message);
      landmark.choice(1).message(message);
      tracking.choice(4).message(message);
      lost.choice(4).message(message);
      mcl.choice(4).message(message);
      switching.choice(1).message(message);
    }
    for (const Message& message : late(stream.messages)) {
      in_order.message(message);
      for (Input& input : trackers) {
        input.message(message);
      }
      live.choice(4).message(message);
    }
  }
}

void write_scans(const std::filesystem::path& folder) {
  Input mcl(folder / "mcl" / "scans");
  mcl.flag(true);
  Input switching(folder / "switching_mcl" / "scans");
  switching.flag(true).start(start());
  Input lost(folder / "recovering_ekf" / "scans");
  begin_recovering(lost, false, settings(false));
  for (const Message& message : first(with_ranges(), 8)) {
    lost.choice(4).message(message);
  }
  for (int i = 1; i <= 3; ++i) {
    const Pose2 pose{-1.0 + 0.2 * i, 0.5, 0.3};
    const Stamp stamp = i * testing::kSecond / 4;
    mcl.choice(4)
        .message(Message(Velocity{stamp, 0.8, 0.0}))
        .choice(2)
        .message(scan_at(pose, stamp));
    switching.choice(0).message(scan_at(pose, stamp));
    lost.choice(0).message(scan_at(pose, stamp));
  }
  for (const int call : {0, 1, 2, 3}) {
    Input scans(folder / "scans" / std::to_string(call));
    scans.settings<ScanMatcherConfig, ScanOdometryConfig>(call % 2 == 0);
    for (int i = 0; i < 2; ++i) {
      const Pose2 pose{-1.0 + 0.2 * i, 0.5, 0.3};
      const Matrix<3, 3> covariance = Vector<3>(0.01, 0.01, 0.001).asDiagonal();
      scans.choice(static_cast<std::uint8_t>(call))
          .part(call < 3 ? pose : Pose2{0.2, 0.0, 0.0}, 5.0)
          .part(covariance, 1.0)
          .message(scan_at(pose, (i + 1) * testing::kSecond));
    }
  }
  testing::Rng rng(8);
  const testing::Walls box = testing::room_around({});
  for (const double radius : {0.08, 0.5}) {
    Input cylinders(folder / "cylinders" / (radius < 0.1 ? "thin" : "thick"));
    LaserScan scan = testing::scan_of({{{2.0, 0.5}, radius}, {{-1.5, 1.0}, radius}}, box, {}, rng,
                                      0.01, testing::turning_laser(180), 180);
    cylinders.flag(true).part(Pose2{}, 5.0).message(scan);
  }
}

/// A gyro with a bias beside wheels that stand, drive, and slip.
void write_gyro_odometry(const std::filesystem::path& folder) {
  Input gyro(folder / "gyro_odometry" / "slip");
  gyro.settings<GyroOdometry::Config>(false);
  for (int k = 0; k < 60; ++k) {
    const Stamp now = k * testing::kSecond / 20;
    const double turn = k < 20 || k > 40 ? 0.0 : 0.02;
    gyro.choice(0).message(Imu{now, {0.0, 0.0, 0.02}, Vector<3>(0.0, 0.0, 9.81)});
    gyro.choice(2).message(
        Increment{now, now + testing::kSecond / 20, {k < 20 ? 0.0 : 0.05, 0.0, turn}});
  }
}

/// Three consistent anchors, of which one then becomes inconsistent, and scans.
void write_health(const std::filesystem::path& folder) {
  Input health(folder / "health" / "anchors");
  health.part(Health::Config{}).choice(0).message(Stamp{0}).number(0.0, 0.0, 1.0);
  for (int k = 1; k <= 30; ++k) {
    const double residual = k > 15 && k % 3 == 0 ? 5.0 : 0.1;
    const bool is_gated = residual > 1.0;
    health.choice(3)
        .message(k * testing::kSecond / 10)
        .choice(static_cast<std::uint8_t>(Source::kRanges))
        .integer(k % 3)
        .choice(is_gated ? 1 : 0)
        .choice(1)
        .number(is_gated ? 50.0 : 1.0, 0.0, 50.0)
        .number(residual, -10.0, 10.0)
        .number(0.01, 0.0, 10.0);
    if (k % 10 == 0) {
      health.choice(2).message(k * testing::kSecond / 10);
      for (const int share : {230, 76, 10, 40, 128}) {
        health.choice(static_cast<std::uint8_t>(share));
      }
    }
  }
}

void write_flights(const std::filesystem::path& folder) {
  for (const bool by_itself : {false, true}) {
    Input air(folder / "air_ekf" / (by_itself ? "by_itself" : "by_odometry"));
    testing::Flight flight =
        testing::fly(2, 1.6, by_itself ? testing::by_itself : testing::by_odometry);
    air.settings<AirEkf::Config>(by_itself)
        .choice(by_itself ? 1 : 0)
        .message(Stamp{0})
        .part(flight.start.pose, 30.0);
    air.number(flight.start.height, -10.0, 30.0).part(flight.start.covariance, 10.0);
    struct Visitor {
      Input& air;
      void operator()(const testing::Driven& driven) const {
        air.choice(1).message(driven.motion).number(driven.climb_rate, -3.0, 3.0);
      }
      void operator()(const Range& range) const { air.choice(2).message(range); }
      void operator()(const Altitude& altitude) const { air.choice(4).message(altitude); }
      void operator()(const RangeBearing& sighting) const { air.choice(6).message(sighting); }
    };
    for (const auto& message : flight.messages) {
      std::visit(Visitor{air}, message);
    }
  }
}

/// By an inertial sensor.
void write_swing(const std::filesystem::path& folder) {
  Input air(folder / "air_ekf" / "inertial");
  const testing::InertialFlight flight = testing::swing_about(2, 1.2);
  air.settings<AirEkf::Config>(false).choice(2).message(Stamp{0}).part(flight.start.pose, 30.0);
  air.number(flight.start.height, -10.0, 30.0).part(flight.start.covariance, 10.0);
  struct Visitor {
    Input& air;
    void operator()(const Imu& z) const { air.choice(7).message(z); }
    void operator()(const Range& z) const { air.choice(2).message(z); }
    void operator()(const PositionFix& z) const { air.choice(3).message(z); }
    void operator()(const Altitude& z) const { air.choice(4).message(z); }
    void operator()(const PoseObservation& z) const { air.choice(5).message(z); }
    void operator()(const RangeBearing& z) const { air.choice(6).message(z); }
    void operator()(const Velocity& /*z*/) const {}
    void operator()(const Increment& /*z*/) const {}
    void operator()(const LaserScan& /*z*/) const {}
    void operator()(const Heading& /*z*/) const {}
  };
  for (const Message& message : flight.messages) {
    std::visit(Visitor{air}, message);
  }
}

/// The same in a Timeline, late: altitudes and elevations among ranges.
void write_late_flights(const std::filesystem::path& folder) {
  for (const bool by_itself : {false, true}) {
    Messages messages;
    const testing::Flight flight =
        testing::fly(2, 2.1, by_itself ? testing::by_itself : testing::by_odometry);
    for (const auto& message : flight.messages) {
      if (const auto* const driven = std::get_if<testing::Driven>(&message)) {
        messages.emplace_back(driven->motion);
      } else if (const auto* const range = std::get_if<Range>(&message)) {
        messages.emplace_back(*range);
      } else if (const auto* const sighting = std::get_if<RangeBearing>(&message)) {
        messages.emplace_back(*sighting);
      } else {
        messages.emplace_back(std::get<Altitude>(message));
      }
    }
    const std::uint8_t kind = by_itself ? 3 : 2;
    Input input(folder / "trackers" / ("flight" + std::to_string(kind)));
    input.choice(kind).message(Stamp{2'000'000'000}).part(TimelineOptions{});
    for (const Message& message : late(messages)) {
      input.message(message);
    }
  }
}

void write_ranges(const std::filesystem::path& folder) {
  const std::vector<Anchor> anchors = testing::corners();
  const Vector<3> place(2.0, -1.0, 1.0);
  for (const int way : {0, 1, 2}) {
    for (const bool has_prior : {false, true}) {
      Input locate(folder / "locate" / (std::to_string(way) + (has_prior ? "_prior" : "")));
      locate.choice(static_cast<std::uint8_t>(way))
          .choice(static_cast<std::uint8_t>(anchors.size()));
      const int columns = way == 0 ? 2 : 3;
      for (const Anchor& anchor : anchors) {
        for (int axis = 0; axis < columns; ++axis) {
          locate.number(anchor.position(axis), -20.0, 20.0);
        }
      }
      for (const Anchor& anchor : anchors) {
        locate.number((anchor.position - place).head(columns).norm(), 0.0, 40.0);
      }
      for (std::size_t i = 0; i < anchors.size(); ++i) {
        locate.number(0.1, 1e-3, 2.0);
      }
      if (way == 2) {
        locate.number(1.0, -5.0, 5.0);
      }
      locate.choice(has_prior ? 3 : 0)
          .number(0.0, 0.0, 5.0)
          .flag(has_prior)
          .flag(has_prior)
          .flag(has_prior);
      for (int axis = 0; has_prior && axis < (way == 1 ? 3 : 2); ++axis) {
        locate.number(0.0, -20.0, 20.0).number(5.0, 1e-3, 10.0);
        locate.number(-20.0, -30.0, 0.0).number(20.0, 0.0, 30.0);
      }
    }
  }
}

void write_maps(const std::filesystem::path& folder) {
  for (const bool unknown_stops : {false, true}) {
    Input map(folder / "maps" / (unknown_stops ? "unknown_stops" : "unknown_passes"));
    map.integer(12).integer(9).number(0.1, 0.0, 1.0).number(0.3, 0.0, 2.0);
    map.part(Pose2{-0.5, 0.2, 0.4}, 30.0).flag(unknown_stops);
    for (int four = 0; four < 27; ++four) {
      map.choice(static_cast<std::uint8_t>(four * 37));
    }
    for (int i = 0; i < 4; ++i) {
      map.part(Pose2{0.3 * i, 0.4, 1.5 * i}, 60.0).number(10.0, 0.0, 100.0);
    }
  }
}

}  // namespace
}  // namespace locfuse::fuzz

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: write_corpus DIR\n";
    return 1;
  }
  locfuse::fuzz::write_estimators(argv[1]);
  locfuse::fuzz::write_scans(argv[1]);
  locfuse::fuzz::write_flights(argv[1]);
  locfuse::fuzz::write_swing(argv[1]);
  locfuse::fuzz::write_late_flights(argv[1]);
  locfuse::fuzz::write_gyro_odometry(argv[1]);
  locfuse::fuzz::write_health(argv[1]);
  locfuse::fuzz::write_ranges(argv[1]);
  locfuse::fuzz::write_maps(argv[1]);
  return 0;
}
