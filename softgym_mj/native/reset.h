// Handling of impossible steps. After compilation an error would end a process that steps in several threads, so a
// plugin resets the simulation, as MuJoCo does when a simulation diverges.

#ifndef SOFTGYM_MJ_NATIVE_RESET_H_
#define SOFTGYM_MJ_NATIVE_RESET_H_

#include <cstddef>
#include <new>
#include <stdexcept>

#include <mujoco/mujoco.h>

namespace softgym_mj {

constexpr size_t kReasonSize = 512;  // [bytes] Longest error message.

// Runs a plugin's callback and returns false if memory runs out, because no exception may pass through MuJoCo's C code.
// Every callback that allocates runs within this or `Guard`. Exceptions that programs throw from MuJoCo's error handler
// pass.
template <class F>
bool WithinMemory(F f) {
  try {
    f();
    return true;
  } catch (const std::bad_alloc&) {
  } catch (const std::length_error&) {  // More than a container can ever hold.
  }
  return false;
}
constexpr char kNoMemory[] = "there is not enough memory.";

// Counts a warning, by default of kind mjWARN_BADQPOS, which rollouts and dm_control check; the first one is printed
// with plugin, instance and reason.
void Warn(const mjModel* m, mjData* d, int instance, const char* reason, mjtWarning kind = mjWARN_BADQPOS);

// `WithinMemory` for parts of a step: if memory runs out, it counts a warning and the objects do not move.
template <class F>
void Guard(const mjModel* m, mjData* d, int instance, F f) {
  if (!WithinMemory(f)) Warn(m, d, instance, kNoMemory);
}

// Whether all numbers are finite and none is huge, by MuJoCo's measure.
bool AreSane(const mjtNum* numbers, int count);

// Resets the simulation unless the flag autoreset is off: the state becomes that of a new mjData. It is called while
// plugins advance, where mj_resetData would clear MuJoCo's stack in use.
void Restart(const mjModel* m, mjData* d);
// Whether this thread is resetting: a new mjData must not fail then.
bool IsRestarting();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_RESET_H_
