// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "support/endless_drive.hpp"

/// A day of messages at full speed through a Timeline of a RecoveringEkf: `soak [HOURS]` prints
/// memory and time per message of each hour, and fails unless both stay flat.
namespace locfuse {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kMaxGrowth = 1.0;    // of resident memory after the first hour [MB]
constexpr double kMaxSlowdown = 1.2;  // median hour of the second half over that of the first

struct Hour {
  std::size_t messages = 0;
  double median = 0.0;    // time per message [us]
  double highest = 0.0;   // 99.9th percentile [us]
  double resident = 0.0;  // [MB]
  double held = 0.0;      // of the heap [MB]
  double rmse = 0.0;      // of the position, once a second while there is aid [m]
  std::size_t interventions = 0;
};

double resident_megabytes() {
  std::size_t total = 0;
  std::size_t resident = 0;
  std::ifstream("/proc/self/statm") >> total >> resident;
  return 1e-6 * static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

double quantile_of(std::vector<float>& values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return static_cast<double>(values[static_cast<std::size_t>(at)]);
}

Hour drive_an_hour(testing::EndlessDrive& drive, Timeline<RecoveringEkf>& timeline,
                   std::vector<float>& times) {
  const auto deaf = [](std::size_t, const Outcome&) {};
  double squares = 0.0;
  int counted = 0;
  times.clear();
  for (int step = 1; step <= 360'000; ++step) {
    drive.step([&](const Message& message) {
      const Clock::time_point begin = Clock::now();
      timeline.on(message, deaf);
      times.push_back(std::chrono::duration<float, std::micro>(Clock::now() - begin).count());
    });
    if (step % 100 == 0 && drive.is_known()) {
      const Pose2 here = timeline.estimator().estimate().pose;
      squares += (here.position() - drive.truth().position()).squaredNorm();
      ++counted;
    }
  }
  Hour hour;
  hour.messages = times.size();
  hour.median = quantile_of(times, 0.5);
  hour.highest = quantile_of(times, 0.999);
  hour.resident = resident_megabytes();
  hour.held = 1e-6 * static_cast<double>(testing::held_bytes());
  hour.rmse = std::sqrt(squares / counted);
  hour.interventions = timeline.estimator().estimator()->interventions();
  return hour;
}

double median_of_hours(const std::vector<Hour>& hours, std::size_t begin, std::size_t end) {
  std::vector<float> medians;
  for (std::size_t i = begin; i < end; ++i) {
    medians.push_back(static_cast<float>(hours[i].median));
  }
  return quantile_of(medians, 0.5);
}

bool holds(bool claim, const char* what) {
  std::printf("%s: %s\n", claim ? "holds" : "BROKEN", what);
  return claim;
}

int soak(int count) {
  testing::EndlessDrive drive(1);
  auto timeline = testing::endless_timeline();
  std::vector<float> times;
  times.reserve(1'000'000);
  times.resize(times.capacity());  // allocates its pages before the first hour ends
  std::vector<Hour> hours;
  std::printf("hour  messages  median [us]  1/1000 [us]  RSS [MB]  heap [MB]  RMSE [m]\n");
  for (int i = 1; i <= count; ++i) {
    hours.push_back(drive_an_hour(drive, timeline, times));
    const Hour& hour = hours.back();
    std::printf("%4d  %8zu  %11.2f  %11.1f  %8.2f  %9.3f  %8.3f\n", i, hour.messages, hour.median,
                hour.highest, hour.resident, hour.held, hour.rmse);
    std::fflush(stdout);
  }
  const std::size_t half = hours.size() / 2;
  const double growth = hours.back().resident - hours.front().resident;
  const double slower =
      median_of_hours(hours, half, hours.size()) / median_of_hours(hours, 0, half);
  double worst = 0.0;
  for (const Hour& hour : hours) {
    worst = std::max(worst, hour.rmse);
  }
  std::printf(
      "resident memory grew by %.2f MB; a message took %.2f times as long in the second "
      "half; %d alarms, %d restarts, %zu interventions\n",
      growth, slower, timeline.estimator().alarms(), timeline.estimator().restarts(),
      hours.back().interventions);
  const bool memory = holds(growth <= kMaxGrowth, "resident memory is flat after an hour");
  const bool time = holds(slower <= kMaxSlowdown, "the time for a message is flat");
  const bool place = holds(worst <= 0.5, "where it can be, the position is known in every hour");
  const bool found = holds(timeline.estimator().restarts() > 0, "carried away, it found itself");
  return memory && time && place && found ? 0 : 1;
}

}  // namespace
}  // namespace locfuse

int main(int argc, char** argv) {
  const int hours = argc > 1 ? std::atoi(argv[1]) : 24;
  if (argc > 2 || hours < 2) {
    std::fprintf(stderr, "usage: soak [HOURS], at least 2\n");
    return 1;
  }
  return locfuse::soak(hours);
}
