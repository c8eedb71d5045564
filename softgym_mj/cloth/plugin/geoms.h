// Geoms that flexes may touch: MuJoCo's rules, and their shapes.

#ifndef SOFTGYM_MJ_CLOTH_GEOMS_H_
#define SOFTGYM_MJ_CLOTH_GEOMS_H_

#include <string>

#include <mujoco/mujoco.h>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"

namespace softgym_mj::cloth {

// Whether a geom and a flex may touch, by MuJoCo's rules.
bool MayTouch(const mjModel* m, int geom, const Mesh& mesh, int part);
double Friction(const mjModel* m, int geom, int flex);
// Shape of a geom of a type of MuJoCo; a plane for unsupported types.
Shape ShapeOf(int type);
// Size of a geom of mjModel [m].
void CopySize(const mjModel* m, int geom, float size[3]);
// Returns "" or an error about a geom that may touch.
std::string CheckGeoms(const mjModel* m, const Mesh& mesh);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_GEOMS_H_
