// Steps all environments of a batch on a GPU, by blocks of `SGM_THREADS` with `size` bytes of shared memory.

#include "batch/queue.h"
#include "cloth/batch/one.h"

extern "C" __global__ void __launch_bounds__(SGM_THREADS, SGM_BLOCKS)
    Step(const softgym_mj::cloth::Batch* batch, long long size) {
  extern __shared__ float4 quick[];
  softgym_mj::EachEnvironment(*batch, [&](int env_index, int slot) {
    softgym_mj::cloth::StepEnvironmentOf(*batch, env_index, slot, reinterpret_cast<float*>(quick),
                                         static_cast<int>(size));
  });
}
