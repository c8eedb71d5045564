// Closest points of a point and a triangle, and of two segments.

#ifndef SOFTGYM_MJ_NATIVE_CLOSEST_H_
#define SOFTGYM_MJ_NATIVE_CLOSEST_H_

#include <algorithm>

#include "vec.h"

namespace softgym_mj {

// Weights (sum 1) of the point of triangle abc closest to p; the set of corners with a weight, as bits.
// Ericson, Real-Time Collision Detection (2005), section 5.1.5.
inline int ClosestOnTriangle(Vector p, Vector a, Vector b, Vector c, double weight[3]) {
  const auto set = [weight](double wa, double wb, double wc, int feature) {
    weight[0] = wa, weight[1] = wb, weight[2] = wc;
    return feature;
  };
  const Vector ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = Dot(ab, ap), d2 = Dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return set(1, 0, 0, 1);
  const double d3 = Dot(ab, bp), d4 = Dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return set(0, 1, 0, 2);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double s = d1 / (d1 - d3);
    return set(1 - s, s, 0, 3);
  }
  const double d5 = Dot(ab, cp), d6 = Dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return set(0, 0, 1, 4);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double s = d2 / (d2 - d6);
    return set(1 - s, 0, s, 5);
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double s = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return set(0, 1 - s, s, 6);
  }
  const double sum = va + vb + vc;
  if (!(sum > 0)) return set(1, 0, 0, 1);  // A triangle without area.
  return set(va / sum, vb / sum, vc / sum, 7);
}

// Parameters s and t in [0, 1] of the closest points of segments ab and cd; true if both lie strictly
// inside. Ericson, section 5.1.9.
inline bool ClosestOnSegments(Vector a, Vector b, Vector c, Vector d, double* s, double* t) {
  const Vector u = b - a, v = d - c, r = a - c;
  const double uu = Dot(u, u), vv = Dot(v, v), uv = Dot(u, v), ur = Dot(u, r), vr = Dot(v, r);
  const double det = uu * vv - uv * uv;
  const auto clamp = [](double x) { return std::min(1.0, std::max(0.0, x)); };
  const bool parallel = det <= 1e-9 * uu * vv;
  *s = parallel ? 0.5 : clamp((uv * vr - ur * vv) / det);
  *t = vv > 0 ? (uv * *s + vr) / vv : 0;
  if (*t < 0 || *t > 1) {
    *t = clamp(*t);
    *s = uu > 0 ? clamp((uv * *t - ur) / uu) : 0;
  }
  return *s > 0 && *s < 1 && *t > 0 && *t < 1;
}

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_CLOSEST_H_
