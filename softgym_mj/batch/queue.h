// Work queue of GPU blocks: each block has a slot of memory and steps one environment after the other.

#ifndef SOFTGYM_MJ_BATCH_QUEUE_H_
#define SOFTGYM_MJ_BATCH_QUEUE_H_

#include "batch/group.h"

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

#ifdef SGM_HALVES

// The same by whole blocks for the first environments, those for which is_large(env_index), then by halves of a block,
// each with a slot of its own, so that the largest ones do not end last.
template <class Batch, class Large, class F>
__device__ void EachEnvironmentInHalves(const Batch& batch, Large is_large, F f) {
  __shared__ int turns[kGroups];
  const int half = static_cast<int>(threadIdx.x) >= SGM_THREADS / 2, blocks = static_cast<int>(gridDim.x);
  bool halves = blockDim.x == SGM_THREADS && batch.num_envs > blocks;
  int slot = static_cast<int>(blockIdx.x);
  if (threadIdx.x == 0) group_threads = static_cast<int>(blockDim.x);
  __syncthreads();
  for (;;) {
    if (Thread() == 0) turns[Group()] = atomicAdd(batch.begun, 1);
    Wait();
    const int own = turns[Group()];
    Wait();
    if (own >= batch.num_envs) return;
    const int env_index = batch.order[own];
    if (halves && !is_large(env_index)) {
      halves = false;
      if (threadIdx.x == 0) group_threads = SGM_THREADS / 2;
      __syncthreads();
      slot += half * blocks;
      if (slot >= batch.num_slots) return;
      if (half) continue;  // The first half steps it.
    }
    const long long start = clock64();
    f(env_index, slot);
    if (Thread() == 0) batch.cost[env_index] = (clock64() - start) * Threads();
    Wait();
  }
}

#endif  // SGM_HALVES

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_QUEUE_H_
