// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// Vectors of single precision, as wide as the target processor allows. Files that include this are
/// compiled twice; LOCFUSE_LANES is the namespace, one per instruction set, so that the two
/// versions share nothing.
#ifndef LOCFUSE_LANES
#define LOCFUSE_LANES portable
#endif

namespace locfuse::internal::LOCFUSE_LANES {

#ifdef __AVX2__
constexpr int kLanes = 8;
#else
constexpr int kLanes = 4;
#endif

using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
using Indices = std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));

inline Lanes load(const float* from) {
  Lanes lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return lanes;
}

inline void store(const Lanes& lanes, float* to) { __builtin_memcpy(to, &lanes, sizeof lanes); }

inline Lanes all(float value) { return Lanes{} + value; }

inline Lanes larger(const Lanes& a, const Lanes& b) { return a > b ? a : b; }

inline Lanes smaller(const Lanes& a, const Lanes& b) { return a < b ? a : b; }

/// Integer parts, rounded towards zero.
inline Indices whole(const Lanes& value) { return __builtin_convertvector(value, Indices); }

inline Lanes number(const Indices& value) { return __builtin_convertvector(value, Lanes); }

inline Lanes square_root(const Lanes& x) {
  Lanes root;
  for (int l = 0; l < kLanes; ++l) {
    root[l] = __builtin_sqrtf(x[l]);
  }
  return root;
}

inline bool any(const Indices& mask) {
  std::int64_t words[kLanes / 2];
  __builtin_memcpy(words, &mask, sizeof words);
  std::int64_t some = 0;
  for (const std::int64_t word : words) {
    some |= word;
  }
  return some != 0;
}

inline double sum(const Lanes& lanes) {
  double total = 0.0;
  for (int l = 0; l < kLanes; ++l) {
    total += static_cast<double>(lanes[l]);
  }
  return total;
}

/// Natural logarithm of numbers > 0, to 2e-7 (the polynomial of Cephes' logf).
inline Lanes natural_log(const Lanes& x) {
  Indices bits;
  __builtin_memcpy(&bits, &x, sizeof bits);
  // x = m 2^e with m in [sqrt(1/2), sqrt(2)).
  const Indices shifted = bits - 0x3F3504F3;
  const Lanes e = number(shifted >> 23);
  const Indices mantissa = bits - (shifted & static_cast<std::int32_t>(0xFF800000U));
  Lanes m;
  __builtin_memcpy(&m, &mantissa, sizeof m);
  m -= 1.0F;
  Lanes p = 7.0376836292E-2F * m - 1.1514610310E-1F;
  p = p * m + 1.1676998740E-1F;
  p = p * m - 1.2420140846E-1F;
  p = p * m + 1.4249322787E-1F;
  p = p * m - 1.6668057665E-1F;
  p = p * m + 2.0000714765E-1F;
  p = p * m - 2.4999993993E-1F;
  p = p * m + 3.3333331174E-1F;
  return m + m * m * (p * m - 0.5F) + 0.693147181F * e;
}

/// Cosine and sine of an angle in turns, |turns| < 1e5, to 2e-7 (polynomials of Cephes' sinf,
/// cosf).
inline void cos_sin_of_turns(const Lanes& turns, Lanes& cosine, Lanes& sine) {
  const Lanes quarters = 4.0F * turns;
  const Indices quarter = whole(quarters + (quarters < 0.0F ? all(-0.5F) : all(0.5F)));
  const Lanes a = (quarters - number(quarter)) * 1.57079632679F;
  const Lanes aa = a * a;
  const Lanes s =
      a + a * aa * ((-1.9515295891E-4F * aa + 8.3321608736E-3F) * aa - 1.6666654611E-1F);
  const Lanes c =
      1.0F - 0.5F * aa +
      aa * aa * ((2.443315711809948E-5F * aa - 1.388731625493765E-3F) * aa + 4.166664568298827E-2F);
  const Indices odd = (quarter & 1) == 1;
  const Lanes x = odd ? s : c;
  const Lanes y = odd ? c : s;
  cosine = ((quarter + 1) & 2) == 2 ? -x : x;
  sine = (quarter & 2) == 2 ? -y : y;
}

}  // namespace locfuse::internal::LOCFUSE_LANES
