// A step of all worlds of a batch on a GPU: a block of `SGM_THREADS` for each, with `size` bytes of shared memory.

#include "cloth/batch/one.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::cloth::Batch* batch, long long size) {
  extern __shared__ float4 quick[];
  const int world = batch->order[blockIdx.x];
  const long long start = clock64();
  softgym_mj::cloth::StepWorldOf(*batch, world, reinterpret_cast<float*>(quick), static_cast<int>(size));
  if (threadIdx.x == 0) batch->cost[world] = clock64() - start;
}
