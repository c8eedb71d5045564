// A step of all worlds of a batch on a GPU: a block of `SGM_THREADS` for each.

#include "fluid/batch/one.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::fluid::Batch* batch, long long) {
  const int world = batch->order[blockIdx.x];
  const long long start = clock64();
  softgym_mj::fluid::StepWorldOf(*batch, world);
  if (threadIdx.x == 0) batch->cost[world] = clock64() - start;
}
