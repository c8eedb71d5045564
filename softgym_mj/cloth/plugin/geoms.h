// Geoms that flexes may touch: MuJoCo's rules, and their shapes.

#ifndef SOFTGYM_MJ_CLOTH_GEOMS_H_
#define SOFTGYM_MJ_CLOTH_GEOMS_H_

#include <memory>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/mesh_grids.h"

namespace softgym_mj::cloth {

// Grid of each geom of the model; null unless it is a mesh that may touch a flex.
using MeshGrids = std::vector<std::shared_ptr<const MeshGrid>>;

// Whether a geom and flexes of one material, or of any of several, may touch.
bool MayTouch(const mjModel* m, int geom, const Material& material);
bool MayTouchAny(const mjModel* m, int geom, const std::vector<Material>& materials);
double Friction(const mjModel* m, int geom, int flex);
// Shape of a geom; a plane for unsupported types.
Shape ShapeOf(const mjModel* m, int geom);
// Size of a geom of mjModel [m].
void CopySize(const mjModel* m, int geom, float size[3]);
// Heights of a heightfield's geom.
Grid HeightsOf(const mjModel* m, int geom);
// Appends the meshes that may touch flexes.
void WriteMeshes(const mjModel* m, const std::vector<Material>& materials, std::string* out);
// Finds the grids of meshes. Returns "" or an error about a geom that may touch.
std::string FindGrids(const mjModel* m, const std::vector<Material>& materials, MeshGrids* grids);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_GEOMS_H_
