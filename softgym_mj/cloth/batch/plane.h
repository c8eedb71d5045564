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
  // With bodies near, the floor is swept as often as the repeated rows that push vertices into it.
  Each(TouchesBodies(w) ? m.padded / kBlock : 0, [&](int b) {
    w.plane_repeats[b] = 0;
    for (int i = 0; i < 4 * kBlock; ++i) w.plane_impulse[4 * kBlock * b + i] = 0;
    for (int v = kBlock * b; v < kBlock * (b + 1) && v < m.vertices; ++v) w.plane_repeats[b] |= w.near_vertex[v];
  });
}

// Calls f(plane, first vertex) for all blocks of vertices near the plane: near bodies, too, if `near`, or the others.
template <class F>
inline void EachPlaneBlock(const Environment& w, bool near, F f) {
  const Model& m = *w.model;
  const Plane plane = {{static_cast<float>(m.plane_normal[0]), static_cast<float>(m.plane_normal[1]),
                        static_cast<float>(m.plane_normal[2])},
                       w.plane_gap,
                       w.plane_friction,
                       near ? w.plane_impulse : nullptr,
                       nullptr,
                       0};
  const bool bodies = TouchesBodies(w);
  EachBlock(0, m.padded / kBlock, [&](int b) {
    if (w.plane_near[b] && (bodies && w.plane_repeats[b]) == near) f(plane, kBlock * b);
  });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_PLANE_H_
