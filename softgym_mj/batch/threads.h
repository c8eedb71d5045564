// Steps environments by CPU threads.

#ifndef SOFTGYM_MJ_BATCH_THREADS_H_
#define SOFTGYM_MJ_BATCH_THREADS_H_

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace softgym_mj {

// Calls f(i, t) for 0 <= i < count in any order, by threads t in parallel.
template <class F>
void InThreads(int count, int threads, const F& f) {
  std::atomic<int> next{0};
  const auto work = [&](int t) {
    for (int i = next++; i < count; i = next++) f(i, t);
  };
  std::vector<std::thread> others;
  for (int t = 1; t < std::min(threads, count); ++t) others.emplace_back(work, t);
  work(0);
  for (std::thread& other : others) other.join();
}

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_THREADS_H_
