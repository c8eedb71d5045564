// Surface of a rope with strands for rendering (tube.h).

#include "native/tube.h"

#include <cmath>
#include <vector>

#include "native/export.h"
#include "native/reset.h"

namespace softgym_mj {
namespace {

constexpr double kTau = 6.283185307179586;
constexpr double kCrease = 0.15;  // Roundness of the valley between strands: 0 is a crease, large values a cosine.

struct Strands {
  int lobes;
  double depth, twist;

  // Relative radius at an angle, at `length` from the start.
  double Radius(double angle, double length) const {
    if (lobes == 0) return 1;
    const double c = std::cos(0.5 * lobes * (angle - twist * length));
    const double height = (std::hypot(c, kCrease) - kCrease) / (std::hypot(1, kCrease) - kCrease);
    return 1 - depth * (1 - height);
  }
};

void Tube(const double* points, int n, double radius, int sides, int rings_per_edge, int cap_rings,
          const Strands& strands, float* vertices, float* normals) {
  const int body = (n - 1) * rings_per_edge + 1, count = body + 2 * cap_rings, row = sides + 1;
  std::vector<Ring> rings(count);
  FollowCurve(points, n, rings_per_edge, &rings[cap_rings]);
  for (int k = 1; k <= cap_rings; ++k) {
    const double angle = kTau / 4 * k / cap_rings, sine = std::sin(angle), cosine = std::cos(angle);
    rings[cap_rings - k] = CapRing(rings[cap_rings], -1, radius, k, cap_rings, sine, cosine);
    rings[cap_rings + body - 1 + k] = CapRing(rings[cap_rings + body - 1], 1, radius, k, cap_rings, sine, cosine);
  }
  std::vector<Vector> surface(static_cast<size_t>(count) * row), out(surface.size());
  for (int i = 0; i < count; ++i) {
    const Ring& ring = rings[i];
    for (int j = 0; j < row; ++j) {
      const double angle = kTau * (j % sides) / sides;
      out[i * row + j] = Outwards(ring, std::cos(angle), std::sin(angle));
      surface[i * row + j] = ring.center + radius * ring.scale * strands.Radius(angle, ring.length) * out[i * row + j];
    }
  }
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < row; ++j) {
      const int at = i * row + j;
      const Vector normal = TubeNormal(rings[i], surface.data(), out[at], i, j, count, sides);
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
