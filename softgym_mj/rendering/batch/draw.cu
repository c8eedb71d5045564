// Pictures of all worlds of a batch on a GPU: blocks of `SGM_THREADS`, each with the memory of a slot.

#include "rendering/batch/draw.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::pictures::Batch* batch, long long) {
  for (long long i = blockIdx.x; i < batch->num_worlds; i += batch->num_slots) {
    softgym_mj::pictures::DrawWorld(*batch, i, blockIdx.x);
  }
}
