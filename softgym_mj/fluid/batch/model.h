// What a batch has to know of water and its walls: all that does not change in an episode, as bytes without pointers.

#ifndef SOFTGYM_MJ_FLUID_BATCH_MODEL_H_
#define SOFTGYM_MJ_FLUID_BATCH_MODEL_H_

#include "fluid/plugin/kernels.h"

namespace softgym_mj::fluid {

constexpr int kMostWalls = 32;

// A geom that holds particles back.
struct BatchWall {
  Shape shape;
  int body;                           // Of those that are told where to go, or -1: the world.
  float size[3];                      // As in mjModel.geom_size.
  double position[3], quaternion[4];  // In the body.
};

struct Model {
  int size;  // Bytes in all.
  int count, num_walls, num_bodies;
  int substeps, passes;  // Of a step, and of viscosity at its end.
  int most_cells;        // Of the grid.
  float viscosity;       // Of a pass.
  float h, max_speed;    // Substep [s], [m/s].
  double reach;          // [m] By which walls may move in a step; those that do further are put there.
  double gravity[3];     // [m/s^2]
  FluidConstants fluid;
  BatchWall walls[kMostWalls];
};

}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_MODEL_H_
