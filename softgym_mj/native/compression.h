// Compression of lists by SIMD on a CPU, under the restrictions of simd.h.

#ifndef SOFTGYM_MJ_NATIVE_COMPRESSION_H_
#define SOFTGYM_MJ_NATIVE_COMPRESSION_H_

#include "native/simd.h"

namespace softgym_mj {
namespace {

// The first `count` lanes, or all, as bits.
inline unsigned FirstBits(int count) { return (1u << (count < kLanes ? count : kLanes)) - 1u; }

#ifdef SGM_AVX2

// The first `count` lanes, or all.
inline Mask FirstLanes(int count) {
  const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  return {_mm256_castsi256_ps(_mm256_cmpgt_epi32(_mm256_set1_epi32(count), lanes))};
}

// Lanes of `mask` whose numbers differ from `a`.
inline Mask Differing(const int* p, int a, Mask mask) {
  const __m256i all = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
  return {_mm256_andnot_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(all, _mm256_set1_epi32(a))), mask.v)};
}

// Lanes of each of the 256 sets of lanes, in order, computed at compile time because code for AVX2 must not run when
// the library is loaded.
struct CompressTable {
  alignas(64) uint8_t lanes[256][kLanes];
  constexpr CompressTable() : lanes() {
    for (int bits = 0; bits < 256; ++bits) {
      int n = 0;
      for (int lane = 0; lane < kLanes; ++lane) {
        if (bits >> lane & 1) lanes[bits][n++] = static_cast<uint8_t>(lane);
      }
    }
  }
};
constexpr CompressTable kCompress;

// Stores the lanes of a set of bits side by side, in order. `out` must have room for eight numbers. A loop over the
// bits mispredicts its end, and a step of water took twice as long.
struct Compression {
  __m256i lanes;
  int count;

  explicit Compression(unsigned bits)
      : lanes(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(kCompress.lanes[bits])))),
        count(__builtin_popcount(bits)) {}
  void Store(const float* p, float* out) const {
    _mm256_storeu_ps(out, _mm256_permutevar8x32_ps(_mm256_loadu_ps(p), lanes));
  }
  void Store(const int* p, int* out) const {
    const __m256i all = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_permutevar8x32_epi32(all, lanes));
  }
  void StoreFrom(int first, int* out) const {
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_add_epi32(lanes, _mm256_set1_epi32(first)));
  }
};

#else

inline Mask FirstLanes(int count) {
  return MaskByLane([&](int i) { return i < count; });
}
inline Mask Differing(const int* p, int a, Mask mask) {
  return MaskByLane([&](int i) { return mask.v[i] & static_cast<int>(p[i] != a); });
}
struct Compression {
  int lanes[kLanes];
  int count = 0;

  explicit Compression(unsigned bits) {
    for (; bits; bits &= bits - 1) lanes[count++] = __builtin_ctz(bits);
  }
  template <class T>
  void Store(const T* p, T* out) const {
    for (int i = 0; i < count; ++i) out[i] = p[lanes[i]];
  }
  void StoreFrom(int first, int* out) const {
    for (int i = 0; i < count; ++i) out[i] = first + lanes[i];
  }
};

#endif  // SGM_AVX2

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_COMPRESSION_H_
