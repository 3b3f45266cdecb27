// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace locfuse {

/// Threads that wait for loops to share. What a loop does must not depend on who does which part.
class Workers {
 public:
  /// `threads` in all, the caller's own among them. Throws std::invalid_argument unless 1 to 256,
  /// and where the system has not as many.
  explicit Workers(int threads);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  [[nodiscard]] int threads() const { return static_cast<int>(helpers_.size()) + 1; }

  /// Calls part(begin, end) for pieces of [0, count), whole groups each; returns when all are done.
  /// What a part throws is thrown then. One loop at a time: other callers wait. In a forked child,
  /// which has no threads but its own, the caller does it all.
  void share(int count, int group, const std::function<void(int, int)>& part);

 private:
  void help(int who);
  void stop();
  /// Calls a part and keeps what it throws.
  void run(const std::function<void(int, int)>& part, int begin, int end);

  [[nodiscard]] bool is_forked() const;

  int owner_;  // the process that the helpers live in
  std::vector<std::thread> helpers_;
  std::mutex callers_;
  std::mutex mutex_;
  std::condition_variable begin_;
  std::condition_variable done_;
  const std::function<void(int, int)>* part_ = nullptr;
  int count_ = 0;
  int group_ = 1;
  int working_ = 0;
  unsigned loop_ = 0;
  bool stop_ = false;
  std::exception_ptr thrown_;  // by one of the parts
};

}  // namespace locfuse
