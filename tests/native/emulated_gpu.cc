// The programs of batches as a block of a GPU would carry them out, by threads of a processor: barriers, votes of eight
// threads and atomics are real, so that a thread that goes another way than it should is found out.

#define __CUDACC__ 1
#define __shared__ static

#include <barrier>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

namespace {

constexpr int kGroup = 8;

struct Index {
  unsigned x;
};
thread_local Index threadIdx;
Index blockDim;

struct Group {
  std::barrier<> barrier{kGroup};
  unsigned votes[kGroup];
  float values[kGroup];
};
std::unique_ptr<std::barrier<>> block;
std::vector<std::unique_ptr<Group>> groups;

Group& Own() { return *groups[threadIdx.x / kGroup]; }

void __syncthreads() { block->arrive_and_wait(); }
void __syncwarp() { block->arrive_and_wait(); }  // There is one warp.

unsigned __ballot_sync(unsigned, bool vote) {
  Group& group = Own();
  group.votes[threadIdx.x % kGroup] = vote;
  group.barrier.arrive_and_wait();
  unsigned bits = 0;
  for (int lane = 0; lane < kGroup; ++lane) bits |= group.votes[lane] << lane;
  group.barrier.arrive_and_wait();
  return bits << threadIdx.x % 32 / kGroup * kGroup;
}

float __shfl_xor_sync(unsigned, float value, int far) {
  Group& group = Own();
  group.values[threadIdx.x % kGroup] = value;
  group.barrier.arrive_and_wait();
  const float other = group.values[threadIdx.x % kGroup ^ far];
  group.barrier.arrive_and_wait();
  return other;
}

template <class T>
T atomicAdd(T* p, T n) {
  return __atomic_fetch_add(p, n, __ATOMIC_SEQ_CST);
}
int atomicExch(int* p, int n) { return __atomic_exchange_n(p, n, __ATOMIC_SEQ_CST); }
int atomicOr(int* p, int n) { return __atomic_fetch_or(p, n, __ATOMIC_SEQ_CST); }
template <class T, class F>
void Change(T* p, T value, F better) {
  T before = __atomic_load_n(p, __ATOMIC_SEQ_CST);
  while (better(value, before) &&
         !__atomic_compare_exchange_n(p, &before, value, false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST)) {
  }
}
template <class T>
void atomicMin(T* p, T value) {
  Change(p, value, [](T a, T b) { return a < b; });
}
template <class T>
void atomicMax(T* p, T value) {
  Change(p, value, [](T a, T b) { return a > b; });
}

template <class To, class From>
To Cast(From from) {
  To to;
  std::memcpy(&to, &from, sizeof(to));
  return to;
}
int __float_as_int(float a) { return Cast<int>(a); }
long long __double_as_longlong(double a) { return Cast<long long>(a); }
int __ffsll(long long a) { return __builtin_ffsll(a); }
int __popc(unsigned a) { return __builtin_popcount(a); }
float __fadd_rn(float a, float b) { return a + b; }
float __fsub_rn(float a, float b) { return a - b; }
float __fmul_rn(float a, float b) { return a * b; }
float __fdiv_rn(float a, float b) { return a / b; }
float __fsqrt_rn(float a) { return std::sqrt(a); }
float __fmaf_rn(float a, float b, float c) { return std::fma(a, b, c); }

struct alignas(16) float4 {
  float x, y, z, w;
};
float4 make_float4(float x, float y, float z, float w) { return {x, y, z, w}; }

}  // namespace

#include "cloth/batch/one.h"
#include "fluid/batch/one.h"
#include "rendering/batch/draw.h"

namespace {

template <class Batch, class F>
void Emulate(const Batch& batch, int threads, F step) {
  blockDim.x = threads;
  for (int i = 0; i < batch.num_worlds; ++i) {
    block = std::make_unique<std::barrier<>>(threads);
    groups.clear();
    for (int g = 0; g < threads / kGroup; ++g) groups.push_back(std::make_unique<Group>());
    std::vector<std::thread> all;
    for (int t = 0; t < threads; ++t) {
      all.emplace_back([&, t] {
        threadIdx.x = t;
        step(batch, i);
      });
    }
    for (std::thread& thread : all) thread.join();
  }
}

}  // namespace

// In place of the library's functions of these names; `turns` is the number of threads.
extern "C" void softgym_mj_cloth_batch_step(const softgym_mj::cloth::Batch* batch, int, int turns) {
  Emulate(*batch, turns, [](const auto& b, int i) { softgym_mj::cloth::StepWorldOf(b, i, 0); });
}
extern "C" void softgym_mj_fluid_batch_step(const softgym_mj::fluid::Batch* batch, int, int turns) {
  Emulate(*batch, turns, [](const auto& b, int i) { softgym_mj::fluid::StepWorldOf(b, i, 0); });
}
extern "C" void softgym_mj_pictures_batch_step(const softgym_mj::pictures::Batch* batch, int, int turns) {
  Emulate(*batch, turns, [](const auto& b, int i) { softgym_mj::pictures::DrawWorld(b, i, 0); });
}
