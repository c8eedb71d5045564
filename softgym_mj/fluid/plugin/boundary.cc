#include "boundary.h"

namespace softgym_mj {

std::string CollectWalls(const mjModel* m, int instance, bool world, std::vector<Wall>* walls) {
  walls->clear();
  for (int geom = 0; geom < m->ngeom; ++geom) {
    int body = m->geom_bodyid[geom];
    bool collides = m->geom_contype[geom] || m->geom_conaffinity[geom];
    bool carries = m->body_plugin[body] == instance;
    if (!carries && !(world && collides && IsFixed(m, body))) continue;
    Wall wall = {geom, body, Shape::kBox, {}};
    switch (m->geom_type[geom]) {
      case mjGEOM_PLANE:
        wall.shape = Shape::kPlane;
        break;
      case mjGEOM_SPHERE:
        wall.shape = Shape::kSphere;
        break;
      case mjGEOM_CAPSULE:
        wall.shape = Shape::kCapsule;
        break;
      case mjGEOM_ELLIPSOID:
        wall.shape = Shape::kEllipsoid;
        break;
      case mjGEOM_CYLINDER:
        wall.shape = Shape::kCylinder;
        break;
      case mjGEOM_BOX:
        wall.shape = Shape::kBox;
        break;
      default: {
        if (!collides) continue;  // A visual mesh.
        const char* name = mj_id2name(m, mjOBJ_GEOM, geom);
        return "geom " + (name && *name ? "\"" + std::string(name) + "\"" : std::to_string(geom)) +
               " cannot be a wall of the fluid: its type must be plane, sphere, capsule, "
               "ellipsoid, cylinder or box.";
      }
    }
    for (int i = 0; i < 3; ++i) wall.size[i] = static_cast<float>(m->geom_size[3 * geom + i]);
    walls->push_back(wall);
  }
  return "";
}

}  // namespace softgym_mj
