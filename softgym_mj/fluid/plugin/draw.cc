#include "draw.h"

#include <vector>

namespace softgym_mj {
namespace {

// Room left in the scene: every geom of the model with its decorations, and some more.
int Reserved(const mjModel* m) { return 2 * m->ngeom + m->nsite + m->njnt + m->nlight + 200; }

}  // namespace

void DrawFluid(const mjModel* m, const FluidConfig& config, const mjtNum* positions,
               Solver* solver, mjvScene* scene) {
  if (config.draw == Draw::kNone) return;
  const int room = scene->maxgeom - Reserved(m) - scene->ngeom;
  int drawn = 0;
  const mjtNum radius = 0.6 * config.spacing, size[3] = {radius, radius, radius};
  for (int i = 0; i < config.count; ++i) {
    if (drawn++ >= room) {
      scene->status = 1;
      break;
    }
    mjvGeom* geom = scene->geoms + scene->ngeom++;
    mjv_initGeom(geom, mjGEOM_SPHERE, size, positions + 3 * i, nullptr, config.rgba);
    geom->category = mjCAT_DECOR;
  }
}

}  // namespace softgym_mj
