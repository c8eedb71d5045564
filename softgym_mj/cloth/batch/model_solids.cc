#include "cloth/batch/model_solids.h"

#include <algorithm>

#include "cloth/plugin/geoms.h"

namespace softgym_mj::cloth {

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
    if (solid.shape == Shape::kPlane || solid.shape >= Shape::kMesh)
      return "expected spheres, capsules, ellipsoids, cylinders or boxes as solids.";
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

}  // namespace softgym_mj::cloth
