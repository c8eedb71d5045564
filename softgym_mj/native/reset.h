// What a plugin does when a step is impossible. After compilation an error is no way out: it would end
// a process that steps in several threads. So this is what MuJoCo does when a simulation diverges.

#ifndef SOFTGYM_MJ_NATIVE_RESET_H_
#define SOFTGYM_MJ_NATIVE_RESET_H_

#include <cstddef>
#include <new>
#include <stdexcept>

#include <mujoco/mujoco.h>

namespace softgym_mj {

constexpr size_t kReasonSize = 512;  // [bytes] Of a sentence that says what is wrong.

// Runs what a plugin does when MuJoCo calls it: C, through which no exception may pass. False if memory ran out.
// Everything that MuJoCo calls and that allocates is run by this, or by `Guard`.
// Errors of MuJoCo's are no exceptions here: some programs make them such, which must pass.
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

// Counts a warning, of the kind mjWARN_BADQPOS where it is not said, which is what rollouts and dm_control look
// for; the first one is printed, with the plugin, the instance and the reason.
void Warn(const mjModel* m, mjData* d, int instance, const char* reason, mjtWarning kind = mjWARN_BADQPOS);

// `WithinMemory` for parts of a step: if memory runs out a warning is counted, and what they would move stands still.
template <class F>
void Guard(const mjModel* m, mjData* d, int instance, F f) {
  if (!WithinMemory(f)) Warn(m, d, instance, kNoMemory);
}

// Whether all numbers are finite and none is huge, by MuJoCo's measure.
bool AreSane(const mjtNum* numbers, int count);

// Starts the simulation anew, unless the flag autoreset is off: the state becomes that of a new mjData.
// To be called while plugins advance, where mj_resetData would clear the stack that MuJoCo stands on.
void Restart(const mjModel* m, mjData* d);
// Whether this thread is about it: a new mjData must not fail then.
bool IsRestarting();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_RESET_H_
