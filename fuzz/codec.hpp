// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <optional>
#include <type_traits>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/time.hpp"

/// Byte format of the inputs of fuzz targets. One function `code` reads from a Reader and writes to
/// a Writer, so that the generated corpus and the inputs of the fuzzer share one format.
namespace locfuse::fuzz {

/// Values likely to break sums, squares, casts and comparisons.
inline constexpr double kNasty[] = {
    0.0,
    -0.0,
    std::numeric_limits<double>::quiet_NaN(),
    std::numeric_limits<double>::infinity(),
    -std::numeric_limits<double>::infinity(),
    std::numeric_limits<double>::max(),
    std::numeric_limits<double>::lowest(),
    std::numeric_limits<double>::min(),
    std::numeric_limits<double>::denorm_min(),
    1e-160,
    1e160,
    1e-12,
    1e12,
    -1.0,
    1e6,
    2147483648.0,
    kPi,
    -kPi,
};

/// Reads bytes in order, zeros after the end. Two bytes encode a plausible number; a mark followed
/// by eight bytes, or a mark of a value in kNasty, any other.
class Reader {
 public:
  Reader(const std::uint8_t* data, std::size_t size) : data_(data), end_(data + size) {}

  [[nodiscard]] bool empty() const { return data_ == end_; }

  /// Whether every number so far was plausible and no clock jumped.
  [[nodiscard]] bool plausible() const { return plausible_; }
  void mark_implausible() { plausible_ = false; }

  void raw(void* value, std::size_t size) {
    std::memset(value, 0, size);
    const std::size_t available = std::min(size, static_cast<std::size_t>(end_ - data_));
    std::memcpy(value, data_, available);
    data_ += available;
  }

 private:
  const std::uint8_t* data_;
  const std::uint8_t* end_;
  bool plausible_ = true;
};

class Writer {
 public:
  void raw(const void* value, std::size_t size) {
    const auto* bytes = static_cast<const std::uint8_t*>(value);
    bytes_.insert(bytes_.end(), bytes, bytes + size);
  }
  [[nodiscard]] const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

inline constexpr std::uint16_t kMark = 0xff00;  // from here on a number is implausible

/// Choice from 0 to `count` - 1.
template <class Io>
void code(Io& io, std::uint8_t& choice, int count) {
  io.raw(&choice, 1);
  if constexpr (std::is_same_v<Io, Reader>) {
    choice = static_cast<std::uint8_t>(choice % count);
  }
}

template <class Io>
void code(Io& io, bool& value) {
  std::uint8_t byte = value ? 1 : 0;
  code(io, byte, 2);
  value = byte != 0;
}

/// Number, plausible if within [low, high].
template <class Io>
void code(Io& io, double& value, double low, double high) {
  if constexpr (std::is_same_v<Io, Reader>) {
    std::uint16_t bits;
    io.raw(&bits, sizeof(bits));
    if (bits < kMark) {
      value = low + (high - low) * bits / (kMark - 1);
      return;
    }
    io.mark_implausible();
    const auto which = static_cast<std::size_t>(bits - kMark);
    if (which < std::size(kNasty)) {
      value = kNasty[which];
    } else {
      io.raw(&value, sizeof(value));
    }
  } else if (value >= low && value <= high) {
    const auto bits =
        static_cast<std::uint16_t>(std::lround((value - low) / (high - low) * (kMark - 1)));
    io.raw(&bits, sizeof(bits));
  } else {
    std::uint16_t bits = kMark;
    while (bits < kMark + std::size(kNasty) &&
           std::memcmp(&kNasty[bits - kMark], &value, sizeof(value)) != 0) {
      ++bits;
    }
    io.raw(&bits, sizeof(bits));
    if (bits == kMark + std::size(kNasty)) {
      io.raw(&value, sizeof(value));
    }
  }
}

/// Numbers with common bounds.
template <class Io>
void code(Io& io, std::initializer_list<double*> numbers, double low, double high) {
  for (double* number : numbers) {
    code(io, *number, low, high);
  }
}

/// Integer from -128 to 127.
template <class Io>
void code(Io& io, std::int32_t& value) {
  auto byte = static_cast<std::int8_t>(value);
  io.raw(&byte, 1);
  value = byte;
}

/// Stamp near `now`, up to 48 s later and 16 s earlier, in ms, or any. A valid one becomes the next
/// `now`.
template <class Io>
void code(Io& io, Stamp& value, Stamp& now) {
  constexpr Stamp kMillisecond = 1'000'000;
  constexpr Stamp kEarlier = 16'000;
  if constexpr (std::is_same_v<Io, Reader>) {
    std::uint16_t bits;
    io.raw(&bits, sizeof(bits));
    if (bits < kMark) {
      value = now + (bits - kEarlier) * kMillisecond;
    } else if (bits < 0xff80) {
      value = now + (bits - kMark);  // nanoseconds
    } else {
      io.mark_implausible();
      io.raw(&value, sizeof(value));
    }
  } else if (const Stamp bits = kEarlier + (value - now) / kMillisecond;
             bits >= 0 && bits < kMark) {
    const auto written = static_cast<std::uint16_t>(bits);
    io.raw(&written, sizeof(written));
    value = now + (written - kEarlier) * kMillisecond;
  } else {
    const std::uint16_t written = 0xffff;
    io.raw(&written, sizeof(written));
    io.raw(&value, sizeof(value));
  }
  if (value > -kStampLimit && value < kStampLimit) {
    now = value;
  }
}

/// Optional value: one byte, then the value.
template <class Io, class T, class Code>
void code_optional(Io& io, std::optional<T>& value, const Code& code_value) {
  bool has_value = value.has_value();
  code(io, has_value);
  if (!has_value) {
    value.reset();
    return;
  }
  if (!value) {
    value.emplace();
  }
  code_value(*value);
}

/// Reads whether the settings are the defaults, and the settings if not; returns whether they are.
template <class... Config>
bool read_if_unusual(Reader& io, Config&... config) {
  bool as_usual = true;
  code(io, as_usual);
  if (!as_usual) {
    (code_settings(io, config), ...);
  }
  return as_usual;
}

}  // namespace locfuse::fuzz
