// Search for pairs on a CPU: boxes in leaves of eight, candidates eight at a time, under the restrictions of
// native/simd.h.

#ifndef SOFTGYM_MJ_CLOTH_SEARCH_LOOPS_H_
#define SOFTGYM_MJ_CLOTH_SEARCH_LOOPS_H_

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/search.h"
#include "cloth/plugin/sweeps.h"
#include "native/simd.h"

namespace softgym_mj::cloth {
namespace {

inline void BoundItems(const float* low, const float* high, const int* corners, Boxes* out) {
  Lanes3 least, most;
  for (int k = 0; k < 3; ++k) {
    int index[kBlock];
    for (int i = 0; i < kBlock; ++i) index[i] = corners[3 * i + k];
    Lanes unused;
    const Lanes3 a = Gather(low, index, &unused), b = Gather(high, index, &unused);
    least = k ? Lanes3{Min(a.x, least.x), Min(a.y, least.y), Min(a.z, least.z)} : a;
    most = k ? Lanes3{Max(b.x, most.x), Max(b.y, most.y), Max(b.z, most.z)} : b;
  }
  Store3(least, out->low);
  Store3(most, out->high);
}

inline bool ShareCorner(const int* a, const int* b) {
  bool same = false;
  for (int i = 0; i < 3; ++i) same |= (a[i] == b[0]) | (a[i] == b[1]) | (a[i] == b[2]);
  return same;
}

inline int OverlapLeaves(const BoxTree& a, int leaf_a, const BoxTree& b, int leaf_b, bool same, int* out) {
  int count = 0;
  const Boxes &of_a = a.items[leaf_a], &of_b = b.items[leaf_b];
  // Only items that touch the other leaf's box.
  Lanes3 low, high;
  Broadcast(b.leaves[leaf_b / kBlock], leaf_b % kBlock, &low, &high);
  unsigned near_a = Touching(of_a, low, high);
  if (!near_a) return 0;
  Broadcast(a.leaves[leaf_a / kBlock], leaf_a % kBlock, &low, &high);
  const unsigned near_b = Touching(of_b, low, high);
  if (!near_b) return 0;
  for (; near_a; near_a &= near_a - 1) {
    const int i = __builtin_ctz(near_a), at = kBlock * leaf_a + i;
    Broadcast(of_a, i, &low, &high);
    unsigned bits = Touching(of_b, low, high) & near_b;
    if (same && leaf_a == leaf_b) bits &= ~0u << (i + 1);
    for (; bits; bits &= bits - 1) {
      const int other = kBlock * leaf_b + __builtin_ctz(bits);
      if (ShareCorner(a.corners + 3 * at, b.corners + 3 * other)) continue;
      out[2 * count] = at;
      out[2 * count++ + 1] = other;
    }
  }
  return count;
}

inline int Overlap(const BoxTree& a, const BoxTree& b, bool same, int* out, int capacity, bool* full) {
  int count = 0;
  *full = false;
  for (int node_a = 0; node_a < a.num_nodes; ++node_a) {
    const float* p = a.bounds + 6 * node_a;
    for (int node_b = same ? node_a : 0; node_b < b.num_nodes; ++node_b) {
      const float* q = b.bounds + 6 * node_b;
      if (p[0] > q[3] || q[0] > p[3] || p[1] > q[4] || q[1] > p[4] || p[2] > q[5] || q[2] > p[5]) continue;
      for (int i = 0; i < kBlock; ++i) {
        const int leaf_a = kBlock * node_a + i;
        if (leaf_a >= a.num_leaves) break;
        Lanes3 low, high;
        Broadcast(a.leaves[node_a], i, &low, &high);
        unsigned bits = Touching(b.leaves[node_b], low, high);
        if (same && node_a == node_b) bits &= ~0u << i;
        for (; bits; bits &= bits - 1) {
          const int leaf_b = kBlock * node_b + __builtin_ctz(bits);
          *full = count + kBlock * kBlock > capacity;
          if (*full) return count;
          count += OverlapLeaves(a, leaf_a, b, leaf_b, same, out + 2 * count);
        }
      }
    }
  }
  return count;
}

template <bool edges>
inline int FilterAll(const Scene& scene, const int* pairs, int count, Pair* out) {
  int found = 0;
  for (int first = 0; first < count; first += kBlock) {
    const int size = count - first < kBlock ? count - first : kBlock;
    Filter<edges>(scene, pairs + 2 * first, size, [&](const Pair& pair) { out[found++] = pair; });
  }
  return found;
}
inline int FilterTriangles(const Scene& scene, const int* pairs, int count, Pair* out) {
  return FilterAll<false>(scene, pairs, count, out);
}
inline int FilterEdges(const Scene& scene, const int* pairs, int count, Pair* out) {
  return FilterAll<true>(scene, pairs, count, out);
}

inline int FindApproaching(const float* now, const Pair* pairs, int count, float share, int* out) {
  int found = 0;
  for (int i = 0; i < count; ++i) {
    if (Approaches(now, pairs[i], share)) out[found++] = i;
  }
  return found;
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SEARCH_LOOPS_H_
