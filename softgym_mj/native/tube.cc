// The surface of a rope, for pictures: a tube along a smooth curve, with rounded ends and, if asked for, strands.

#include <algorithm>
#include <cmath>
#include <vector>

#include "native/export.h"
#include "native/reset.h"
#include "native/vec.h"

namespace softgym_mj {
namespace {

constexpr double kTau = 6.283185307179586;
constexpr double kCrease = 0.15;  // How round the valley between strands is: 0 is a crease, large is a cosine.
// From this direction frames are turned to the start of the tube, the shortest way: only where it starts the opposite
// way do they jump. Ropes seldom do: most lie, and some hang.
const Vector kReference = {1.0 / 3, 2.0 / 3, 2.0 / 3};

struct Ring {
  Vector centre, tangent, normal;
  double length;  // From the start of the tube [m].
  double scale;   // Of the radius.
};

Vector Unit(const Vector& a, const Vector& otherwise) {
  const double length = Norm(a);
  return length > 1e-12 ? 1 / length * a : otherwise;
}

// Turns a vector orthogonal to unit vector `from` as `from` turns to `to`, the shortest way.
Vector Transport(const Vector& v, const Vector& from, const Vector& to) {
  const double cosine = Dot(from, to);
  if (cosine < -1 + 1e-9) return v;
  const Vector turned = v - Dot(v, to) / (1 + cosine) * (from + to);
  return Unit(turned - Dot(turned, to) * to, v);
}

// A cubic from p[1] to p[2] (Catmull and Rom, 1974), at t in [0, 1]; centripetal, so that it makes no loops.
Vector Cubic(const Vector p[4], double t, Vector* derivative) {
  double h[3];
  for (int k = 0; k < 3; ++k) h[k] = std::max(std::sqrt(Norm(p[k + 1] - p[k])), 1e-9);
  const auto slope = [&](int k) {  // At p[k], for t.
    return h[1] * (1 / h[k - 1] * (p[k] - p[k - 1]) - 1 / (h[k - 1] + h[k]) * (p[k + 1] - p[k - 1]) +
                   1 / h[k] * (p[k + 1] - p[k]));
  };
  const Vector m = slope(1), n = slope(2), d = p[2] - p[1];
  const Vector a = m + n - 2.0 * d, b = 3.0 * d - 2.0 * m - n;
  *derivative = m + t * (2.0 * b + 3 * t * a);
  return p[1] + t * (m + t * (b + t * a));
}

// The rings between the caps.
std::vector<Ring> Follow(const double* points, int n, int rings_per_edge) {
  // Beyond the ends the curve goes on as it bends there.
  const auto point = [&](int i) {
    if (i < 0) return 2.0 * FromArray(points) - FromArray(points + 3);
    if (i >= n) return 2.0 * FromArray(points + 3 * (n - 1)) - FromArray(points + 3 * (n - 2));
    return FromArray(points + 3 * i);
  };
  std::vector<Ring> rings;
  for (int i = 0; i < n - 1; ++i) {
    const Vector p[4] = {point(i - 1), point(i), point(i + 1), point(i + 2)};
    for (int k = 0; k < rings_per_edge + (i == n - 2); ++k) {
      Ring ring;
      ring.centre = Cubic(p, static_cast<double>(k) / rings_per_edge, &ring.tangent);
      ring.scale = 1;
      rings.push_back(ring);
    }
  }
  // Where points coincide there is no tangent: the last one goes on, or the first one to come.
  Vector last = {1, 0, 0};
  for (size_t i = rings.size(); i-- > 0;) last = Unit(rings[i].tangent, last);
  for (Ring& ring : rings) last = ring.tangent = Unit(ring.tangent, last);
  // Frames do not turn about the curve.
  const Vector side = {2.0 / 3, 1.0 / 3, -2.0 / 3};  // Orthogonal to it.
  Vector tangent = rings[0].tangent, normal = Transport(side, kReference, tangent);
  double length = 0;
  for (size_t i = 0; i < rings.size(); ++i) {
    if (i > 0) length += Norm(rings[i].centre - rings[i - 1].centre);
    rings[i].length = length;
    rings[i].normal = normal = Transport(normal, tangent, rings[i].tangent);
    tangent = rings[i].tangent;
  }
  return rings;
}

// The rings of half a ball, from its end on the tube outwards.
std::vector<Ring> Cap(const Ring& end, double direction, double radius, int count) {
  std::vector<Ring> rings;
  for (int k = 1; k <= count; ++k) {
    const double angle = kTau / 4 * k / count, out = direction * radius * std::sin(angle);
    Ring ring = end;
    ring.centre = end.centre + out * end.tangent;
    ring.length += out;
    ring.scale = k < count ? std::cos(angle) : 0;
    rings.push_back(ring);
  }
  return rings;
}

struct Strands {
  int lobes;
  double depth, twist;

  // The share of the radius at an angle, `length` from the start.
  double Radius(double angle, double length) const {
    if (lobes == 0) return 1;
    const double c = std::cos(0.5 * lobes * (angle - twist * length));
    const double height = (std::hypot(c, kCrease) - kCrease) / (std::hypot(1, kCrease) - kCrease);
    return 1 - depth * (1 - height);
  }
};

void Tube(const double* points, int n, double radius, int sides, int rings_per_edge, int cap_rings,
          const Strands& strands, float* vertices, float* normals) {
  const std::vector<Ring> body = Follow(points, n, rings_per_edge);
  std::vector<Ring> rings = Cap(body.front(), -1, radius, cap_rings), end = Cap(body.back(), 1, radius, cap_rings);
  std::reverse(rings.begin(), rings.end());
  rings.insert(rings.end(), body.begin(), body.end());
  rings.insert(rings.end(), end.begin(), end.end());

  const int count = static_cast<int>(rings.size()), row = sides + 1;  // The first side is the last one, too.
  std::vector<Vector> surface(static_cast<size_t>(count) * row), out(surface.size());
  for (int i = 0; i < count; ++i) {
    const Ring& ring = rings[i];
    const Vector binormal = Cross(ring.tangent, ring.normal);
    for (int j = 0; j < row; ++j) {
      const double angle = kTau * (j % sides) / sides;
      out[i * row + j] = std::cos(angle) * ring.normal + std::sin(angle) * binormal;
      surface[i * row + j] = ring.centre + radius * ring.scale * strands.Radius(angle, ring.length) * out[i * row + j];
    }
  }
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < row; ++j) {
      const int at = i * row + j;
      Vector normal = (i == 0 ? -1.0 : 1.0) * rings[i].tangent;
      if (i > 0 && i < count - 1) {
        const Vector along = surface[at + row] - surface[at - row];
        const Vector around = surface[i * row + (j + 1) % sides] - surface[i * row + (j + sides - 1) % sides];
        normal = Unit(Cross(around, along), out[at]);
        // In a bend narrower than the tube, its inside is outside.
        if (Dot(normal, out[at]) < 0) normal = out[at];
      }
      const Vector* sources[2] = {&surface[at], &normal};
      float* targets[2] = {vertices + 3 * at, normals + 3 * at};
      for (int k = 0; k < 2; ++k) {
        targets[k][0] = static_cast<float>(sources[k]->x);
        targets[k][1] = static_cast<float>(sources[k]->y);
        targets[k][2] = static_cast<float>(sources[k]->z);
      }
    }
  }
}

}  // namespace
}  // namespace softgym_mj

// Writes the vertices and normals, (rings, sides + 1, 3) each, of a tube along n >= 2 points, where rings are
// rings_per_edge (n - 1) + 1 + 2 cap_rings. Returns 0; 2 if memory runs out.
SGM_EXPORT int softgym_mj_tube(const double* points, int n, double radius, int sides, int rings_per_edge, int cap_rings,
                               int lobes, double depth, double twist, float* vertices, float* normals) {
  using namespace softgym_mj;
  const bool tried = WithinMemory(
      [&] { Tube(points, n, radius, sides, rings_per_edge, cap_rings, {lobes, depth, twist}, vertices, normals); });
  return tried ? 0 : 2;
}
