// Motion of rigid bodies and their geoms during a step, shared by all solvers.

#ifndef SOFTGYM_MJ_CLOTH_RIGID_H_
#define SOFTGYM_MJ_CLOTH_RIGID_H_

#include "cloth/plugin/kernels.h"
#include "native/rotation.h"

namespace softgym_mj::cloth {

// Displacement of a body since the start of a step.
struct Displacement {
  double shift[3];  // Of its center of mass [m].
  double turn[4];   // Rotation (quaternion).
};

namespace {

// Moves a body by a substep of h [s] without contact. `center`: center of mass at the start of the step [m].
inline void MoveRigid(const double center[3], const Displacement& so_far, const double acceleration[6], double h,
                      Rigid* rigid) {
  for (int k = 0; k < 6; ++k) {
    rigid->move[k] += h * h * acceleration[k];
    rigid->impulse[k] = 0;
  }
  for (int k = 0; k < 3; ++k) rigid->center[k] = static_cast<float>(center[k] + so_far.shift[k]);
}

// Ends a substep.
inline void FinishRigid(const Rigid& rigid, Displacement* so_far) {
  for (int k = 0; k < 3; ++k) so_far->shift[k] += rigid.move[k];
  // The rotation is small: no sine is needed, which would differ between libraries.
  const double* w = rigid.move + 3;
  const double q[4] = {1, w[0] / 2, w[1] / 2, w[2] / 2};
  double turn[4];
  MulQuat(q, so_far->turn, turn);
  Normalize4(turn);
  for (int k = 0; k < 4; ++k) so_far->turn[k] = turn[k];
}

// Moves body `o` by the impulses of a sweep on other bodies of its tree. `dofs(b)`: number of degrees of freedom of the
// tree of body b.
template <class B, class F>
inline void TakeImpulses(B* bodies, int number, int o, F dofs) {
  B& own = bodies[o];
  double move[6];
  for (int k = 0; k < 6; ++k) move[k] = own.rigid.move[k];
  for (int b = 0; b < number; ++b) {
    const B& body = bodies[b];
    const double* impulse = body.rigid.impulse;
    bool pushed = false;
    for (int k = 0; k < 6; ++k) pushed |= impulse[k] != 0;
    if (!pushed || o == b || own.tree != body.tree || !own.rigid.is_pushable) continue;
    const int n = dofs(b);
    for (int i = 0; i < n; ++i) {
      double response = 0;
      for (int k = 0; k < 6; ++k) response += body.response[6 * i + k] * impulse[k];
      for (int k = 0; k < 6; ++k) move[k] += own.jacobian[n * k + i] * response;
    }
  }
  for (int k = 0; k < 6; ++k) own.rigid.move[k] = move[k];
}

// Ends a sweep: adds its impulses to those of the step.
template <class B>
inline void EndImpulses(B* body) {
  for (int k = 0; k < 6; ++k) {
    double* impulse = body->rigid.impulse + k;
    body->touched |= *impulse != 0;
    body->impulse[k] += *impulse;
    *impulse = 0;
  }
}

// Computes the current pose of a geom. `offset` [m] and `matrix`: its pose relative to the center of mass at the start
// of the step.
inline void PlaceGeom(const double center[3], const Displacement& so_far, const double offset[3],
                      const double matrix[9], Geom* geom) {
  double turned[3];
  RotVecQuat(offset, so_far.turn, turned);
  for (int k = 0; k < 3; ++k) geom->pose[k] = static_cast<float>(center[k] + so_far.shift[k] + turned[k]);
  for (int c = 0; c < 3; ++c) {
    const double column[3] = {matrix[c], matrix[3 + c], matrix[6 + c]};
    RotVecQuat(column, so_far.turn, turned);
    for (int k = 0; k < 3; ++k) geom->pose[3 + 3 * k + c] = static_cast<float>(turned[k]);
  }
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_RIGID_H_
