// Engine plugin "softgym_mj.cloth": elasticity, bending, contact and friction of flexes in one solver.

#ifndef SOFTGYM_MJ_CLOTH_CLOTH_H_
#define SOFTGYM_MJ_CLOTH_CLOTH_H_

#include <mujoco/mujoco.h>

namespace softgym_mj::cloth {

void RegisterCloth();

// Advances flexes and the bodies that they push to the end of the step, once per step. Other plugins that read their
// positions may call it first.
void AdvanceFlexes(const mjModel* m, mjData* d);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_CLOTH_H_
