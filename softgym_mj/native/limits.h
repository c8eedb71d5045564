// Limits of models: time steps that survive rounding, and sizes whose products fit into an int and into memory.

#ifndef SOFTGYM_MJ_NATIVE_LIMITS_H_
#define SOFTGYM_MJ_NATIVE_LIMITS_H_

#include <string>

#include <mujoco/mujoco.h>

namespace softgym_mj {

// Returns "" or an error with quantity, value and limit. Programs may change the time step of a compiled model.
std::string CheckLimits(const mjModel* m);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_LIMITS_H_
