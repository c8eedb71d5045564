// The kernels eight particles at a time, for x86 processors with AVX2 and FMA.

#include <immintrin.h>

namespace softgym_mj {
namespace {

// For each of the 256 sets of lanes, which lanes they are, in order. Made by the compiler: code of this
// file must not run when the library is loaded.
struct CompressTable {
  alignas(32) int lanes[256][8];
  constexpr CompressTable() : lanes() {
    for (int bits = 0; bits < 256; ++bits) {
      int n = 0;
      for (int lane = 0; lane < 8; ++lane) {
        if (bits >> lane & 1) lanes[bits][n++] = lane;
      }
    }
  }
};
constexpr CompressTable kCompress;

struct Eight {
  static constexpr int kWidth = 8;
  __m256 v;

  explicit Eight(float a) : v(_mm256_set1_ps(a)) {}
  Eight(__m256 a) : v(a) {}
  Eight() = default;
  static Eight Load(const float* p) { return _mm256_loadu_ps(p); }
  // Eight loads: on the processors we measured vgatherdps takes three times as long.
  static Eight Pick(const float* p, const int* index) {
    return _mm256_setr_ps(p[index[0]], p[index[1]], p[index[2]], p[index[3]], p[index[4]],
                          p[index[5]], p[index[6]], p[index[7]]);
  }
  void Store(float* p) const { _mm256_storeu_ps(p, v); }
  // Writes first + lane for every set bit; returns their number.
  static int Compress(int first, unsigned bits, int* out) {
    const __m256i lanes =
        _mm256_load_si256(reinterpret_cast<const __m256i*>(kCompress.lanes[bits]));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out),
                        _mm256_add_epi32(lanes, _mm256_set1_epi32(first)));
    return __builtin_popcount(bits);
  }
};

struct Mask {
  __m256 v;
};

inline Eight operator+(Eight a, Eight b) { return _mm256_add_ps(a.v, b.v); }
inline Eight operator-(Eight a, Eight b) { return _mm256_sub_ps(a.v, b.v); }
inline Eight operator*(Eight a, Eight b) { return _mm256_mul_ps(a.v, b.v); }
inline Eight MultiplyAdd(Eight a, Eight b, Eight c) { return _mm256_fmadd_ps(a.v, b.v, c.v); }
inline Eight Max(Eight a, Eight b) { return _mm256_max_ps(a.v, b.v); }
inline Eight Min(Eight a, Eight b) { return _mm256_min_ps(a.v, b.v); }
inline Eight Abs(Eight a) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a.v); }
inline Eight CopySign(Eight a, Eight sign) {
  const __m256 bit = _mm256_set1_ps(-0.0f);
  return _mm256_or_ps(_mm256_andnot_ps(bit, a.v), _mm256_and_ps(bit, sign.v));
}
// The estimate has 12 bits; one Newton step makes it 23.
inline Eight InverseSqrt(Eight a) {
  const __m256 y = _mm256_rsqrt_ps(a.v);
  const __m256 half = _mm256_mul_ps(_mm256_set1_ps(0.5f), a.v);
  const __m256 error = _mm256_fnmadd_ps(_mm256_mul_ps(half, y), y, _mm256_set1_ps(1.5f));
  return _mm256_mul_ps(y, error);
}
inline Mask Less(Eight a, Eight b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_LT_OQ)}; }
inline Mask Equal(Eight a, Eight b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_EQ_OQ)}; }
inline Eight Select(Mask mask, Eight a, Eight b) { return _mm256_blendv_ps(b.v, a.v, mask.v); }
inline unsigned Bits(Mask mask) { return static_cast<unsigned>(_mm256_movemask_ps(mask.v)); }
inline float Sum(Eight a) {
  __m128 b = _mm_add_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
  b = _mm_add_ps(b, _mm_movehl_ps(b, b));
  return _mm_cvtss_f32(_mm_add_ss(b, _mm_movehdup_ps(b)));
}

template <class V>
struct Vector3;
template <class V>
inline Vector3<V> Gather(const float* p, const int* index) {
  const auto pair = [&](int low, int high) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(p + 4 * index[low])),
                                _mm_load_ps(p + 4 * index[high]), 1);
  };
  const __m256 a = pair(0, 4), b = pair(1, 5), c = pair(2, 6), d = pair(3, 7);
  const __m256 ab = _mm256_unpacklo_ps(a, b), cd = _mm256_unpacklo_ps(c, d);
  return {V(_mm256_shuffle_ps(ab, cd, 0x44)), V(_mm256_shuffle_ps(ab, cd, 0xee)),
          V(_mm256_shuffle_ps(_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d), 0x44))};
}

}  // namespace
}  // namespace softgym_mj

#include "kernels_impl.h"

namespace softgym_mj {
const Kernels kAvx2Kernels = MakeKernels<Eight>();
}  // namespace softgym_mj
