// Tests whether two features may touch, for T = float or `Lanes`, under the restrictions of native/simd.h.

#ifndef SOFTGYM_MJ_CLOTH_SEARCH_H_
#define SOFTGYM_MJ_CLOTH_SEARCH_H_

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/sweeps.h"
#include "native/simd.h"

namespace softgym_mj::cloth {
namespace {

constexpr float kParallel = 1e-6f;  // Squared sine below which edges count as parallel.

// Parameter of the point of segment a-b closest to p, with ap = p - a.
template <class T>
inline T AlongSegment(const Vec3<T>& ab, const Vec3<T>& ap) {
  return Min(Max(Inner(ab, ap) / Max(Inner(ab, ab), T(kTinySquare)), T(0.0f)), T(1.0f));
}

// Weights of the point of triangle abc closest to p.
template <class T>
inline void ClosestOnTriangle(const Vec3<T>& p, const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c, T weight[3]) {
  const T zero(0.0f), one(1.0f);
  const Vec3<T> ab = b - a, ac = c - a, bc = c - b, ap = p - a, bp = p - b;
  // Inside: barycentric coordinates of the projection.
  const T bb = Inner(ab, ab), bcc = Inner(ab, ac), cc = Inner(ac, ac), pb = Inner(ab, ap), pc = Inner(ac, ap);
  const T scale = one / Max(NegativeMultiplyAdd(bcc, bcc, bb * cc), T(1e-30f));
  const T v = NegativeMultiplyAdd(bcc, pc, cc * pb) * scale, w = NegativeMultiplyAdd(bcc, pb, bb * pc) * scale;
  const T u = one - v - w;
  const auto inside = Less(zero, u) & Less(zero, v) & Less(zero, w);
  // On the border: the nearest of the three sides' closest points.
  const T s1 = AlongSegment(ab, ap), s2 = AlongSegment(ac, ap), s3 = AlongSegment(bc, bp);
  const auto square = [](const Vec3<T>& d) { return Inner(d, d); };
  const T d1 = square(AddScaled(ap, -s1, ab)), d2 = square(AddScaled(ap, -s2, ac));
  const T d3 = square(AddScaled(bp, -s3, bc));
  const auto first = LessEqual(d1, d2) & LessEqual(d1, d3);
  const auto second = LessEqual(d2, d3);
  const T wa = Select(first, one - s1, Select(second, one - s2, zero));
  const T wb = Select(first, s1, Select(second, zero, one - s3));
  const T wc = Select(first, zero, Select(second, s2, s3));
  weight[0] = Select(inside, u, wa);
  weight[1] = Select(inside, v, wb);
  weight[2] = Select(inside, w, wc);
}

// Parameters of the closest points of segments from a along u and from c along v. Ericson, Real-Time Collision
// Detection (2005), section 5.1.9.
template <class T>
inline void ClosestOnSegments(const Vec3<T>& u, const Vec3<T>& v, const Vec3<T>& r, T* s, T* t) {
  const T zero(0.0f), one(1.0f);
  const T uu = Inner(u, u), vv = Inner(v, v), uv = Inner(u, v), ur = Inner(u, r), vr = Inner(v, r);
  const T det = NegativeMultiplyAdd(uv, uv, uu * vv);
  const auto clamp = [&](T x) { return Min(Max(x, zero), one); };
  const auto skew = Less(T(kParallel) * (uu * vv), det);
  *s = Select(skew, clamp(NegativeMultiplyAdd(ur, vv, uv * vr) / Max(det, T(1e-30f))), T(0.5f));
  const T free = MultiplyAdd(uv, *s, vr) / Max(vv, T(kTinySquare));
  *t = clamp(free);
  const T again = clamp((uv * *t - ur) / Max(uu, T(kTinySquare)));
  *s = Select(Equal(free, *t), *s, again);
}

// Whether two features, the first of `num_first` vertices, may come nearer than `reach` in a step.
template <class T>
inline auto MayMeet(const Vec3<T> position[4], const Vec3<T> move[4], int num_first, const T weight[4], T reach,
                    Vec3<T>* normal, T* distance) {
  Vec3<T> apart = {T(0.0f), T(0.0f), T(0.0f)};
  for (int k = 0; k < 4; ++k) apart = AddScaled(apart, weight[k], position[k]);
  *distance = Sqrt(Inner(apart, apart));
  *normal = (T(1.0f) / Max(*distance, T(kTinyLength))) * apart;
  T lowest(1e30f), highest(-1e30f);
  for (int k = 0; k < 4; ++k) {
    const T along = Inner(*normal, move[k]);
    if (k < num_first) {
      lowest = Min(lowest, along);
    } else {
      highest = Max(highest, along);
    }
  }
  const T approach = Max(highest - lowest, T(0.0f));
  return Less(*distance - approach, reach) & Less(T(kTinyLength), *distance);
}

// Returns which boxes of `eight` overlap one box, as bits.
inline unsigned Touching(const Boxes& eight, const Lanes3& low, const Lanes3& high) {
  const Lanes3 least = Load3(eight.low), most = Load3(eight.high);
  return Bits((LessEqual(least.x, high.x) & LessEqual(low.x, most.x)) &
              (LessEqual(least.y, high.y) & LessEqual(low.y, most.y)) &
              (LessEqual(least.z, high.z) & LessEqual(low.z, most.z)));
}
inline void Broadcast(const Boxes& eight, int i, Lanes3* low, Lanes3* high) {
  *low = {Lanes(eight.low[0][i]), Lanes(eight.low[1][i]), Lanes(eight.low[2][i])};
  *high = {Lanes(eight.high[0][i]), Lanes(eight.high[1][i]), Lanes(eight.high[2][i])};
}

// Calls take(pair) for each of up to eight candidates, two ids each, that may touch: a vertex and a triangle, or two
// edges.
template <bool edges, class F>
inline void Filter(const Scene& scene, const int* ids, int size, F take) {
  int vertex[4][kBlock];
  float thickness[kBlock];
  EachLane([&](int lane) {
    const int* id = ids + 2 * (lane < size ? lane : 0);
    for (int k = 0; k < 4; ++k) {
      vertex[k][lane] = edges    ? scene.edges[2 * id[k / 2] + k % 2]
                        : k == 0 ? id[0]
                                 : scene.triangles[3 * id[1] + k - 1];
    }
    thickness[lane] = scene.thickness[scene.part[vertex[0][lane]] * scene.num_parts + scene.part[vertex[3][lane]]];
  });
  Lanes unused, weight[4], distance;
  Lanes3 x[4], move[4], normal;
  for (int k = 0; k < 4; ++k) {
    x[k] = Gather(scene.position, vertex[k], &unused);
    move[k] = Gather(scene.move, vertex[k], &unused);
  }
  if (edges) {
    Lanes s, t;
    ClosestOnSegments(x[1] - x[0], x[3] - x[2], x[0] - x[2], &s, &t);
    weight[0] = Lanes(1.0f) - s, weight[1] = s, weight[2] = t - Lanes(1.0f), weight[3] = -t;
  } else {
    Lanes on[3];
    ClosestOnTriangle(x[0], x[1], x[2], x[3], on);
    weight[0] = Lanes(1.0f), weight[1] = -on[0], weight[2] = -on[1], weight[3] = -on[2];
  }
  const Lanes reach = Lanes(scene.interest) * Lanes::Load(thickness);
  const unsigned wanted = Bits(MayMeet(x, move, edges ? 2 : 1, weight, reach, &normal, &distance));
  if (!(wanted & ((1u << size) - 1))) return;
  float q[4][kBlock], n[3][kBlock], d[kBlock];
  for (int k = 0; k < 4; ++k) weight[k].Store(q[k]);
  Store3(normal, n);
  distance.Store(d);
  EachLane([&](int lane) {
    if (lane >= size || !(wanted >> lane & 1)) return;
    Pair pair;
    int region = 0;
    for (int k = 0; k < 4; ++k) {
      pair.vertex[k] = vertex[k][lane];
      pair.weight[k] = q[k][lane];
      region |= (q[k][lane] != 0) << k;
    }
    for (int k = 0; k < 3; ++k) pair.normal[k] = n[k][lane];
    pair.distance = d[lane];
    pair.edges = edges;
    pair.region = static_cast<std::int16_t>(edges ? region : region >> 1);
    pair.first = ids[2 * lane];
    pair.second = ids[2 * lane + 1];
    take(pair);
  });
}

// Whether the sides of a pair approach by more than `share` of their distance.
inline bool Approaches(const float* now, const Pair& pair, float share) {
  float low = 1e30f, high = -1e30f;
  for (int k = 0; k < 4; ++k) {
    const float* u = now + 4 * pair.vertex[k];
    const float along = pair.normal[0] * u[0] + pair.normal[1] * u[1] + pair.normal[2] * u[2];
    if (k < 1 + pair.edges) {
      low = along < low ? along : low;
    } else {
      high = along > high ? along : high;
    }
  }
  return high - low > share * pair.distance;
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SEARCH_H_
