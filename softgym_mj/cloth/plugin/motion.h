// Transfers the state of vertices and planes from mjData to the solver, and that of vertices back.

#ifndef SOFTGYM_MJ_CLOTH_MOTION_H_
#define SOFTGYM_MJ_CLOTH_MOTION_H_

#include <mujoco/mujoco.h>

#include "cloth/plugin/workspace.h"

namespace softgym_mj::cloth {

// Gathers the initial state of a step; returns false if a number is not finite.
bool Gather(const mjModel* m, const mjData* d, Workspace* w);
// Makes vertices tied by an equality constraint follow MuJoCo's motion.
void HoldTied(const mjModel* m, const mjData* d, Workspace* w);
void FindPlanes(const mjModel* m, const mjData* d, Workspace* w);
// Writes the motion to qvel and qpos: first of vertices in the world frame and then, once bodies have their final
// poses, of vertices that slide in or are tied to bodies.
void Apply(mjData* d, const Workspace& w);
void ApplyToLed(const mjModel* m, mjData* d, const Workspace& w);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_MOTION_H_
