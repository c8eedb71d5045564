// `Lanes`: SIMD vector of eight floats, and `Mask`, eight booleans.
//
// The width is the same on every processor, every operation is correctly rounded (IEEE 754), multiply-adds are fused in
// all builds and sums have a fixed order, so that results are bit-identical on all processors. Approximate instructions
// (rsqrtps, rcpps) differ between vendors and are not used.
//
// Restriction: files that include this are compiled once per instruction set, and the linker must not share code
// between these builds, so they must not instantiate standard containers or algorithms.

#ifndef SOFTGYM_MJ_NATIVE_SIMD_H_
#define SOFTGYM_MJ_NATIVE_SIMD_H_

#ifndef __CUDACC__
#include <math.h>
#include <stdint.h>
#include <string.h>
#endif

#if defined(__AVX2__) && defined(__FMA__)
#define SGM_AVX2 1
#include <immintrin.h>
#endif

namespace softgym_mj {

constexpr int kLanes = 8;

// Unnamed namespace: each build has its own types and code.
namespace {

#ifdef SGM_AVX2

struct Mask {
  __m256 v;
};

struct Lanes {
  __m256 v;

  Lanes() = default;
  Lanes(__m256 a) : v(a) {}
  explicit Lanes(float a) : v(_mm256_set1_ps(a)) {}
  static Lanes Load(const float* p) { return _mm256_loadu_ps(p); }
  void Store(float* p) const { _mm256_storeu_ps(p, v); }
};

inline Lanes operator+(Lanes a, Lanes b) { return _mm256_add_ps(a.v, b.v); }
inline Lanes operator-(Lanes a, Lanes b) { return _mm256_sub_ps(a.v, b.v); }
inline Lanes operator*(Lanes a, Lanes b) { return _mm256_mul_ps(a.v, b.v); }
inline Lanes operator/(Lanes a, Lanes b) { return _mm256_div_ps(a.v, b.v); }
inline Lanes operator-(Lanes a) { return _mm256_xor_ps(a.v, _mm256_set1_ps(-0.0f)); }
// Fused a b + c, and c - a b.
inline Lanes MultiplyAdd(Lanes a, Lanes b, Lanes c) { return _mm256_fmadd_ps(a.v, b.v, c.v); }
inline Lanes NegativeMultiplyAdd(Lanes a, Lanes b, Lanes c) { return _mm256_fnmadd_ps(a.v, b.v, c.v); }
// Returns the second argument if both are equal or one is NaN.
inline Lanes Min(Lanes a, Lanes b) { return _mm256_min_ps(a.v, b.v); }
inline Lanes Max(Lanes a, Lanes b) { return _mm256_max_ps(a.v, b.v); }
inline Lanes Sqrt(Lanes a) { return _mm256_sqrt_ps(a.v); }
inline Lanes Abs(Lanes a) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a.v); }
inline Lanes CopySign(Lanes a, Lanes sign) {
  const __m256 bit = _mm256_set1_ps(-0.0f);
  return _mm256_or_ps(_mm256_andnot_ps(bit, a.v), _mm256_and_ps(bit, sign.v));
}
inline Mask Less(Lanes a, Lanes b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_LT_OQ)}; }
inline Mask LessEqual(Lanes a, Lanes b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_LE_OQ)}; }
inline Mask Equal(Lanes a, Lanes b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_EQ_OQ)}; }
inline Mask operator&(Mask a, Mask b) { return {_mm256_and_ps(a.v, b.v)}; }
inline Mask operator|(Mask a, Mask b) { return {_mm256_or_ps(a.v, b.v)}; }
inline Lanes Select(Mask mask, Lanes a, Lanes b) { return _mm256_blendv_ps(b.v, a.v, mask.v); }
inline unsigned Bits(Mask mask) { return static_cast<unsigned>(_mm256_movemask_ps(mask.v)); }
// Sum of lanes in the order ((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7)).
inline float Sum(Lanes a) {
  __m128 b = _mm_add_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
  b = _mm_add_ps(b, _mm_movehl_ps(b, b));
  return _mm_cvtss_f32(_mm_add_ss(b, _mm_movehdup_ps(b)));
}
// Writes the sums of four vectors, or of three, each as from `Sum`.
inline void Sums(Lanes a, Lanes b, Lanes c, Lanes d, float out[4]) {
  const auto halved = [](Lanes x) { return _mm_add_ps(_mm256_castps256_ps128(x.v), _mm256_extractf128_ps(x.v, 1)); };
  const auto paired = [&](Lanes x, Lanes y) {
    const __m128 x2 = halved(x), y2 = halved(y);
    return _mm_add_ps(_mm_unpacklo_ps(x2, y2), _mm_unpackhi_ps(x2, y2));
  };
  const __m128 ab = paired(a, b), cd = paired(c, d);
  _mm_storeu_ps(out, _mm_add_ps(_mm_movelh_ps(ab, cd), _mm_movehl_ps(cd, ab)));
}

// The least or the largest lane, in all lanes; no lane may be NaN.
inline Lanes Least(Lanes a) {
  __m256 b = _mm256_min_ps(a.v, _mm256_permute2f128_ps(a.v, a.v, 1));
  b = _mm256_min_ps(b, _mm256_shuffle_ps(b, b, 0x4e));
  return _mm256_min_ps(b, _mm256_shuffle_ps(b, b, 0xb1));
}
inline Lanes Largest(Lanes a) {
  __m256 b = _mm256_max_ps(a.v, _mm256_permute2f128_ps(a.v, a.v, 1));
  b = _mm256_max_ps(b, _mm256_shuffle_ps(b, b, 0x4e));
  return _mm256_max_ps(b, _mm256_shuffle_ps(b, b, 0xb1));
}

// Loads eight vectors of four floats at `index`, component by component; they are aligned to 16 bytes.
inline void Gather4(const float* p, const int* index, Lanes* x, Lanes* y, Lanes* z, Lanes* w) {
  const auto pair = [&](int low, int high) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(p + 4L * index[low])),
                                _mm_load_ps(p + 4L * index[high]), 1);
  };
  const __m256 a = pair(0, 4), b = pair(1, 5), c = pair(2, 6), d = pair(3, 7);
  const __m256 ab = _mm256_unpacklo_ps(a, b), cd = _mm256_unpacklo_ps(c, d);
  const __m256 ab2 = _mm256_unpackhi_ps(a, b), cd2 = _mm256_unpackhi_ps(c, d);
  *x = _mm256_shuffle_ps(ab, cd, 0x44);
  *y = _mm256_shuffle_ps(ab, cd, 0xee);
  *z = _mm256_shuffle_ps(ab2, cd2, 0x44);
  *w = _mm256_shuffle_ps(ab2, cd2, 0xee);
}
// Stores eight vectors; of equal indices the last one remains.
inline void Scatter4(float* p, const int* index, Lanes x, Lanes y, Lanes z, Lanes w) {
  const __m256 xy = _mm256_unpacklo_ps(x.v, y.v), xy2 = _mm256_unpackhi_ps(x.v, y.v);
  const __m256 zw = _mm256_unpacklo_ps(z.v, w.v), zw2 = _mm256_unpackhi_ps(z.v, w.v);
  const __m256 a = _mm256_shuffle_ps(xy, zw, 0x44), b = _mm256_shuffle_ps(xy, zw, 0xee);
  const __m256 c = _mm256_shuffle_ps(xy2, zw2, 0x44), d = _mm256_shuffle_ps(xy2, zw2, 0xee);
  _mm_store_ps(p + 4 * index[0], _mm256_castps256_ps128(a));
  _mm_store_ps(p + 4 * index[1], _mm256_castps256_ps128(b));
  _mm_store_ps(p + 4 * index[2], _mm256_castps256_ps128(c));
  _mm_store_ps(p + 4 * index[3], _mm256_castps256_ps128(d));
  _mm_store_ps(p + 4 * index[4], _mm256_extractf128_ps(a, 1));
  _mm_store_ps(p + 4 * index[5], _mm256_extractf128_ps(b, 1));
  _mm_store_ps(p + 4 * index[6], _mm256_extractf128_ps(c, 1));
  _mm_store_ps(p + 4 * index[7], _mm256_extractf128_ps(d, 1));
}
// Loads the floats at `index` by eight loads: vgatherdps took three times as long on the measured processors.
inline Lanes Pick(const float* p, const int* index) {
  return _mm256_setr_ps(p[index[0]], p[index[1]], p[index[2]], p[index[3]], p[index[4]], p[index[5]], p[index[6]],
                        p[index[7]]);
}

#elif defined(__CUDACC__)

// Eight consecutive threads have a lane each and run in lockstep.
inline int Lane() { return static_cast<int>(threadIdx.x) % kLanes; }

struct Mask {
  bool v;
};

struct Lanes {
  float v;

  Lanes() = default;
  explicit Lanes(float a) : v(a) {}
  static Lanes Load(const float* p) { return Lanes(p[Lane()]); }
  void Store(float* p) const { p[Lane()] = v; }
};

inline Lanes operator+(Lanes a, Lanes b) { return Lanes(__fadd_rn(a.v, b.v)); }
inline Lanes operator-(Lanes a, Lanes b) { return Lanes(__fsub_rn(a.v, b.v)); }
inline Lanes operator*(Lanes a, Lanes b) { return Lanes(__fmul_rn(a.v, b.v)); }
inline Lanes operator/(Lanes a, Lanes b) { return Lanes(__fdiv_rn(a.v, b.v)); }
inline Lanes operator-(Lanes a) { return Lanes(-a.v); }
inline Lanes MultiplyAdd(Lanes a, Lanes b, Lanes c) { return Lanes(__fmaf_rn(a.v, b.v, c.v)); }
inline Lanes NegativeMultiplyAdd(Lanes a, Lanes b, Lanes c) { return Lanes(__fmaf_rn(-a.v, b.v, c.v)); }
inline Lanes Min(Lanes a, Lanes b) { return Lanes(a.v < b.v ? a.v : b.v); }
inline Lanes Max(Lanes a, Lanes b) { return Lanes(a.v > b.v ? a.v : b.v); }
inline Lanes Sqrt(Lanes a) { return Lanes(__fsqrt_rn(a.v)); }
inline Lanes Abs(Lanes a) { return Lanes(fabsf(a.v)); }
inline Lanes CopySign(Lanes a, Lanes sign) { return Lanes(copysignf(a.v, sign.v)); }
inline Mask Less(Lanes a, Lanes b) { return {a.v < b.v}; }
inline Mask LessEqual(Lanes a, Lanes b) { return {a.v <= b.v}; }
inline Mask Equal(Lanes a, Lanes b) { return {a.v == b.v}; }
inline Mask operator&(Mask a, Mask b) { return {a.v && b.v}; }
inline Mask operator|(Mask a, Mask b) { return {a.v || b.v}; }
inline Lanes Select(Mask mask, Lanes a, Lanes b) { return mask.v ? a : b; }
inline unsigned Bits(Mask mask) {
  const unsigned first = threadIdx.x % 32 / kLanes * kLanes;
  return __ballot_sync(0xffu << first, mask.v) >> first & 0xffu;
}
inline float Sum(Lanes a) {
  const unsigned eight = 0xffu << threadIdx.x % 32 / kLanes * kLanes;
  for (int far = kLanes / 2; far > 0; far /= 2) a.v = __fadd_rn(a.v, __shfl_xor_sync(eight, a.v, far));
  return a.v;
}
template <class Index>
inline void Gather4(const float* p, const Index* index, Lanes* x, Lanes* y, Lanes* z, Lanes* w) {
  const float4 a = *reinterpret_cast<const float4*>(p + 4 * index[Lane()]);
  x->v = a.x, y->v = a.y, z->v = a.z, w->v = a.w;
}
inline void Scatter4(float* p, const int* index, Lanes x, Lanes y, Lanes z, Lanes w) {
  *reinterpret_cast<float4*>(p + 4 * index[Lane()]) = make_float4(x.v, y.v, z.v, w.v);
}
template <class Index>
inline Lanes Pick(const float* p, const Index* index) {
  return Lanes(p[index[Lane()]]);
}

#else

struct Mask {
  alignas(32) int v[kLanes];  // 0 or 1.
};

struct Lanes {
  alignas(32) float v[kLanes];

  Lanes() = default;
  explicit Lanes(float a) {
    for (float& x : v) x = a;
  }
  static Lanes Load(const float* p) {
    Lanes out;
    memcpy(out.v, p, sizeof(out.v));
    return out;
  }
  void Store(float* p) const { memcpy(p, v, sizeof(v)); }
};

template <class F>
inline Lanes ByLane(F f) {
  Lanes out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = f(i);
  return out;
}
template <class F>
inline Mask MaskByLane(F f) {
  Mask out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = f(i);
  return out;
}

inline Lanes operator+(Lanes a, Lanes b) {
  return ByLane([&](int i) { return a.v[i] + b.v[i]; });
}
inline Lanes operator-(Lanes a, Lanes b) {
  return ByLane([&](int i) { return a.v[i] - b.v[i]; });
}
inline Lanes operator*(Lanes a, Lanes b) {
  return ByLane([&](int i) { return a.v[i] * b.v[i]; });
}
inline Lanes operator/(Lanes a, Lanes b) {
  return ByLane([&](int i) { return a.v[i] / b.v[i]; });
}
inline Lanes operator-(Lanes a) {
  return ByLane([&](int i) { return -a.v[i]; });
}
inline Lanes MultiplyAdd(Lanes a, Lanes b, Lanes c) {
  return ByLane([&](int i) { return fmaf(a.v[i], b.v[i], c.v[i]); });
}
inline Lanes NegativeMultiplyAdd(Lanes a, Lanes b, Lanes c) {
  return ByLane([&](int i) { return fmaf(-a.v[i], b.v[i], c.v[i]); });
}
inline Lanes Min(Lanes a, Lanes b) {
  return ByLane([&](int i) { return a.v[i] < b.v[i] ? a.v[i] : b.v[i]; });
}
inline Lanes Max(Lanes a, Lanes b) {
  return ByLane([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
}
inline Lanes Sqrt(Lanes a) {
  return ByLane([&](int i) { return sqrtf(a.v[i]); });
}
inline Lanes Abs(Lanes a) {
  return ByLane([&](int i) { return fabsf(a.v[i]); });
}
inline Lanes CopySign(Lanes a, Lanes sign) {
  return ByLane([&](int i) { return copysignf(a.v[i], sign.v[i]); });
}
inline Mask Less(Lanes a, Lanes b) {
  return MaskByLane([&](int i) { return a.v[i] < b.v[i]; });
}
inline Mask LessEqual(Lanes a, Lanes b) {
  return MaskByLane([&](int i) { return a.v[i] <= b.v[i]; });
}
inline Mask Equal(Lanes a, Lanes b) {
  return MaskByLane([&](int i) { return a.v[i] == b.v[i]; });
}
inline Mask operator&(Mask a, Mask b) {
  return MaskByLane([&](int i) { return a.v[i] & b.v[i]; });
}
inline Mask operator|(Mask a, Mask b) {
  return MaskByLane([&](int i) { return a.v[i] | b.v[i]; });
}
inline Lanes Select(Mask mask, Lanes a, Lanes b) {
  return ByLane([&](int i) { return mask.v[i] ? a.v[i] : b.v[i]; });
}
inline unsigned Bits(Mask mask) {
  unsigned bits = 0;
  for (int i = 0; i < kLanes; ++i) bits |= static_cast<unsigned>(mask.v[i]) << i;
  return bits;
}
inline float Sum(Lanes a) {
  const float* v = a.v;
  return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}
inline Lanes Least(Lanes a) {
  float least = a.v[0];
  for (float x : a.v) least = x < least ? x : least;
  return Lanes(least);
}
inline Lanes Largest(Lanes a) {
  float largest = a.v[0];
  for (float x : a.v) largest = x > largest ? x : largest;
  return Lanes(largest);
}
inline void Gather4(const float* p, const int* index, Lanes* x, Lanes* y, Lanes* z, Lanes* w) {
  for (int i = 0; i < kLanes; ++i) {
    const float* a = p + 4 * index[i];
    x->v[i] = a[0], y->v[i] = a[1], z->v[i] = a[2], w->v[i] = a[3];
  }
}
inline void Scatter4(float* p, const int* index, Lanes x, Lanes y, Lanes z, Lanes w) {
  for (int i = 0; i < kLanes; ++i) {
    float* a = p + 4 * index[i];
    a[0] = x.v[i], a[1] = y.v[i], a[2] = z.v[i], a[3] = w.v[i];
  }
}
inline Lanes Pick(const float* p, const int* index) {
  return ByLane([&](int i) { return p[index[i]]; });
}

#endif  // SGM_AVX2

#ifdef __CUDACC__
template <class F>
inline void EachLane(F f) {
  f(Lane());
}
template <class F>
inline void OneLane(F f) {
  if (Lane() == 0) f();
}
// Writes a vector of four floats, aligned to 16 bytes.
inline void Store4(float* p, float x, float y, float z, float w) {
  *reinterpret_cast<float4*>(p) = make_float4(x, y, z, w);
}
// Reads an item into the nearest cache, by all lanes.
template <class T>
inline void Prefetch(const T* p) {
#ifdef __CUDACC_RTC__
  constexpr int kSector = 32;  // [bytes] That a GPU reads together.
  for (int i = kSector * Lane(); i < static_cast<int>(sizeof(T)); i += kSector * kLanes) {
    asm volatile("prefetch.L1 [%0];" ::"l"(reinterpret_cast<const char*>(p) + i));
  }
#endif
}
// Waits for all lanes.
inline void WaitLanes() { __syncwarp(0xffu << threadIdx.x % 32 / kLanes * kLanes); }
#else
// Calls f(lane) for all lanes in order.
template <class F>
inline void EachLane(F f) {
  for (int lane = 0; lane < kLanes; ++lane) f(lane);
}
// Calls f once for all lanes.
template <class F>
inline void OneLane(F f) {
  f();
}
inline void Store4(float* p, float x, float y, float z, float w) { p[0] = x, p[1] = y, p[2] = z, p[3] = w; }
template <class T>
inline void Prefetch(const T*) {}
inline void WaitLanes() {}
#endif

#ifdef SGM_AVX2
inline void Sums(Lanes a, Lanes b, Lanes c, float out[4]) { Sums(a, b, c, c, out); }
#else
inline void Sums(Lanes a, Lanes b, Lanes c, float out[4]) { out[0] = Sum(a), out[1] = Sum(b), out[2] = Sum(c); }
inline void Sums(Lanes a, Lanes b, Lanes c, Lanes d, float out[4]) {
  Sums(a, b, c, out);
  out[3] = Sum(d);
}
#endif

// The same operations on one float, for code that is generic in T.
inline float MultiplyAdd(float a, float b, float c) { return fmaf(a, b, c); }
inline float NegativeMultiplyAdd(float a, float b, float c) { return fmaf(-a, b, c); }
inline float Min(float a, float b) { return a < b ? a : b; }
inline float Max(float a, float b) { return a > b ? a : b; }
inline float Sqrt(float a) { return sqrtf(a); }
inline float Abs(float a) { return fabsf(a); }
inline float CopySign(float a, float sign) { return copysignf(a, sign); }
inline bool Less(float a, float b) { return a < b; }
inline bool LessEqual(float a, float b) { return a <= b; }
inline bool Equal(float a, float b) { return a == b; }
inline float Select(bool mask, float a, float b) { return mask ? a : b; }

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_SIMD_H_
