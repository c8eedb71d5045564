// Model of a batch: the constants of water and its walls, as bytes without pointers.

#ifndef SOFTGYM_MJ_FLUID_BATCH_MODEL_H_
#define SOFTGYM_MJ_FLUID_BATCH_MODEL_H_

#include "fluid/plugin/kernels.h"

namespace softgym_mj::fluid {

constexpr int kMostWalls = 32;
constexpr int kMostParticles = 65'535;  // Indices in lists have 16 bits; one stands for padding.

// Whether the water may push walls; a kernel without is faster.
#ifndef SGM_PUSHES
#define SGM_PUSHES 1
#endif
constexpr bool kPushes = SGM_PUSHES;

// A geom that is a wall.
struct BatchWall {
  Shape shape;
  int body;       // Index among bodies with prescribed motion, or -1 for the world.
  int pushed;     // Index among walls that the water pushes, or -1; those of a body are consecutive.
  float size[3];  // As in mjModel.geom_size.
  double position[3], quaternion[4];  // Pose in the body's frame.
  double center[3];                   // Center of mass in the body's frame [m].
};

struct Model {
  int size;  // Total size [bytes].
  int count, num_walls, num_bodies;
  int num_pushed;        // Number of walls that the water pushes.
  int substeps, passes;  // Substeps of a step, and passes of viscosity at its end.
  int most_cells;        // Largest number of cells of the grid.
  float viscosity;       // Viscosity of a pass.
  float h, max_speed;    // Substep [s], [m/s].
  double reach;          // [m] Largest motion of a wall in a step; beyond it, a wall is teleported.
  double gravity[3];     // [m/s^2]
  double mass;           // Mass of a particle [kg].
  double timestep;       // [s]
  FluidConstants fluid;
  BatchWall walls[kMostWalls];
};

}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_MODEL_H_
