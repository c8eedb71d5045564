// Blocks of a GPU that take environments of a batch one after the other: each has memory of its own, its slot.

#ifndef SOFTGYM_MJ_BATCH_QUEUE_H_
#define SOFTGYM_MJ_BATCH_QUEUE_H_

namespace softgym_mj {
namespace {

// Calls f(env_index, slot) for all environments in the order of a batch, and notes what each cost. `begun` is 0 before.
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
