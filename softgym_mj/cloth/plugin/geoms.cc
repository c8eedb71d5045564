#include "cloth/plugin/geoms.h"

#include <algorithm>

namespace softgym_mj::cloth {
namespace {

constexpr int kMostDofs = 2000;  // Limit of a tree whose inertia is inverted: 32 MB.

}  // namespace

bool MayTouch(const mjModel* m, int geom, const Mesh& mesh, int part) {
  const Material& material = mesh.materials[part];
  return (m->geom_contype[geom] & material.conaffinity) || (material.contype & m->geom_conaffinity[geom]);
}

double Friction(const mjModel* m, int geom, int flex) {
  if (m->geom_condim[geom] == 1 && m->flex_condim[flex] == 1) return 0;
  const double of_geom = m->geom_friction[3 * geom], of_flex = m->flex_friction[3 * flex];
  const int ahead = m->geom_priority[geom] - m->flex_priority[flex];
  return ahead > 0 ? of_geom : ahead < 0 ? of_flex : std::max(of_geom, of_flex);
}

Shape ShapeOf(int type) {
  switch (type) {
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
    default:
      return Shape::kPlane;
  }
}

void CopySize(const mjModel* m, int geom, float size[3]) {
  const Shape shape = ShapeOf(m->geom_type[geom]);
  for (int k = 0; k < 3; ++k) size[k] = static_cast<float>(m->geom_size[3 * geom + k]);
  if (shape == Shape::kCylinder || shape == Shape::kCapsule) size[2] = 0;
}

std::string CheckGeoms(const mjModel* m, const Mesh& mesh) {
  for (int g = 0; g < m->ngeom; ++g) {
    const int type = m->geom_type[g], tree = m->body_treeid[m->geom_bodyid[g]];
    const int dofs = tree < 0 ? 0 : m->tree_dofnum[tree];
    if (type == mjGEOM_PLANE ? tree < 0 : ShapeOf(type) != Shape::kPlane && dofs <= kMostDofs) continue;
    for (size_t p = 0; p < mesh.flexes.size(); ++p) {
      if (!MayTouch(m, g, mesh, static_cast<int>(p))) continue;
      const char* name = mj_id2name(m, mjOBJ_GEOM, g);
      return "geom " + (name && *name ? "\"" + std::string(name) + "\"" : std::to_string(g)) +
             " cannot touch a flex: expected " +
             (dofs > kMostDofs ? "a body whose tree has at most " + std::to_string(kMostDofs) +
                                     " degrees of freedom instead of " + std::to_string(dofs)
                               : "a sphere, capsule, cylinder, ellipsoid, box or a plane that stands still") +
             ", or contype and conaffinity without a bit in common with the flex's.";
    }
  }
  return "";
}

}  // namespace softgym_mj::cloth
