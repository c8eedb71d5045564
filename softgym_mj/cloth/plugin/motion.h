// Between mjData and the solver: what vertices and planes do at the start of a step, and vertices at its end.

#ifndef SOFTGYM_MJ_CLOTH_MOTION_H_
#define SOFTGYM_MJ_CLOTH_MOTION_H_

#include <mujoco/mujoco.h>

#include "cloth/plugin/workspace.h"

namespace softgym_mj::cloth {

// Fills what the vertices start with; false if something is not finite.
bool Gather(const mjModel* m, const mjData* d, Workspace* w);
// Vertices that an equality ties to something else move as MuJoCo has moved them.
void HoldTied(const mjModel* m, const mjData* d, Workspace* w);
void FindPlanes(const mjModel* m, const mjData* d, Workspace* w);
// Writes the motion to qvel and qpos: first of vertices in the world, and, once bodies are where they go, of those that
// slide in them or are tied to them.
void Apply(mjData* d, const Workspace& w);
void ApplyToLed(const mjModel* m, mjData* d, const Workspace& w);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_MOTION_H_
