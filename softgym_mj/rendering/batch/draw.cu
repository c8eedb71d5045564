// Pictures of all worlds of a batch on a GPU: by a block of `SGM_THREADS` each.

#include "batch/queue.h"
#include "rendering/batch/draw.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::pictures::Batch* batch, long long) {
  softgym_mj::EachWorld(*batch, [&](int world, int slot) { softgym_mj::pictures::DrawWorld(*batch, world, slot); });
}
