// Culling: whether vertices may come near a solid in a step.

#ifndef SOFTGYM_MJ_CLOTH_NEAR_H_
#define SOFTGYM_MJ_CLOTH_NEAR_H_

#include <cmath>

#include "cloth/plugin/grids.h"
#include "cloth/plugin/kernels.h"
#include "native/shapes.h"

namespace softgym_mj::cloth {
namespace {

// Whether vertices may come nearer than `margin` [m], tested with bounding spheres. `position`: x y z and displacement
// in the step of each vertex [m]. `bound`: bounding radius of the solid [m].
inline bool ComesNear(const float* position, const int* vertex, int corners, const Geom& solid, float bound,
                      float margin) {
  float middle[3] = {0, 0, 0}, furthest = 0, fastest = 0, away = 0;
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < corners; ++c) middle[k] += position[4 * vertex[c] + k];
    middle[k] /= corners;
    away += (middle[k] - solid.pose[k]) * (middle[k] - solid.pose[k]);
  }
  for (int c = 0; c < corners; ++c) {
    float square = 0;
    for (int k = 0; k < 3; ++k) {
      const float d = position[4 * vertex[c] + k] - middle[k];
      square += d * d;
    }
    furthest = Max(furthest, square);
    fastest = Max(fastest, position[4 * vertex[c] + 3]);
  }
  const float reach = std::sqrt(furthest) + margin + fastest;
  if (away > (bound + reach) * (bound + reach)) return false;
  Vec3<float> normal;
  const Vec3<float> local = ToLocal(solid.pose, Vec3<float>{middle[0], middle[1], middle[2]});
  if (HasGrid(solid)) return GridComesNear(solid, local, reach);
  return Distance<float>(solid.shape, solid.size, local, &normal) < reach;
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_NEAR_H_
