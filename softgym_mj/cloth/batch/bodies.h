// Bodies of grippers and solids during a step, as in `Bodies`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_BODIES_H_
#define SOFTGYM_MJ_CLOTH_BATCH_BODIES_H_

#include "cloth/batch/environment.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

// Starts bodies, and the box around all vertices.
inline void StartBodies(const Environment& w) {
  const Model& m = *w.model;
  const Solid* solids = m.At<Solid>(m.solids_at);
  Each(m.bodies, [&](int b) {
    Mover& body = w.bodies[b];
    const int first = m.At<int>(m.first_solids_at)[b], own = kSolids ? first - m.grippers : -1,
              n = own < 0 ? 0 : w.dofs;
    double center[3] = {0, 0, 0};
    if (own >= 0) RotVecQuat(solids[first].center, w.poses + 7 * own + 3, center);
    for (int k = 0; k < 3; ++k) {
      body.center[k] = own < 0 ? w.gripper_qpos[3 * b + k] : w.poses[7 * own + k] + center[k];
      body.so_far.shift[k] = 0;
    }
    for (int k = 0; k < 4; ++k) body.so_far.turn[k] = k == 0;
    body.tree = m.At<int>(m.trees_at)[b];
    body.touched = 0;
    body.jacobian = w.jacobians + 6 * n * own;
    body.response = w.responses + 6 * n * own;
    double (*c)[6] = body.rigid.compliance;
    for (int k = 0; k < 6; ++k) {
      const double of_gripper = k < 3 && own < 0 ? w.gripper_qvel[3 * b + k] : 0;
      body.rigid.move[k] = m.h * (own < 0 ? of_gripper : w.velocities[6 * own + k]);
      body.acceleration[k] = own < 0 ? 0 : w.accelerations[6 * own + k];
      body.rigid.impulse[k] = body.impulse[k] = body.moved[k] = 0;
      for (int l = 0; l < 6; ++l) {
        c[k][l] = 0;
        for (int i = 0; i < n; ++i) c[k][l] += body.jacobian[n * k + i] * body.response[6 * i + l];
      }
    }
    body.inverse_mass = c[0][0];
    for (int k = 1; k < 3; ++k) body.inverse_mass = c[k][k] > body.inverse_mass ? c[k][k] : body.inverse_mass;
    body.rigid.is_pushable = kSolids && body.inverse_mass > kYields;
    for (int k = 0; k < 36 && !body.rigid.is_pushable; ++k) c[k / 6][k % 6] = 0;
  });
  Each(Solids(m) > 0 ? 3 : 0, [&](int k) {
    double low = w.start[k], high = low;
    for (int v = 1; v < m.vertices; ++v) {
      const double x = w.start[3 * v + k];
      low = x < low ? x : low;
      high = high < x ? x : high;
    }
    w.step->low[k] = low, w.step->high[k] = high;
  });
  Once([&] { w.step->touches_bodies = w.step->touches_light = w.step->repeats = 0; });
}

// Moves bodies by a substep without contact.
inline void MoveBodies(const Environment& w) {
  const Model& m = *w.model;
  Each(m.bodies, [&](int b) {
    Mover& body = w.bodies[b];
    if (!kSolids || b < m.grippers) {  // It has no acceleration and never turns: this has the bits of the general case.
      for (int k = 0; k < 3; ++k) body.rigid.center[k] = static_cast<float>(body.center[k] + body.so_far.shift[k]);
      return;
    }
    MoveRigid(body.center, body.so_far, body.acceleration, m.h, &body.rigid);
  });
}

// Propagates the impulses of a sweep to the other bodies of each tree.
inline void ShareImpulses(const Environment& w) {
  const int number = TouchesBodies(w) ? w.model->bodies : 0;
  Each(number, [&](int b) { TakeImpulses(w.bodies, number, b, [&](int) { return w.dofs; }); });
  Each(number, [&](int b) { EndImpulses(&w.bodies[b]); });
}

// Ends a substep.
inline void FinishBodies(const Environment& w) {
  Each(w.model->bodies, [&](int b) {
    Mover& body = w.bodies[b];
    if (!kSolids || b < w.model->grippers) {
      for (int k = 0; k < 3; ++k) body.so_far.shift[k] += body.rigid.move[k];
      return;
    }
    for (int k = 0; k < 6; ++k) body.moved[k] += body.impulse[k];
    FinishRigid(body.rigid, &body.so_far);
  });
}

// Writes impulses of the flex on bodies, to the first solid of each.
inline void WriteImpulses(const Environment& w) {
  const Model& m = *w.model;
  Each(12 * Solids(m), [&](int i) { w.solid_impulses[i] = 0; });
  Each(Solids(m) > 0 ? m.bodies : 0, [&](int b) {
    const Mover& body = w.bodies[b];
    const int own = m.At<int>(m.first_solids_at)[b] - m.grippers;
    for (int k = 0; k < 6 && body.touched && own >= 0; ++k) {
      w.solid_impulses[12 * own + k] = body.impulse[k];
      w.solid_impulses[12 * own + 6 + k] = body.moved[k];
    }
  });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_BODIES_H_
