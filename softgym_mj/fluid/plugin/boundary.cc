#include "boundary.h"

#include <algorithm>

namespace softgym_mj {
namespace {

constexpr size_t kMostWalls = 4096;
// Largest number of pairs of a particle and a wall; each takes 24 bytes if all particles are near all walls, as with
// planes.
constexpr size_t kMostPairs = 1 << 26;

}  // namespace

std::string CollectWalls(const mjModel* m, int instance, const FluidConfig& config, std::vector<Wall>* walls) {
  walls->clear();
  for (int geom = 0; geom < m->ngeom; ++geom) {
    int body = m->geom_bodyid[geom];
    bool collides = m->geom_contype[geom] || m->geom_conaffinity[geom];
    bool carries = m->body_plugin[body] == instance;
    if (!carries && !(config.world && collides && IsFixed(m, body))) continue;
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
  const size_t most = std::min(kMostWalls, kMostPairs / config.count);
  if (walls->size() <= most) return "";
  return "attribute count=\"" + std::to_string(config.count) + "\" is not valid with " + std::to_string(walls->size()) +
         " geoms as walls: expected at most " + std::to_string(most) + " of them.";
}

}  // namespace softgym_mj
