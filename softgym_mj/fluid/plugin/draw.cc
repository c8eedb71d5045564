#include "draw.h"

#include <algorithm>

namespace softgym_mj {
namespace {

// Side of a grid cell of the surface, in spacings. A software renderer spends 4 us on a triangle.
constexpr double kCoarse = 1.0, kFine = 0.5;
constexpr int kMostCoarse = 3000;  // Triangles of a coarse surface: a picture takes some 15 ms.

constexpr double kParticle = 0.5;  // Radius of a particle drawn as a sphere, in spacings.

// Geoms kept free for the model: one each with its decorations (frames, contacts, labels).
int Reserved(const mjModel* m) { return 2 * m->ngeom + m->nsite + m->njnt + m->nlight + 100; }

// Adds a geom that segmented pictures show as belonging to the plugin instance.
void AddGeom(int instance, int type, const mjtNum* size, const mjtNum* position, const mjtNum* matrix,
             const float* rgba, mjvScene* scene) {
  const int index = scene->ngeom++;
  mjvGeom* geom = scene->geoms + index;
  mjv_initGeom(geom, type, size, position, matrix, rgba);
  geom->category = mjCAT_DECOR;
  geom->objtype = mjOBJ_PLUGIN;
  geom->objid = instance;
  geom->segid = index;
}

void DrawParticles(const FluidConfig& config, int instance, const mjtNum* positions, int room, mjvScene* scene) {
  const mjtNum radius = kParticle * config.spacing, size[3] = {radius, radius, radius};
  if (config.count > room) scene->status = 1;
  for (int i = 0; i < std::min(config.count, room); ++i) {
    AddGeom(instance, mjGEOM_SPHERE, size, positions + 3 * i, nullptr, config.rgba, scene);
  }
}

void DrawTriangle(int instance, const SurfaceMesh& mesh, const int* face, const float* rgba, mjvScene* scene) {
  const Vec3<float> first = mesh.vertices[face[0]];
  const Vec3<float> b = mesh.vertices[face[1]] - first, c = mesh.vertices[face[2]] - first;
  const mjtNum size[3] = {1, 1, 0}, position[3] = {first.x, first.y, first.z};
  const mjtNum sides[6] = {b.x, b.y, b.z, c.x, c.y, c.z};
  mjtNum normal[3], matrix[9];
  mju_cross(normal, sides, sides + 3);
  if (mju_normalize3(normal) < mjMINVAL) return;
  for (int k = 0; k < 3; ++k) {
    matrix[3 * k] = sides[k];
    matrix[3 * k + 1] = sides[3 + k];
    matrix[3 * k + 2] = normal[k];
  }
  AddGeom(instance, mjGEOM_TRIANGLE, size, position, matrix, rgba, scene);
}

}  // namespace

void DrawFluid(const mjModel* m, const FluidConfig& config, int instance, const mjtNum* positions,
               SurfaceExtractor* extractor, mjvScene* scene) {
  const int room = scene->maxgeom - Reserved(m) - scene->ngeom;
  if (config.draw == Draw::kNone || room <= 0) return;
  if (config.draw == Draw::kParticles) {
    DrawParticles(config, instance, positions, room, scene);
    return;
  }
  const bool fine = config.draw == Draw::kFine;
  const int most = fine ? room : std::min(room, kMostCoarse);
  const double voxel = config.spacing * (fine ? kFine : kCoarse);
  const SurfaceMesh* mesh = extractor->Extract(positions, config.count, config.spacing, voxel, most);
  if (!mesh) {
    scene->status = 1;
    return;
  }
  for (size_t k = 0; k < mesh->faces.size(); k += 3) {
    DrawTriangle(instance, *mesh, &mesh->faces[k], config.rgba, scene);
  }
}

}  // namespace softgym_mj
