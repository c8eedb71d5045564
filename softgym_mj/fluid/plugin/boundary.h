// Selection of geoms that are walls of the fluid.

#ifndef SOFTGYM_MJ_FLUID_BOUNDARY_H_
#define SOFTGYM_MJ_FLUID_BOUNDARY_H_

#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "config.h"
#include "kernels.h"
#include "native/pose.h"

namespace softgym_mj {

// A geom that is a wall.
struct Wall {
  int geom;
  int body;
  Shape shape;
  float size[3];  // As in mjModel.geom_size.
};

// Collects the geoms of the bodies that carry `instance` and, with `config.world`, colliding geoms of the world body
// and of bodies fixed to it. Meshes, height fields and signed distance fields are not supported: returns "" or a
// sentence that names the geom, or the number of walls if there are too many.
std::string CollectWalls(const mjModel* m, int instance, const FluidConfig& config, std::vector<Wall>* walls);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_BOUNDARY_H_
