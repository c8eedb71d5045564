// Signed distances to the meshes of a model.

#ifndef SOFTGYM_MJ_CLOTH_MESH_GRIDS_H_
#define SOFTGYM_MJ_CLOTH_MESH_GRIDS_H_

#include <memory>
#include <string>

#include <mujoco/mujoco.h>

#include "cloth/plugin/kernels.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// A grid and the memory of its nodes.
struct MeshGrid {
  Grid grid;
  AlignedFloats nodes;
};

// Finds the grid of a mesh: it is computed once per process for the same vertices and triangles, among the last ones
// used. Returns "" or what is expected instead of this mesh.
std::string FindMeshGrid(const mjModel* m, int mesh, std::shared_ptr<const MeshGrid>* grid);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_MESH_GRIDS_H_
