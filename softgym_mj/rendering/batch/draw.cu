// Renders all environments of a batch on a GPU, by blocks of `SGM_THREADS`.

#include "batch/queue.h"
#include "rendering/batch/draw.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::pictures::Batch* batch, long long) {
  softgym_mj::EachEnvironment(
      *batch, [&](int env_index, int slot) { softgym_mj::pictures::DrawEnvironment(*batch, env_index, slot); });
}
