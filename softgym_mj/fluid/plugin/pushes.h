// Pushes of particles on a wall, as terms of sums: displacements or changes of velocity, and their moments about the
// origin.

#ifndef SOFTGYM_MJ_FLUID_PUSHES_H_
#define SOFTGYM_MJ_FLUID_PUSHES_H_

#include "fluid/plugin/kernels.h"

namespace softgym_mj {
namespace {

constexpr float kLayer = 0.8f;  // Particles nearer than this to a wall touch it, in spacings.

// Calls f(k + lane, terms) for eight pairs with a wall: terms of the sums of displacements and of their moments about
// the origin by which the wall pushes. They are those of `Collide`: `change`, `to` and `push`.
template <class F>
inline void EachPush(const WallPairs& pairs, int count, int k, const Vec3<Lanes>& change, const Vec3<Lanes>& to,
                     Lanes push, F f) {
  float c[3 * kLanes], q[3 * kLanes];
  const Lanes nx = Lanes::Load(pairs.normal + k), ny = Lanes::Load(pairs.normal + pairs.stride + k),
              nz = Lanes::Load(pairs.normal + 2 * pairs.stride + k);
  MultiplyAdd(push, nx, change.x).Store(c);
  MultiplyAdd(push, ny, change.y).Store(c + kLanes);
  MultiplyAdd(push, nz, change.z).Store(c + 2 * kLanes);
  to.x.Store(q);
  to.y.Store(q + kLanes);
  to.z.Store(q + 2 * kLanes);
  EachLane([&](int lane) {
    if (pairs.particle[k + lane] == count) return;  // Padding.
    const double cx = c[lane], cy = c[lane + kLanes], cz = c[lane + 2 * kLanes];
    const double qx = q[lane], qy = q[lane + kLanes], qz = q[lane + 2 * kLanes];
    const double terms[6] = {cx, cy, cz, qy * cz - qz * cy, qz * cx - qx * cz, qx * cy - qy * cx};
    f(k + lane, terms);
  });
}

// Terms of a particle whose velocity changes at a wall (`DragAtWall`).
inline void DragTerms(const Particles& p, int i, const double change[3], double terms[6]) {
  const float* x = p.position + 4 * i;
  for (int k = 0; k < 3; ++k) terms[k] = change[k];
  terms[3] = x[1] * change[2] - x[2] * change[1];
  terms[4] = x[2] * change[0] - x[0] * change[2];
  terms[5] = x[0] * change[1] - x[1] * change[0];
}

// Converts the impulse of a step on a wall to its force in the next one. This lag of one step would be unstable if the
// water is heavier than the body, so only a share of the pending impulse is applied per step; momentum is conserved.
// `moment` is about the origin; `inertia` and `mobility` are those of the water near the body and of the body.
inline void PassOn(const double linear[3], const double moment[3], const double center[3], const double inertia[2],
                   const double mobility[2], double dt, double pending[6], double force[6]) {
  const double offset[3] = {center[1] * linear[2] - center[2] * linear[1],
                            center[2] * linear[0] - center[0] * linear[2],
                            center[0] * linear[1] - center[1] * linear[0]};
  for (int k = 0; k < 6; ++k) {
    const double share = 1 / (1 + inertia[k / 3] * mobility[k / 3]);
    pending[k] += k < 3 ? linear[k] : moment[k - 3] - offset[k - 3];
    force[k] = share * pending[k] / dt;
    pending[k] -= force[k] * dt;
  }
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_PUSHES_H_
