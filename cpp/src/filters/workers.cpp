// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/workers.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace locfuse {
namespace {

/// Where piece `who` of `pieces` begins.
int edge(int count, int group, int who, int pieces) {
  const auto groups = static_cast<long long>((count + group - 1) / group);
  return static_cast<int>(std::min<long long>(groups * who / pieces * group, count));
}

}  // namespace

Workers::Workers(int threads) {
  if (threads < 1 || threads > 256) {
    throw std::invalid_argument("threads is " + std::to_string(threads) + ", expected 1 to 256");
  }
  for (int who = 1; who < threads; ++who) {
    helpers_.emplace_back([this, who] { help(who); });
  }
}

Workers::~Workers() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  begin_.notify_all();
  for (std::thread& helper : helpers_) {
    helper.join();
  }
}

void Workers::share(int count, int group, const std::function<void(int, int)>& part) {
  if (helpers_.empty()) {
    part(0, count);
    return;
  }
  const std::lock_guard<std::mutex> caller(callers_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    part_ = &part;
    count_ = count;
    group_ = group;
    working_ = static_cast<int>(helpers_.size());
    ++loop_;
  }
  begin_.notify_all();
  part(0, edge(count, group, 1, threads()));
  std::unique_lock<std::mutex> lock(mutex_);
  done_.wait(lock, [this] { return working_ == 0; });
}

void Workers::help(int who) {
  unsigned seen = 0;
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    begin_.wait(lock, [&] { return stop_ || loop_ != seen; });
    if (stop_) {
      return;
    }
    seen = loop_;
    const std::function<void(int, int)>& part = *part_;
    const int begin = edge(count_, group_, who, threads());
    const int end = edge(count_, group_, who + 1, threads());
    lock.unlock();
    part(begin, end);
    lock.lock();
    if (--working_ == 0) {
      done_.notify_one();
    }
  }
}

}  // namespace locfuse
