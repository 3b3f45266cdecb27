// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <optional>
#include <thread>
#include <unordered_map>
#include <utility>
#include <variant>

#include "locfuse/frontends/scan_odometry.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/replay/live.hpp"
#include "locfuse/replay/localize.hpp"
#include "locfuse/replay/odometry_timeline.hpp"

/// Releases the GIL while an object is modified. Other threads that use the object wait for their
/// turn, as they would for the GIL; a callback on the owning thread may access it.
class Alone {
 public:
  explicit Alone(const void* object) : object_(object) {
    wait_for(object);
    before_ = std::exchange(in_use_[object].owner, std::this_thread::get_id());
    unlocked_.emplace();
  }
  ~Alone() {
    unlocked_.reset();
    in_use_[object_].owner = before_;
    forget(object_);
    changed_.notify_all();
  }
  Alone(const Alone&) = delete;
  Alone& operator=(const Alone&) = delete;

  static void wait_for(const void* object) {
    const auto used = in_use_.find(object);
    if (used == in_use_.end() || used->second.owner == std::this_thread::get_id()) {
      return;
    }
    Use& use = used->second;  // not erased while anyone waits
    for (const std::size_t turn = use.waiting++;
         use.owner != std::thread::id{} || use.turn != turn;) {
      const pybind11::gil_scoped_release unlocked;
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait_for(
          lock, std::chrono::milliseconds(1));  // a notification may have come before the wait
    }
    ++use.turn;
    forget(object);
    changed_.notify_all();
  }

 private:
  struct Use {
    std::thread::id owner;
    std::size_t waiting = 0;  // next ticket
    std::size_t turn = 0;     // ticket being served
  };

  static void forget(const void* object) {
    const auto used = in_use_.find(object);
    if (used->second.owner == std::thread::id{} && used->second.turn == used->second.waiting) {
      in_use_.erase(used);
    }
  }

  static inline std::unordered_map<const void*, Use> in_use_;  // changes under the GIL
  static inline std::mutex mutex_;
  static inline std::condition_variable changed_;

  const void* object_;
  std::thread::id before_;
  std::optional<pybind11::gil_scoped_release> unlocked_;
};

/// Method `on` that runs without the GIL.
template <class T, class M>
auto unlocked_on() {
  return [](T& object, const M& message) {
    const Alone alone(&object);
    return object.on(message);
  };
}

/// Method `on` of any message, without the GIL for those that are heavy.
template <class T, class... Heavy>
auto on_message() {
  return [](T& object, const locfuse::Message& message) {
    if ((std::holds_alternative<Heavy>(message) || ...)) {
      const Alone alone(&object);
      return object.on(message);
    }
    return object.on(message);
  };
}

/// Type caster that waits until no other thread modifies the object; applies to `self`, too.
template <class T>
struct Awaited : pybind11::detail::type_caster_base<T> {
  bool load(pybind11::handle source, bool convert) {
    if (!pybind11::detail::type_caster_base<T>::load(source, convert)) {
      return false;
    }
    Alone::wait_for(this->value);
    return true;
  }
};

namespace pybind11::detail {

template <>
struct type_caster<locfuse::Initializer> : Awaited<locfuse::Initializer> {};
template <>
struct type_caster<locfuse::Live> : Awaited<locfuse::Live> {};
template <>
struct type_caster<locfuse::LiveMcl> : Awaited<locfuse::LiveMcl> {};
template <>
struct type_caster<locfuse::Mcl> : Awaited<locfuse::Mcl> {};
template <>
struct type_caster<locfuse::OdometryTimeline> : Awaited<locfuse::OdometryTimeline> {};
template <>
struct type_caster<locfuse::RecoveringEkf> : Awaited<locfuse::RecoveringEkf> {};
template <>
struct type_caster<locfuse::ScanOdometry> : Awaited<locfuse::ScanOdometry> {};
template <>
struct type_caster<locfuse::SwitchingMcl> : Awaited<locfuse::SwitchingMcl> {};

}  // namespace pybind11::detail
