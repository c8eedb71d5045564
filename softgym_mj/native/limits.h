// What a model may ask of the plugins: a step that rounding leaves something of, and sizes whose products fit into an
// int and into memory.

#ifndef SOFTGYM_MJ_NATIVE_LIMITS_H_
#define SOFTGYM_MJ_NATIVE_LIMITS_H_

#include <string>

#include <mujoco/mujoco.h>

namespace softgym_mj {

// "" or a sentence that names what is beyond a limit, its value and the limit. Programs may change the time step of a
// model that is compiled.
std::string CheckLimits(const mjModel* m);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_LIMITS_H_
