// Solids and grippers of a batch's `Model`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_MODEL_SOLIDS_H_
#define SOFTGYM_MJ_CLOTH_BATCH_MODEL_SOLIDS_H_

#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/batch/model.h"
#include "cloth/plugin/mesh.h"

namespace softgym_mj::cloth {

// Fills the solids with geom ids `geoms`, of which the first ones are grippers, and the first solid of each body.
// Returns "" or what is expected.
std::string FillSolids(const mjModel* m, const Mesh& mesh, const std::vector<int>& geoms, int grippers,
                       std::vector<Solid>* solids, std::vector<int>* first, std::vector<int>* trees);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_MODEL_SOLIDS_H_
