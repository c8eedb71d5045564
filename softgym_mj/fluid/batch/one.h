// Step of one environment of a `Batch`, by a CPU thread or a block of a GPU.

#ifndef SOFTGYM_MJ_FLUID_BATCH_ONE_H_
#define SOFTGYM_MJ_FLUID_BATCH_ONE_H_

#include "fluid/batch/host.h"
#include "fluid/batch/step.h"

namespace softgym_mj::fluid {
namespace {

// Whether half a block of a GPU would take longer for an environment than for its share of all environments: of 200
// variations, an environment has 15,000 particles times substeps on average, and an H100 has 264 halves.
inline bool IsLarge(const Model* model, long long num_envs) {
  constexpr long long kShareOfEach = 40;
  return model && 1LL * model->count * model->substeps > kShareOfEach * num_envs;
}

inline void StepEnvironmentOf(const Batch& batch, int i, int slot) {
  if (!batch.models[i]) return;
  SGM_SHARED Environment of_groups[kGroups];
  Environment& w = of_groups[Group()];
  Once([&] {
    w.model = reinterpret_cast<const Model*>(batch.models[i]);
    const long long particles = batch.most_particles * i;
    w.known = batch.known + i;
    w.positions = batch.positions + 3 * particles;
    w.velocities = batch.velocities + 3 * particles;
    w.walls = batch.walls + 7 * batch.most_walls * i;
    w.poses = batch.poses + 7 * batch.most_bodies * i;
    if (kPushes) {
      w.forces = batch.forces + 6 * batch.most_pushed * i;
      w.pending = batch.pending + 6 * batch.most_pushed * i;
      w.mobility = batch.mobility + 2 * batch.most_bodies * i;
    }
    Memory memory(batch.memory + batch.memory_size * slot);
    TakeMemory(*w.model, &memory, &w);
  });
  StepEnvironment(&w);
  Once([&] { batch.flags[i] |= w.step->flags; });
}

}  // namespace
}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_ONE_H_
