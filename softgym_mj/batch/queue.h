// Work queue of GPU blocks: each block has a slot of memory and steps one environment after the other.

#ifndef SOFTGYM_MJ_BATCH_QUEUE_H_
#define SOFTGYM_MJ_BATCH_QUEUE_H_

namespace softgym_mj {
namespace {

// Calls f(env_index, slot) for all environments in the order of the batch, and stores the cycles of each. `begun` must
// be 0.
template <class Batch, class F>
__device__ void EachEnvironment(const Batch& batch, F f) {
  __shared__ int turn;
  for (;;) {
    if (threadIdx.x == 0) turn = atomicAdd(batch.begun, 1);
    __syncthreads();
    const int own = turn;
    __syncthreads();
    if (own >= batch.num_envs) return;
    const int env_index = batch.order[own];
    const long long start = clock64();
    f(env_index, static_cast<int>(blockIdx.x));
    if (threadIdx.x == 0) batch.cost[env_index] = clock64() - start;
    __syncthreads();
  }
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_QUEUE_H_
