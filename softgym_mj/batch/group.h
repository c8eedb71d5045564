// Thread group that steps one environment of a batch: a block on a GPU, or one CPU thread.
//
// A kernel is a sequence of parallel loops. Iterations of a loop must be independent except through the atomic
// functions below. On a CPU `Turns` changes the order of iterations: results must be bit-identical.

#ifndef SOFTGYM_MJ_BATCH_GROUP_H_
#define SOFTGYM_MJ_BATCH_GROUP_H_

#include "native/simd.h"

namespace softgym_mj {
namespace {

using Key = unsigned long long;

#ifdef __CUDACC__

// Memory shared by the threads of a group.
#define SGM_SHARED __shared__

// A function that is not inlined: a program is faster when its loops fit into the instruction cache.
#define SGM_APART __noinline__

// Before a loop that should read ahead.
#define SGM_UNROLLED _Pragma("unroll 16")

#ifndef SGM_HALVES
constexpr int kGroups = 1;  // Groups of a block.
inline int Group() { return 0; }
inline int Threads() { return static_cast<int>(blockDim.x); }
inline int Thread() { return static_cast<int>(threadIdx.x); }
inline void Wait() { __syncthreads(); }
#else
// A block is one group, or two, which wait apart.
constexpr int kGroups = 2;
__shared__ int group_threads;  // Threads of a group.
inline int Group() { return static_cast<int>(threadIdx.x) >= group_threads; }
inline int Threads() { return group_threads; }
inline int Thread() {
  const int thread = static_cast<int>(threadIdx.x), threads = group_threads;
  return thread < threads ? thread : thread - threads;
}
inline void Wait() {
  const int threads = group_threads, barrier = 1 + (static_cast<int>(threadIdx.x) >= threads);
#ifdef __CUDACC_RTC__
  asm volatile("bar.sync %0, %1;" ::"r"(barrier), "r"(threads) : "memory");
#else
  __barrier_sync_count(barrier, threads);
#endif
}
#endif

constexpr unsigned kWarp = ~0u;  // Mask of all threads of a warp.
constexpr int kWarpThreads = 32;

// Sets of eight threads in the first warp of a group.
inline int WarpBlocks() { return (Threads() < kWarpThreads ? Threads() : kWarpThreads) / kLanes; }

// Calls f(i) for 0 <= i < count, and waits for all of them.
template <class F>
inline void Each(int count, F f) {
  for (int i = Thread(); i < count; i += Threads()) f(i);
  Wait();
}

// Calls f(i) for first <= i < end, each by eight threads, which are the lanes of `Lanes`.
template <class F>
inline void EachBlock(int first, int end, F f) {
  const int threads = Threads() / kLanes;
  for (int i = first + Thread() / kLanes; i < end; i += threads) f(i);
  Wait();
}

// Calls f(i), each by eight threads, for begin[0] <= i < begin[1], waits, and goes on with the next part. One warp runs
// consecutive small parts, because it need not wait for the other warps.
template <class F>
inline void EachBlockOf(const int* begin, int parts, F f) {
  constexpr int kSmall = kWarpThreads / kLanes;
  const int thread = Thread(), step = WarpBlocks();
  for (int part = 0; part < parts;) {
    int first = begin[part], end = begin[part + 1];
    if (end - first > kSmall) {
      EachBlock(first, end, f);
      ++part;
      continue;
    }
    for (; part < parts && end - first <= kSmall; ++part) {
      const int next = begin[part + 2 < parts ? part + 2 : parts];  // Read before f stores.
      for (int i = first + thread / kLanes; thread < kWarpThreads && i < end; i += step) f(i);
      first = end, end = next;
      __syncwarp();
    }
    Wait();
  }
}

// Adds, and returns the old value. The order of iterations is undefined.
inline int Add(int* p, int n) { return atomicAdd(p, n); }
inline int Exchange(int* p, int n) { return atomicExch(p, n); }
inline void TakeLeast(Key* p, Key key) { atomicMin(p, key); }
// Numbers must not be negative.
inline void TakeLargest(float* p, float a) { atomicMax(reinterpret_cast<int*>(p), __float_as_int(a)); }
inline void TakeLargest(double* p, double a) { atomicMax(reinterpret_cast<long long*>(p), __double_as_longlong(a)); }
inline void SetBits(int* p, int bits) { atomicOr(p, bits); }
inline void SetBits(Key* p, Key bits) { atomicOr(p, bits); }
inline int FirstBit(Key bits) { return __ffsll(static_cast<long long>(bits)) - 1; }

#else

#define SGM_SHARED
#define SGM_APART inline

constexpr int kGroups = 1;
inline int Group() { return 0; }

// Order of iterations: 0 ascending, 1 descending, other numbers various permutations.
inline int& Turns() {
  static thread_local int turns = 0;
  return turns;
}

template <class F>
inline void InTurns(int first, int end, F f) {
  const int count = end - first, turns = Turns();
  if (turns == 0) {
    for (int i = first; i < end; ++i) f(i);
  } else if (turns == 1) {
    for (int i = end; i-- > first;) f(i);
  } else {
    // A step that is coprime to the count visits every index once.
    const auto divisor = [](long long a, long long b) {
      while (b) {
        const long long rest = a % b;
        a = b, b = rest;
      }
      return a;
    };
    long long step = 7919LL * turns + 1;
    while (count > 1 && divisor(step, count) != 1) ++step;
    for (long long i = 0, at = turns % (count + 1); i < count; ++i, at += step) f(first + static_cast<int>(at % count));
  }
}

#define SGM_UNROLLED

inline void Wait() {}
template <class F>
inline void Each(int count, F f) {
  InTurns(0, count, f);
}
template <class F>
inline void EachBlock(int first, int end, F f) {
  InTurns(first, end, f);
}
template <class F>
inline void EachBlockOf(const int* begin, int parts, F f) {
  for (int part = 0; part < parts; ++part) InTurns(begin[part], begin[part + 1], f);
}
inline int Add(int* p, int n) {
  const int before = *p;
  *p += n;
  return before;
}
inline int Exchange(int* p, int n) {
  const int before = *p;
  *p = n;
  return before;
}
inline void TakeLeast(Key* p, Key key) { *p = key < *p ? key : *p; }
inline void TakeLargest(float* p, float a) { *p = a > *p ? a : *p; }
inline void TakeLargest(double* p, double a) { *p = a > *p ? a : *p; }
inline void SetBits(int* p, int bits) { *p |= bits; }
inline void SetBits(Key* p, Key bits) { *p |= bits; }
inline int FirstBit(Key bits) { return __builtin_ctzll(bits); }

#endif  // __CUDACC__

#ifdef __CUDACC__

// Makes the visits make(i) for 0 <= i < count as if one after the other: `Acts`, `Act` if that is true for a lane,
// `End`. One warp makes them, which is as fast as all threads with barriers between them: four visits find out at once
// whether they act, the first of those that do acts, and the visits after it find out again.
template <class F>
inline void InSequence(int count, F make) {
  const int thread = Thread(), own = thread / kLanes, visits = WarpBlocks();
  for (int begin = 0; thread < kWarpThreads && begin < count; begin += visits) {
    const bool has_one = begin + own < count;
    auto visit = make(has_one ? begin + own : begin);
    bool waits = has_one;
    for (;;) {
      const bool acts = waits && visit.Acts().v;
      const unsigned votes = __ballot_sync(kWarp, acts);
      if (!votes) break;
      const int next = FirstBit(votes) / kLanes;
      if (own == next) visit.Act();
      waits = waits && own > next;
      __syncwarp();
    }
    if (has_one) visit.End();
  }
  Wait();
}

#else

template <class F>
inline void InSequence(int count, F make) {
  for (int i = 0; i < count; ++i) {
    auto visit = make(i);
    if (Bits(visit.Acts())) visit.Act();
    visit.End();
  }
}

#endif

constexpr int kMostThreads = 1024;  // Largest group.

#ifdef __CUDACC__

// Replaces `count` numbers by their inclusive prefix sums. `partial`: memory for one number per thread.
inline void SumUp(int* a, int count, int* partial) {
  constexpr int kPart = 32;  // Threads whose sums are summed by one.
  SGM_SHARED int of_parts[kGroups][kMostThreads / kPart];
  int* const parts = of_parts[Group()];
  const int threads = Threads(), own = Thread();
  const int share = (count + threads - 1) / threads, first = own * share;
  int sum = 0;
  for (int i = first; i < first + share && i < count; ++i) sum += a[i];
  partial[own] = sum;
  Wait();
  sum = 0;
  if (kPart * own < threads) {
    for (int t = kPart * own; t < kPart * (own + 1) && t < threads; ++t) sum += partial[t];
    parts[own] = sum;
  }
  Wait();
  sum = 0;
  for (int part = 0; part < own / kPart; ++part) sum += parts[part];
  for (int t = own / kPart * kPart; t < own; ++t) sum += partial[t];
  for (int i = first; i < first + share && i < count; ++i) a[i] = sum += a[i];
  Wait();
}

#else

inline void SumUp(int* a, int count, int*) {
  for (int i = 1; i < count; ++i) a[i] += a[i - 1];
}

#endif

// Calls f once.
template <class F>
inline void Once(F f) {
  Each(1, [&](int) { f(); });
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_GROUP_H_
