// Contact with the floor, as in `Planes`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_PLANE_H_
#define SOFTGYM_MJ_CLOTH_BATCH_PLANE_H_

#include "cloth/batch/environment.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

inline void StartPlane(const Environment& w) {
  const Model& m = *w.model;
  Each(m.padded / kBlock, [&](int b) { w.plane_near[b] = 0; });
  Each(m.vertices, [&](int v) {
    double gap = -m.radius, speed = 0;
    for (int k = 0; k < 3; ++k) {
      gap += m.plane_normal[k] * (w.start[3 * v + k] - m.plane_point[k]);
      speed += w.velocity[3 * v + k] * w.velocity[3 * v + k];
    }
    w.plane_gap[v] = static_cast<float>(gap);
    w.plane_friction[v] = m.plane_friction;
    if (gap < 2 * m.timestep * std::sqrt(speed) + kPlaneMargin) SetBits(&w.plane_near[v / kBlock], 1);
  });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_PLANE_H_
