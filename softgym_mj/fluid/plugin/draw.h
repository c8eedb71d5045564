// Visualization of the particles as water.

#ifndef SOFTGYM_MJ_FLUID_DRAW_H_
#define SOFTGYM_MJ_FLUID_DRAW_H_

#include <mujoco/mujoco.h>

#include "config.h"
#include "surface.h"

namespace softgym_mj {

// Adds geoms to a scene and leaves room for those of the model.
void DrawFluid(const mjModel* m, const FluidConfig& config, int instance, const mjtNum* positions,
               SurfaceExtractor* extractor, mjvScene* scene);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_DRAW_H_
