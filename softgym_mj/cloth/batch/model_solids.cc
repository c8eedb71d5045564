#include "cloth/batch/model_solids.h"

#include <algorithm>

#include "cloth/plugin/geoms.h"
#include "native/export.h"

namespace softgym_mj::cloth {
namespace {

// Returns the size of the nodes of a mesh or heightfield [bytes].
long long SizeOfNodes(Shape shape, const Grid& grid) {
  const long long floats = shape == Shape::kMesh ? 4 : 1;
  return floats * sizeof(float) * grid.count[0] * grid.count[1] * grid.count[2];
}

}  // namespace

std::string FillSolids(const mjModel* m, const Mesh& mesh, const std::vector<int>& geoms, int grippers,
                       std::vector<Solid>* solids, std::vector<int>* first, std::vector<int>* trees) {
  std::vector<int> bodies;
  for (size_t i = 0; i < geoms.size(); ++i) {
    const int g = geoms[i];
    const bool grips = static_cast<int>(i) < grippers;
    if (g < 0) {
      first->push_back(static_cast<int>(i));
      trees->push_back(-1);
      bodies.push_back(-1);
      solids->push_back({Shape::kSphere, {}, 0, -1, static_cast<int>(i), 0, 0, {}});
      continue;
    }
    const int own = m->geom_bodyid[g];
    if (grips && (m->geom_type[g] != mjGEOM_SPHERE || !MayTouch(m, g, mesh.materials[0])))
      return "expected spheres as grippers.";
    Solid solid = {
        ShapeOf(m, g),     {}, static_cast<float>(Friction(m, g, mesh.flexes[0])), g, 0, m->body_treeid[own] < 0,
        m->geom_rbound[g], {}};
    if (solid.shape == Shape::kPlane || (solid.shape >= Shape::kMesh && !MayTouch(m, g, mesh.materials[0])))
      return "expected spheres, capsules, ellipsoids, cylinders, boxes, or meshes and heightfields that may touch the "
             "flex as solids.";
    if (i > 0 && grips == (static_cast<int>(i) - 1 < grippers) && g <= geoms[i - 1]) {
      return "expected grippers and solids in the order of their ids.";
    }
    CopySize(m, g, solid.size);
    mjtNum arm[3], back[4];
    mju_sub3(arm, m->body_ipos + 3 * own, m->geom_pos + 3 * g);
    mju_negQuat(back, m->geom_quat + 4 * g);
    if (!grips) mju_rotVecQuat(solid.center, arm, back);
    const auto found = grips ? bodies.end() : std::find(bodies.begin(), bodies.end(), own);
    solid.body = static_cast<int>(found - bodies.begin());
    if (found == bodies.end()) {
      bodies.push_back(own);
      trees->push_back(m->body_treeid[own]);
      first->push_back(static_cast<int>(i));
    }
    solids->push_back(solid);
  }
  return "";
}

SolidGrids GridsOf(const mjModel* m, const Solids& plugin, const std::vector<Solid>& solids) {
  SolidGrids out;
  out.grids.resize(solids.size());  // Zeros, also between members: equal models have equal bytes.
  out.nodes_of.assign(solids.size(), -1);
  for (size_t i = 0; i < solids.size(); ++i) {
    if (solids[i].shape < Shape::kMesh) continue;
    const Grid grid = plugin.GridOf(m, solids[i].geom);
    for (int k = 0; k < 3; ++k) {
      out.grids[i].count[k] = grid.count[k], out.grids[i].low[k] = grid.low[k], out.grids[i].step[k] = grid.step[k];
    }
    const auto found = std::find(out.nodes.begin(), out.nodes.end(), grid.nodes);
    out.nodes_of[i] = static_cast<int>(found - out.nodes.begin());
    if (found != out.nodes.end()) continue;
    out.nodes.push_back(grid.nodes);
    out.sizes.push_back(SizeOfNodes(solids[i].shape, grid));
  }
  return out;
}

}  // namespace softgym_mj::cloth

// Writes the sizes of the arrays of nodes that follow a model [bytes], at most one per gripper and solid. Returns their
// number.
SGM_EXPORT int softgym_mj_cloth_batch_grids(const char* bytes, long long* sizes) {
  using namespace softgym_mj::cloth;
  const auto& model = *reinterpret_cast<const Model*>(bytes);
  int number = 0;
  for (int i = 0; i < model.grippers + model.solids; ++i) {
    if (model.At<int>(model.nodes_of_at)[i] != number) continue;
    sizes[number++] = SizeOfNodes(model.At<Solid>(model.solids_at)[i].shape, model.At<Grid>(model.grids_at)[i]);
  }
  return number;
}

// Sets the addresses of these arrays.
SGM_EXPORT void softgym_mj_cloth_batch_set_grids(char* bytes, const float* const* nodes) {
  using namespace softgym_mj::cloth;
  const auto& model = *reinterpret_cast<const Model*>(bytes);
  const int* nodes_of = model.At<int>(model.nodes_of_at);
  Grid* grids = reinterpret_cast<Grid*>(bytes + model.grids_at);
  for (int i = 0; i < model.grippers + model.solids; ++i) {
    if (nodes_of[i] >= 0) grids[i].nodes = nodes[nodes_of[i]];
  }
}
