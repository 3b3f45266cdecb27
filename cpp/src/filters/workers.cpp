// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/workers.hpp"

#include <unistd.h>

#include <algorithm>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

namespace locfuse {
namespace {

/// Where piece `who` of `pieces` begins.
int edge(int count, int group, int who, int pieces) {
  const long long groups = (static_cast<long long>(count) + group - 1) / group;
  return static_cast<int>(std::min<long long>(groups * who / pieces * group, count));
}

}  // namespace

Workers::Workers(int threads) : owner_(::getpid()) {
  if (threads < 1 || threads > 256) {
    throw std::invalid_argument("threads is " + std::to_string(threads) + ", expected 1 to 256");
  }
  try {
    for (int who = 1; who < threads; ++who) {
      helpers_.emplace_back([this, who] { help(who); });
    }
  } catch (const std::system_error& error) {
    const int made = this->threads();
    stop();
    throw std::invalid_argument("threads is " + std::to_string(threads) + ", but the system has " +
                                std::to_string(made) + " for this: " + error.what());
  }
}

Workers::~Workers() { stop(); }

bool Workers::is_forked() const { return ::getpid() != owner_; }

void Workers::stop() {
  if (is_forked()) {
    // Helpers that this process does not have still wait, and would be waited for: they are
    // forgotten with what they wait on, not destroyed.
    for (std::thread& helper : helpers_) {
      new (&helper) std::thread;
    }
    new (&begin_) std::condition_variable;
    new (&done_) std::condition_variable;
    return;
  }
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
  if (helpers_.empty() || is_forked()) {
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
  run(part, 0, edge(count, group, 1, threads()));
  std::unique_lock<std::mutex> lock(mutex_);
  done_.wait(lock, [this] { return working_ == 0; });
  if (const std::exception_ptr thrown = std::exchange(thrown_, nullptr)) {
    std::rethrow_exception(thrown);
  }
}

void Workers::run(const std::function<void(int, int)>& part, int begin, int end) {
  try {
    part(begin, end);
  } catch (...) {
    const std::lock_guard<std::mutex> lock(mutex_);
    thrown_ = std::current_exception();
  }
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
    run(part, begin, end);
    lock.lock();
    if (--working_ == 0) {
      done_.notify_one();
    }
  }
}

}  // namespace locfuse
