// Steps all environments of a batch on a GPU, by blocks of `SGM_THREADS`.

#include "batch/queue.h"
#include "fluid/batch/one.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::fluid::Batch* batch, long long) {
  using namespace softgym_mj::fluid;
  const auto is_large = [&](int env_index) {
    return IsLarge(reinterpret_cast<const Model*>(batch->models[env_index]), batch->num_envs);
  };
  softgym_mj::EachEnvironmentInHalves(
      *batch, is_large, [&](int env_index, int slot) { StepEnvironmentOf(*batch, env_index, slot); });
}
