// Engine plugin "softgym_mj.fluid": particles of water in the plugin state of mjData.

#ifndef SOFTGYM_MJ_FLUID_FLUID_H_
#define SOFTGYM_MJ_FLUID_FLUID_H_

#include <mujoco/mujoco.h>

namespace softgym_mj {

// Offsets of an instance's state. All of it is in mjData.plugin_state, so that copying or restoring mjData restores the
// fluid.
struct StateLayout {
  int known;       // 1: the wall poses are those of the last step; 0: there was none.
  int positions;   // (count, 3) [m]
  int velocities;  // (count, 3) [m/s]
  int poses;       // (walls, 7): position and quaternion at the end of the last step.
  int forces;      // (walls, 6) if two-way: force [N] and torque [N m] about the center of mass.
  int pending;     // (walls, 6) if two-way: impulse [N s] and its moment, not yet handed over.
  int vertices;    // (vertices, 3) if flexes hold water back: positions at the end of the last step.
  int size;
};

void RegisterFluid();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_FLUID_H_
