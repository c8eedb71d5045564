// The kernels of batches as a block of a GPU would carry them out: barriers, votes of eight threads and atomics are
// real, so that a thread that goes another way than it should is found out. Threads take turns from barrier to barrier,
// each time in another order. With BY_THREADS they are threads of a processor, whose races can be looked for: slowly,
// as each barrier wakes all of them.

#define __CUDACC__ 1
#define __shared__ static
#define __noinline__ inline

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>
#ifdef BY_THREADS
#include <barrier>
#include <thread>
#else
#include <ucontext.h>

#include <functional>
#endif

namespace {

constexpr int kGroup = 8, kWarpSize = 32;

struct Index {
  unsigned x;
};
Index blockDim, gridDim{1};
constexpr Index blockIdx{0};

#ifdef BY_THREADS

thread_local Index threadIdx;
using Barrier = std::barrier<>;

// Calls f in each of so many threads.
template <class F>
void InTurns(int threads, F f) {
  std::vector<std::thread> all;
  for (int t = 0; t < threads; ++t) {
    all.emplace_back([&, t] {
      threadIdx.x = t;
      f();
    });
  }
  for (std::thread& thread : all) thread.join();
}

#else

Index threadIdx;

struct Turn {
  ucontext_t context;
  std::unique_ptr<char[]> stack;
  bool ended = false;
};
std::vector<Turn> turns;
ucontext_t outside;
unsigned stride;   // From a turn to the next: odd, so that all come, of which there are a power of two.
unsigned waiting;  // Turns since something went on.

// Lets the next one that has not ended go on; the last one that ends goes outside.
void Next() {
  const unsigned count = turns.size(), own = threadIdx.x;
  if (++waiting > 2 * count) {
    std::fputs("threads of a block wait for each other for ever\n", stderr);
    std::abort();
  }
  for (unsigned k = 1; k <= count; ++k) {
    const unsigned other = (own + k * stride) % count;
    if (turns[other].ended) continue;
    if (other == own) return;
    threadIdx.x = other;
    swapcontext(&turns[own].context, &turns[other].context);
    return;
  }
  swapcontext(&turns[own].context, &outside);
}

class Barrier {
 public:
  explicit Barrier(int threads) : threads_(threads) {}
  void arrive_and_wait() {
    const unsigned own = times_;
    if (++arrived_ == threads_) {
      arrived_ = 0;
      ++times_;
      stride = (stride + 2) % turns.size();
      waiting = 0;
      return;
    }
    while (times_ == own) Next();
  }

 private:
  int threads_, arrived_ = 0;
  unsigned times_ = 0;
};

std::function<void()> each;

void Enter() {
  each();
  turns[threadIdx.x].ended = true;
  waiting = 0;
  Next();
}

// Calls f in each of so many threads, a power of two.
void InTurns(int threads, std::function<void()> f) {
  constexpr std::size_t kStack = 1 << 20;  // [bytes]
  each = std::move(f);
  turns = std::vector<Turn>(threads);
  for (Turn& turn : turns) {
    turn.stack = std::make_unique<char[]>(kStack);
    getcontext(&turn.context);
    turn.context.uc_stack.ss_sp = turn.stack.get();
    turn.context.uc_stack.ss_size = kStack;
    makecontext(&turn.context, Enter, 0);
  }
  stride = 1;
  waiting = threadIdx.x = 0;
  swapcontext(&outside, &turns[0].context);
}

#endif

struct Group {
  Barrier barrier{kGroup};
  unsigned votes[kGroup];
  float values[kGroup];
};
struct Warp {
  explicit Warp(int size) : threads(size), barrier(size) {}
  int threads;
  Barrier barrier;
  unsigned votes[kWarpSize];
};
std::unique_ptr<Barrier> block;
std::unique_ptr<Barrier> named[2][3];  // By number of threads, half or all, and name.
std::vector<std::unique_ptr<Group>> groups;
std::vector<std::unique_ptr<Warp>> warps;

Group& Own() { return *groups[threadIdx.x / kGroup]; }
Warp& OwnWarp() { return *warps[threadIdx.x / kWarpSize]; }

void __syncthreads() { block->arrive_and_wait(); }
void __barrier_sync_count(int name, int threads) {
  named[threads == static_cast<int>(blockDim.x)][name]->arrive_and_wait();
}
long long clock64() { return 0; }
void __syncwarp() { OwnWarp().barrier.arrive_and_wait(); }
void __syncwarp(unsigned) { Own().barrier.arrive_and_wait(); }  // Of eight threads.

unsigned __ballot_sync(unsigned mask, bool vote) {
  if (mask == ~0u) {
    Warp& warp = OwnWarp();
    warp.votes[threadIdx.x % kWarpSize] = vote;
    warp.barrier.arrive_and_wait();
    unsigned bits = 0;
    for (int thread = 0; thread < warp.threads; ++thread) bits |= warp.votes[thread] << thread;
    warp.barrier.arrive_and_wait();
    return bits;
  }
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
template <class T>
T atomicOr(T* p, T n) {
  return __atomic_fetch_or(p, n, __ATOMIC_SEQ_CST);
}
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

#define __device__
#include "batch/queue.h"
#include "cloth/batch/one.h"
#include "fluid/batch/one.h"
#include "rendering/batch/draw.h"

namespace {

void Prepare(int threads) {
  block = std::make_unique<Barrier>(threads);
  for (int all = 0; all < 2; ++all) {
    for (auto& barrier : named[all]) barrier = std::make_unique<Barrier>(all ? threads : threads / 2);
  }
  groups.clear();
  for (int g = 0; g < threads / kGroup; ++g) groups.push_back(std::make_unique<Group>());
  warps.clear();
  for (int first = 0; first < threads; first += kWarpSize) {
    warps.push_back(std::make_unique<Warp>(std::min(kWarpSize, threads - first)));
  }
#ifdef SGM_HALVES
  softgym_mj::group_threads = threads;
#endif
}

template <class Batch, class F>
void Emulate(const Batch& batch, int threads, F step) {
  blockDim.x = threads;
  for (int i = 0; i < batch.num_envs; ++i) {
    Prepare(threads);
    InTurns(threads, [&] { step(batch, i); });
  }
}

}  // namespace

// In place of the library's functions of these names; `turns` is the number of threads.
extern "C" void softgym_mj_cloth_batch_step(const softgym_mj::cloth::Batch* batch, int, int turns) {
  Emulate(*batch, turns, [](const auto& b, int i) { softgym_mj::cloth::StepEnvironmentOf(b, i, 0); });
}
extern "C" void softgym_mj_fluid_batch_step(const softgym_mj::fluid::Batch* batch, int, int turns) {
#ifdef SGM_HALVES
  // A whole block steps the first environment.
  blockDim.x = turns;
  Prepare(turns);
  const auto is_large = [](int i) { return i == 0; };
  const auto step = [&](int i, int slot) { softgym_mj::fluid::StepEnvironmentOf(*batch, i, slot); };
  InTurns(turns, [&] { softgym_mj::EachEnvironmentInHalves(*batch, is_large, step); });
#else
  Emulate(*batch, turns, [](const auto& b, int i) { softgym_mj::fluid::StepEnvironmentOf(b, i, 0); });
#endif
}
extern "C" void softgym_mj_pictures_batch_step(const softgym_mj::pictures::Batch* batch, int, int turns) {
  Emulate(*batch, turns, [](const auto& b, int i) { softgym_mj::pictures::DrawEnvironment(b, i, 0); });
}
