// Solids and grippers of a batch's `Model`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_MODEL_SOLIDS_H_
#define SOFTGYM_MJ_CLOTH_BATCH_MODEL_SOLIDS_H_

#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/batch/model.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/solids.h"

namespace softgym_mj::cloth {

// Fills the solids with geom ids `geoms`, of which the first ones are grippers, and the first solid of each body.
// Returns "" or what is expected.
std::string FillSolids(const mjModel* m, const Mesh& mesh, const std::vector<int>& geoms, int grippers,
                       std::vector<Solid>* solids, std::vector<int>* first, std::vector<int>* trees);

// Grids of meshes and heightfields among solids.
struct SolidGrids {
  std::vector<Grid> grids;          // Of each solid, without nodes,
  std::vector<int> nodes_of;        // and the index of its nodes, or -1.
  std::vector<const float*> nodes;  // Arrays of nodes, each once,
  std::vector<long long> sizes;     // and their sizes [bytes].
};
SolidGrids GridsOf(const mjModel* m, const Solids& plugin, const std::vector<Solid>& solids);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_MODEL_SOLIDS_H_
