// The engine plugin "softgym_mj.cloth": elasticity, bending, contact and friction of flexes in one solve.

#ifndef SOFTGYM_MJ_CLOTH_CLOTH_H_
#define SOFTGYM_MJ_CLOTH_CLOTH_H_

#include <mujoco/mujoco.h>

namespace softgym_mj::cloth {

void RegisterCloth();

// Moves flexes, and what they push, to the end of a step, unless that has been done in it. For plugins that look where
// these are, and may advance first.
void AdvanceFlexes(const mjModel* m, mjData* d);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_CLOTH_H_
