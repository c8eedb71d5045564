// A step of all worlds of a batch on a GPU: by a block of `SGM_THREADS` each.

#include "batch/queue.h"
#include "fluid/batch/one.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::fluid::Batch* batch, long long) {
  softgym_mj::EachWorld(*batch, [&](int world, int slot) { softgym_mj::fluid::StepWorldOf(*batch, world, slot); });
}
