#include "cloth/plugin/geoms.h"

#include <algorithm>

namespace softgym_mj::cloth {
namespace {

constexpr int kMostDofs = 2000;  // Limit of a tree whose inertia is inverted: 32 MB.

}  // namespace

bool MayTouch(const mjModel* m, int geom, const Material& material) {
  return (m->geom_contype[geom] & material.conaffinity) || (material.contype & m->geom_conaffinity[geom]);
}

double Friction(const mjModel* m, int geom, int flex) {
  if (m->geom_condim[geom] == 1 && m->flex_condim[flex] == 1) return 0;
  const double of_geom = m->geom_friction[3 * geom], of_flex = m->flex_friction[3 * flex];
  const int ahead = m->geom_priority[geom] - m->flex_priority[flex];
  return ahead > 0 ? of_geom : ahead < 0 ? of_flex : std::max(of_geom, of_flex);
}

Shape ShapeOf(const mjModel* m, int geom) {
  switch (m->geom_type[geom]) {
    case mjGEOM_SPHERE:
      return Shape::kSphere;
    case mjGEOM_CAPSULE:
      return Shape::kCapsule;
    case mjGEOM_ELLIPSOID:
      return Shape::kEllipsoid;
    case mjGEOM_CYLINDER:
      return Shape::kCylinder;
    case mjGEOM_BOX:
      return Shape::kBox;
    case mjGEOM_MESH:
    case mjGEOM_SDF:
      return m->geom_dataid[geom] >= 0 ? Shape::kMesh : Shape::kPlane;
    case mjGEOM_HFIELD:
      return Shape::kHeights;
    default:
      return Shape::kPlane;
  }
}

void CopySize(const mjModel* m, int geom, float size[3]) {
  const Shape shape = ShapeOf(m, geom);
  for (int k = 0; k < 3; ++k) size[k] = static_cast<float>(m->geom_size[3 * geom + k]);
  if (shape == Shape::kCylinder || shape == Shape::kCapsule) size[2] = 0;
}

bool MayTouchAny(const mjModel* m, int geom, const std::vector<Material>& materials) {
  return std::any_of(materials.begin(), materials.end(),
                     [&](const Material& material) { return MayTouch(m, geom, material); });
}

Grid HeightsOf(const mjModel* m, int geom) {
  const int field = m->geom_dataid[geom], columns = m->hfield_ncol[field], rows = m->hfield_nrow[field];
  const mjtNum* size = m->hfield_size + 4 * field;  // Half the extents along x and y, that of heights, and the base.
  const auto f = [](mjtNum x) { return static_cast<float>(x); };
  return {{columns, rows, 1},
          {f(-size[0]), f(-size[1]), f(-size[3])},
          {f(2 * size[0] / (columns - 1)), f(2 * size[1] / (rows - 1)), f(size[2])},
          m->hfield_data + m->hfield_adr[field]};
}

void WriteMeshes(const mjModel* m, const std::vector<Material>& materials, std::string* out) {
  for (int g = 0; g < m->ngeom; ++g) {
    if (ShapeOf(m, g) != Shape::kMesh || !MayTouchAny(m, g, materials)) continue;
    const int mesh = m->geom_dataid[g];
    out->append(reinterpret_cast<const char*>(&g), sizeof(g));
    out->append(reinterpret_cast<const char*>(m->mesh_vert + 3 * m->mesh_vertadr[mesh]),
                3 * sizeof(float) * m->mesh_vertnum[mesh]);
  }
}

std::string FindGrids(const mjModel* m, const std::vector<Material>& materials, MeshGrids* grids) {
  grids->assign(m->ngeom, nullptr);
  for (int g = 0; g < m->ngeom; ++g) {
    if (!MayTouchAny(m, g, materials)) continue;
    const int tree = m->body_treeid[m->geom_bodyid[g]], data = m->geom_dataid[g];
    const int dofs = tree < 0 ? 0 : m->tree_dofnum[tree];
    const Shape shape = ShapeOf(m, g);
    std::string expected;
    if (dofs > kMostDofs) {
      expected = "a body whose tree has at most " + std::to_string(kMostDofs) + " degrees of freedom instead of " +
                 std::to_string(dofs);
    } else if (shape == Shape::kMesh) {
      expected = FindMeshGrid(m, data, &(*grids)[g]);
    } else if (shape == Shape::kHeights && (m->hfield_nrow[data] < 2 || m->hfield_ncol[data] < 2)) {
      expected = "a heightfield of at least two rows and columns";
    } else if (shape == Shape::kPlane && (m->geom_type[g] != mjGEOM_PLANE || tree >= 0)) {
      expected = "a sphere, capsule, cylinder, ellipsoid, box, mesh, heightfield or a plane that stands still";
    }
    if (expected.empty()) continue;
    const char* name = mj_id2name(m, mjOBJ_GEOM, g);
    return "geom " + (name && *name ? "\"" + std::string(name) + "\"" : std::to_string(g)) +
           " cannot touch a flex: expected " + expected +
           ", or contype and conaffinity without a bit in common with the flex's.";
  }
  return "";
}

}  // namespace softgym_mj::cloth
