// Steps all environments of a batch on a GPU, by blocks of `SGM_THREADS`.

#include "batch/queue.h"
#include "fluid/batch/one.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::fluid::Batch* batch, long long) {
  softgym_mj::EachEnvironment(
      *batch, [&](int env_index, int slot) { softgym_mj::fluid::StepEnvironmentOf(*batch, env_index, slot); });
}
