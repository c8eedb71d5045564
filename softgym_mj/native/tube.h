// Surface of a rope for rendering: a tube along a smooth curve with rounded ends.

#ifndef SOFTGYM_MJ_NATIVE_TUBE_H_
#define SOFTGYM_MJ_NATIVE_TUBE_H_

#include <algorithm>
#include <cmath>

#include "native/vec.h"

namespace softgym_mj {

struct Ring {
  Vector center, tangent, normal;
  double length;  // From the start of the tube [m].
  double scale;   // Factor of the radius.
};

namespace {

// Frames at the start of the tube are rotated from this direction along the shortest path; they jump only if the tube
// starts in the opposite direction, which is rare because most ropes lie and some hang.
constexpr Vector kReference = {1.0 / 3, 2.0 / 3, 2.0 / 3};

inline Vector Unit(const Vector& a, const Vector& otherwise) {
  const double length = Norm(a);
  return length > 1e-12 ? 1 / length * a : otherwise;
}

// Parallel transport: rotates a vector orthogonal to unit vector `from` by the shortest rotation from `from` to `to`.
inline Vector Transport(const Vector& v, const Vector& from, const Vector& to) {
  const double cosine = Dot(from, to);
  if (cosine < -1 + 1e-9) return v;
  const Vector turned = v - Dot(v, to) / (1 + cosine) * (from + to);
  return Unit(turned - Dot(turned, to) * to, v);
}

// A cubic from p[1] to p[2] (Catmull and Rom, 1974), at t in [0, 1]; centripetal, so that it makes no loops.
inline Vector Cubic(const Vector p[4], double t, Vector* derivative) {
  double h[3];
  for (int k = 0; k < 3; ++k) h[k] = std::max(std::sqrt(Norm(p[k + 1] - p[k])), 1e-9);
  const auto slope = [&](int k) {  // Derivative at p[k] with respect to t.
    return h[1] * (1 / h[k - 1] * (p[k] - p[k - 1]) - 1 / (h[k - 1] + h[k]) * (p[k + 1] - p[k - 1]) +
                   1 / h[k] * (p[k + 1] - p[k]));
  };
  const Vector m = slope(1), n = slope(2), d = p[2] - p[1];
  const Vector a = m + n - 2.0 * d, b = 3.0 * d - 2.0 * m - n;
  *derivative = m + t * (2.0 * b + 3 * t * a);
  return p[1] + t * (m + t * (b + t * a));
}

// Writes the rings between the caps, (n - 1) rings_per_edge + 1, along n points.
inline void FollowCurve(const double* points, int n, int rings_per_edge, Ring* rings) {
  // Beyond the ends the curve is extrapolated with its curvature.
  const auto point = [&](int i) {
    if (i < 0) return 2.0 * FromArray(points) - FromArray(points + 3);
    if (i >= n) return 2.0 * FromArray(points + 3 * (n - 1)) - FromArray(points + 3 * (n - 2));
    return FromArray(points + 3 * i);
  };
  int count = 0;
  for (int i = 0; i < n - 1; ++i) {
    const Vector p[4] = {point(i - 1), point(i), point(i + 1), point(i + 2)};
    for (int k = 0; k < rings_per_edge + (i == n - 2); ++k) {
      Ring& ring = rings[count++];
      ring.center = Cubic(p, static_cast<double>(k) / rings_per_edge, &ring.tangent);
      ring.scale = 1;
    }
  }
  // Coincident points have no tangent and use the previous one, or else the next one.
  Vector last = {1, 0, 0};
  for (int i = count; i-- > 0;) last = Unit(rings[i].tangent, last);
  for (int i = 0; i < count; ++i) last = rings[i].tangent = Unit(rings[i].tangent, last);
  // Frames do not rotate about the curve.
  const Vector side = {2.0 / 3, 1.0 / 3, -2.0 / 3};  // Orthogonal to it.
  Vector tangent = rings[0].tangent, normal = Transport(side, kReference, tangent);
  double length = 0;
  for (int i = 0; i < count; ++i) {
    if (i > 0) length += Norm(rings[i].center - rings[i - 1].center);
    rings[i].length = length;
    rings[i].normal = normal = Transport(normal, tangent, rings[i].tangent);
    tangent = rings[i].tangent;
  }
}

// Ring number k > 0 of `count` of half a ball, from its end on the tube outwards. `sine`, `cosine`: of its angle,
// (tau / 4) k / count.
inline Ring CapRing(Ring end, double direction, double radius, int k, int count, double sine, double cosine) {
  const double out = direction * radius * sine;
  end.center = end.center + out * end.tangent;
  end.length += out;
  end.scale = k < count ? cosine : 0;
  return end;
}

// Direction from the center of a ring outwards.
inline Vector Outwards(const Ring& ring, double cosine, double sine) {
  return cosine * ring.normal + sine * Cross(ring.tangent, ring.normal);
}

// The normal of vertex j of ring i of (count, sides + 1), whose last one is the first one, too. `out`: as `Outwards`.
inline Vector TubeNormal(const Ring& ring, const Vector* surface, const Vector& out, int i, int j, int count,
                         int sides) {
  if (i == 0 || i == count - 1) return (i == 0 ? -1.0 : 1.0) * ring.tangent;
  const int row = sides + 1, at = i * row + j;
  const Vector along = surface[at + row] - surface[at - row];
  const Vector around = surface[i * row + (j + 1) % sides] - surface[i * row + (j + sides - 1) % sides];
  const Vector normal = Unit(Cross(around, along), out);
  return Dot(normal, out) < 0 ? out : normal;  // In a bend narrower than the tube, its inside is outside.
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_TUBE_H_
