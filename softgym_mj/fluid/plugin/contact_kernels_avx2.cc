// The cloth contact's inner loops for x86 processors with AVX2 and FMA.

#include <immintrin.h>

#include "contact_kernels_impl.h"

namespace softgym_mj {
namespace {

struct Eight {
  __m256 v;

  Eight() = default;
  explicit Eight(float a) : v(_mm256_set1_ps(a)) {}
  Eight(__m256 a) : v(a) {}
  static Eight Load(const float* p) { return _mm256_load_ps(p); }
  void Store(float* p) const { _mm256_store_ps(p, v); }

  // Four floats of each of eight vertices, as four vectors.
  static void LoadVertices(const float* move, const int* i, Eight* x, Eight* y, Eight* z, Eight* w) {
    const __m256 a = Two(move, i[0], i[4]), b = Two(move, i[1], i[5]);
    const __m256 c = Two(move, i[2], i[6]), d = Two(move, i[3], i[7]);
    Transpose(a, b, c, d, &x->v, &y->v, &z->v, &w->v);
  }
  static void StoreVertices(Eight x, Eight y, Eight z, Eight w, const int* i, float* move) {
    __m256 a, b, c, d;
    Transpose(x.v, y.v, z.v, w.v, &a, &b, &c, &d);
    PutTwo(a, i[0], i[4], move);
    PutTwo(b, i[1], i[5], move);
    PutTwo(c, i[2], i[6], move);
    PutTwo(d, i[3], i[7], move);
  }

 private:
  static __m256 Two(const float* move, int i, int j) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(move + 4 * i)),
                                _mm_load_ps(move + 4 * j), 1);
  }
  static void PutTwo(__m256 a, int i, int j, float* move) {
    _mm_store_ps(move + 4 * i, _mm256_castps256_ps128(a));
    _mm_store_ps(move + 4 * j, _mm256_extractf128_ps(a, 1));
  }
  // Of both halves, as 4 x 4 matrices.
  static void Transpose(__m256 a, __m256 b, __m256 c, __m256 d, __m256* x, __m256* y, __m256* z,
                        __m256* w) {
    const __m256 ab = _mm256_unpacklo_ps(a, b), cd = _mm256_unpacklo_ps(c, d);
    const __m256 ab_high = _mm256_unpackhi_ps(a, b), cd_high = _mm256_unpackhi_ps(c, d);
    *x = _mm256_shuffle_ps(ab, cd, 0x44);
    *y = _mm256_shuffle_ps(ab, cd, 0xee);
    *z = _mm256_shuffle_ps(ab_high, cd_high, 0x44);
    *w = _mm256_shuffle_ps(ab_high, cd_high, 0xee);
  }
};
inline Eight operator+(Eight a, Eight b) { return _mm256_add_ps(a.v, b.v); }
inline Eight operator-(Eight a, Eight b) { return _mm256_sub_ps(a.v, b.v); }
inline Eight operator*(Eight a, Eight b) { return _mm256_mul_ps(a.v, b.v); }
inline Eight operator/(Eight a, Eight b) { return _mm256_div_ps(a.v, b.v); }
inline Eight operator|(Eight a, Eight b) { return _mm256_or_ps(a.v, b.v); }
inline Eight operator<(Eight a, Eight b) { return _mm256_cmp_ps(a.v, b.v, _CMP_LT_OQ); }
inline Eight Differ(Eight a, Eight b) { return _mm256_cmp_ps(a.v, b.v, _CMP_NEQ_UQ); }
inline Eight Max(Eight a, Eight b) { return _mm256_max_ps(a.v, b.v); }
inline Eight Abs(Eight a) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a.v); }
inline Eight Sqrt(Eight a) { return _mm256_sqrt_ps(a.v); }
inline Eight Select(Eight which, Eight a, Eight b) { return _mm256_blendv_ps(b.v, a.v, which.v); }
inline bool Any(Eight a) { return _mm256_movemask_ps(a.v) != 0; }
inline float Sum(Eight a) {
  alignas(32) float v[8];
  a.Store(v);
  return ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
}

int Scan(const BoxView& boxes, int first, int last, const float* box, int* out) {
  const __m256 low_x = _mm256_set1_ps(box[0]), low_y = _mm256_set1_ps(box[1]);
  const __m256 low_z = _mm256_set1_ps(box[2]);
  const __m256 high_y = _mm256_set1_ps(box[4]), high_z = _mm256_set1_ps(box[5]);
  int found = 0;
  for (int i = first; i < last; i += 8) {
    const __m256 x = _mm256_cmp_ps(_mm256_loadu_ps(boxes.high[0] + i), low_x, _CMP_GE_OQ);
    const __m256 y = _mm256_and_ps(
        _mm256_cmp_ps(_mm256_loadu_ps(boxes.low[1] + i), high_y, _CMP_LE_OQ),
        _mm256_cmp_ps(_mm256_loadu_ps(boxes.high[1] + i), low_y, _CMP_GE_OQ));
    const __m256 z = _mm256_and_ps(
        _mm256_cmp_ps(_mm256_loadu_ps(boxes.low[2] + i), high_z, _CMP_LE_OQ),
        _mm256_cmp_ps(_mm256_loadu_ps(boxes.high[2] + i), low_z, _CMP_GE_OQ));
    unsigned bits = _mm256_movemask_ps(_mm256_and_ps(x, _mm256_and_ps(y, z)));
    if (last - i < 8) bits &= (1u << (last - i)) - 1;
    for (; bits; bits &= bits - 1) out[found++] = boxes.id[i + __builtin_ctz(bits)];
  }
  return found;
}

constexpr float kSlack = 1e-4f;  // [m] What rounding may do to the distance of near-parallel edges.

using Eight3 = Vector3<Eight>;

inline Eight Pick(const float* p, const int* i) {
  return _mm256_setr_ps(p[i[0]], p[i[1]], p[i[2]], p[i[3]], p[i[4]], p[i[5]], p[i[6]], p[i[7]]);
}
inline Eight3 Pick(const float* const p[3], const int* i) {
  return {Pick(p[0], i), Pick(p[1], i), Pick(p[2], i)};
}
inline Eight3 Spread(float x, float y, float z) { return {Eight(x), Eight(y), Eight(z)}; }
inline Eight Clamp(Eight a) {  // Of a NaN: 0.
  return _mm256_min_ps(_mm256_max_ps(a.v, _mm256_setzero_ps()), _mm256_set1_ps(1));
}
inline int Keep(Eight square, Eight reach, const int* near, int left, int* out) {
  unsigned bits = _mm256_movemask_ps(_mm256_cmp_ps(square.v, (reach * reach).v, _CMP_LE_OQ));
  if (left < 8) bits &= (1u << left) - 1;
  int found = 0;
  for (; bits; bits &= bits - 1) out[found++] = near[__builtin_ctz(bits)];
  return found;
}

int NearEdges(const EdgeView& edges, int e, const int* near, int count, float reach, int* out) {
  const Eight3 p = Spread(edges.start[0][e], edges.start[1][e], edges.start[2][e]);
  const Eight3 u = Spread(edges.along[0][e], edges.along[1][e], edges.along[2][e]);
  const Eight3 move = Spread(edges.move[0][e], edges.move[1][e], edges.move[2][e]);
  const Eight uu = Dot(u, u), least(1e-20f), base(reach + edges.spread[e] + kSlack);
  int found = 0;
  for (int i = 0; i < count; i += 8) {
    const int* index = near + i;
    const Eight3 v = Pick(edges.along, index), r = p - Pick(edges.start, index);
    const Eight vv = Dot(v, v), uv = Dot(u, v), ur = Dot(u, r), vr = Dot(v, r);
    Eight s = Clamp((uv * vr - ur * vv) / Max(uu * vv - uv * uv, least));
    const Eight t = Clamp((uv * s + vr) / Max(vv, least));
    s = Clamp((uv * t - ur) / Max(uu, least));
    const Eight3 apart = r + s * u - t * v, relative = move - Pick(edges.move, index);
    const Eight limit = base + Pick(edges.spread, index) + Sqrt(Dot(relative, relative));
    found += Keep(Dot(apart, apart), limit, index, count - i, out + found);
  }
  return found;
}

int NearTriangles(const TriangleView& triangles, const float* point, const float* move,
                  const int* near, int count, float reach, int* out) {
  const Eight3 p = Spread(point[0], point[1], point[2]), u = Spread(move[0], move[1], move[2]);
  const Eight base(reach + kSlack), far(1e30f);
  int found = 0;
  for (int i = 0; i < count; i += 8) {
    const int* index = near + i;
    const Eight3 apart = p - Pick(triangles.centre, index);
    const Eight3 relative = u - Pick(triangles.move, index);
    const Eight limit = base + Pick(triangles.spread, index) + Sqrt(Dot(relative, relative));
    // Whether it is too far from the plane or from the sphere.
    const Eight height = Dot(apart, Pick(triangles.normal, index));
    const Eight square = Select(limit * limit < height * height, far, Dot(apart, apart));
    found += Keep(square, limit + Pick(triangles.radius, index), index, count - i, out + found);
  }
  return found;
}

}  // namespace

const ContactKernels kAvx2ContactKernels = {
    Scan,           NearEdges,       NearTriangles,    Sweep<Eight, 4>,
    Sweep<Eight, 2>, Extend<Eight, 4>, Extend<Eight, 2>};

}  // namespace softgym_mj
