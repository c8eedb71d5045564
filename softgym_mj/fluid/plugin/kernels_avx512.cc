// The kernels sixteen particles at a time, for x86 processors with AVX-512.

#include <immintrin.h>

namespace softgym_mj {
namespace {

struct Sixteen {
  static constexpr int kWidth = 16;
  __m512 v;

  explicit Sixteen(float a) : v(_mm512_set1_ps(a)) {}
  Sixteen(__m512 a) : v(a) {}
  Sixteen() = default;
  static Sixteen Load(const float* p) { return _mm512_loadu_ps(p); }
  static Sixteen Pick(const float* p, const int* index) {
    return _mm512_setr_ps(p[index[0]], p[index[1]], p[index[2]], p[index[3]], p[index[4]],
                          p[index[5]], p[index[6]], p[index[7]], p[index[8]], p[index[9]],
                          p[index[10]], p[index[11]], p[index[12]], p[index[13]], p[index[14]],
                          p[index[15]]);
  }
  void Store(float* p) const { _mm512_storeu_ps(p, v); }
  // Writes first + lane for every set bit; returns their number.
  static int Compress(int first, unsigned bits, int* out) {
    const __m512i lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const __m512i all = _mm512_add_epi32(lanes, _mm512_set1_epi32(first));
    _mm512_storeu_si512(out, _mm512_maskz_compress_epi32(static_cast<__mmask16>(bits), all));
    return __builtin_popcount(bits);
  }
};

struct Mask {
  __mmask16 v;
};

inline Sixteen operator+(Sixteen a, Sixteen b) { return _mm512_add_ps(a.v, b.v); }
inline Sixteen operator-(Sixteen a, Sixteen b) { return _mm512_sub_ps(a.v, b.v); }
inline Sixteen operator*(Sixteen a, Sixteen b) { return _mm512_mul_ps(a.v, b.v); }
inline Sixteen MultiplyAdd(Sixteen a, Sixteen b, Sixteen c) {
  return _mm512_fmadd_ps(a.v, b.v, c.v);
}
inline Sixteen Max(Sixteen a, Sixteen b) { return _mm512_max_ps(a.v, b.v); }
inline Sixteen Min(Sixteen a, Sixteen b) { return _mm512_min_ps(a.v, b.v); }
inline Sixteen Abs(Sixteen a) { return _mm512_abs_ps(a.v); }
inline Sixteen CopySign(Sixteen a, Sixteen sign) {
  const __m512i bit = _mm512_set1_epi32(static_cast<int>(0x80000000u));
  // Bit by bit: bit ? sign : a.
  return _mm512_castsi512_ps(_mm512_ternarylogic_epi32(bit, _mm512_castps_si512(sign.v),
                                                       _mm512_castps_si512(a.v), 0xca));
}
// The estimate has 14 bits; one Newton step makes it 23.
inline Sixteen InverseSqrt(Sixteen a) {
  const __m512 y = _mm512_rsqrt14_ps(a.v);
  const __m512 half = _mm512_mul_ps(_mm512_set1_ps(0.5f), a.v);
  const __m512 error = _mm512_fnmadd_ps(_mm512_mul_ps(half, y), y, _mm512_set1_ps(1.5f));
  return _mm512_mul_ps(y, error);
}
inline Mask Less(Sixteen a, Sixteen b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)}; }
inline Mask Equal(Sixteen a, Sixteen b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_EQ_OQ)}; }
inline Sixteen Select(Mask mask, Sixteen a, Sixteen b) {
  return _mm512_mask_blend_ps(mask.v, b.v, a.v);
}
inline unsigned Bits(Mask mask) { return mask.v; }
inline float Sum(Sixteen a) { return _mm512_reduce_add_ps(a.v); }

template <class V>
struct Vector3;
template <class V>
inline Vector3<V> Gather(const float* p, const int* index) {
  const auto four = [&](int i) {
    __m512 a = _mm512_castps128_ps512(_mm_load_ps(p + 4 * index[i]));
    a = _mm512_insertf32x4(a, _mm_load_ps(p + 4 * index[i + 4]), 1);
    a = _mm512_insertf32x4(a, _mm_load_ps(p + 4 * index[i + 8]), 2);
    return _mm512_insertf32x4(a, _mm_load_ps(p + 4 * index[i + 12]), 3);
  };
  const __m512 a = four(0), b = four(1), c = four(2), d = four(3);
  const __m512 ab = _mm512_unpacklo_ps(a, b), cd = _mm512_unpacklo_ps(c, d);
  return {V(_mm512_shuffle_ps(ab, cd, 0x44)), V(_mm512_shuffle_ps(ab, cd, 0xee)),
          V(_mm512_shuffle_ps(_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d), 0x44))};
}

}  // namespace
}  // namespace softgym_mj

#include "kernels_impl.h"

namespace softgym_mj {
const Kernels kAvx512Kernels = MakeKernels<Sixteen>();
}  // namespace softgym_mj
