// Search for pairs of layers that may touch in a step, with the same result as `Layers`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_SEARCH_H_
#define SOFTGYM_MJ_CLOTH_BATCH_SEARCH_H_

#include "cloth/batch/environment.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/pair_rules.h"
#include "cloth/plugin/search.h"

namespace softgym_mj::cloth {
namespace {

constexpr float kFar = 3e38f;  // [m] Boxes of unused lanes overlap nothing.

// Items in spatial order, with boxes of items in leaves of eight, and boxes of leaves.
struct Items {
  const int *order, *vertex;  // Corners of each item; null if the items are vertices.
  int corners, leaves;
  Boxes *boxes, *nodes;

  int NumNodes() const { return (leaves + kBlock - 1) / kBlock; }
  int Corner(int item, int c) const { return vertex ? vertex[corners * item + c] : item; }
};

inline void BoundBoxes(const Environment& w, const Items& items) {
  Each(items.NumNodes() * kBlock, [&](int leaf) {
    Boxes& node = items.nodes[leaf / kBlock];
    for (int k = 0; k < 3; ++k) {
      float least = kFar, most = -kFar;
      for (int lane = 0; leaf < items.leaves && lane < kBlock; ++lane) {
        const int item = items.order[kBlock * leaf + lane];
        float low = kFar, high = -kFar;
        for (int c = 0; item >= 0 && c < items.corners; ++c) {
          const int v = items.Corner(item, c);
          low = Min(low, w.low[4 * v + k]);
          high = Max(high, w.high[4 * v + k]);
        }
        items.boxes[leaf].low[k][lane] = low, items.boxes[leaf].high[k][lane] = high;
        least = Min(least, low), most = Max(most, high);
      }
      node.low[k][leaf % kBlock] = least, node.high[k][leaf % kBlock] = most;
    }
  });
}

// Appends a pair of items unless they have a corner in common.
inline void Append(const Environment& w, const Items& a, int item, const Items& b, int other, int* count, int* out) {
  bool shared = false;
  for (int c = 0; c < a.corners; ++c) {
    for (int d = 0; d < b.corners; ++d) shared = shared || a.Corner(item, c) == b.Corner(other, d);
  }
  if (shared) return;
  const int n = Add(count, 1);
  if (n >= w.model->candidates) return;
  out[2 * n] = item;
  out[2 * n + 1] = other;
}

// Appends pairs of items with overlapping boxes and no common corner; each pair once if `same`.
#ifdef __CUDACC__
inline void Collect(const Environment& w, const Items& a, const Items& b, bool same, int* count, int* out) {
  EachBlock(0, a.leaves * kBlock, [&](int place) {
    const int item = a.order[place], own = place / kBlock;
    if (item < 0) return;
    const Boxes& box = a.boxes[own];
    Lanes3 low, high;
    Broadcast(box, place % kBlock, &low, &high);
    for (int node = same ? own / kBlock : 0; node < b.NumNodes(); ++node) {
      unsigned near = Touching(b.nodes[node], low, high);
      if (same && node == own / kBlock) near &= ~0u << own % kBlock;
      for (; near; near &= near - 1) {
        const int leaf = kBlock * node + FirstBit(near);
        unsigned hits = Touching(b.boxes[leaf], low, high);
        if (same && leaf == own) hits &= ~1u << place % kBlock;
        if (!hits) continue;
        EachLane([&](int lane) {
          if (hits >> lane & 1) Append(w, a, item, b, b.order[kBlock * leaf + lane], count, out);
        });
      }
    }
  });
}
#else
// Leaves are tested before items, because one thread tests all of them.
inline void Collect(const Environment& w, const Items& a, const Items& b, bool same, int* count, int* out) {
  EachBlock(0, a.leaves, [&](int own) {
    Lanes3 low, high, item_low, item_high;
    Broadcast(a.nodes[own / kBlock], own % kBlock, &low, &high);
    for (int node = same ? own / kBlock : 0; node < b.NumNodes(); ++node) {
      unsigned near = Touching(b.nodes[node], low, high);
      if (same && node == own / kBlock) near &= ~0u << own % kBlock;
      for (; near; near &= near - 1) {
        const int leaf = kBlock * node + FirstBit(near);
        const unsigned others = Touching(b.boxes[leaf], low, high);
        if (!others) continue;
        Broadcast(b.nodes[node], leaf % kBlock, &item_low, &item_high);
        for (unsigned items = Touching(a.boxes[own], item_low, item_high); items; items &= items - 1) {
          const int lane = FirstBit(items), item = a.order[kBlock * own + lane];
          Broadcast(a.boxes[own], lane, &item_low, &item_high);
          unsigned hits = Touching(b.boxes[leaf], item_low, item_high) & others;
          if (same && leaf == own) hits &= ~1u << lane;
          for (; hits; hits &= hits - 1) Append(w, a, item, b, b.order[kBlock * leaf + FirstBit(hits)], count, out);
        }
      }
    }
  });
}
#endif  // __CUDACC__

// Finds candidates for vertices at `position` that move by `move`; earlier candidates suffice while vertices stay in
// their boxes.
SGM_APART void FindCandidates(const Environment& w) {
  const Model& m = *w.model;
  const float reach = kInterest * m.thickness, slack = kSlack * reach;
  Once([&] { w.step->furthest = 0, w.step->left = 0; });
  Each(m.vertices, [&](int v) {
    for (int k = 0; k < 3; ++k) {
      const float a = w.position[4 * v + k], u = w.move[4 * v + k], b = a + u;
      const bool inside = Min(a, b) - reach / 2 >= w.low[4 * v + k] && Max(a, b) + reach / 2 <= w.high[4 * v + k];
      if (!inside) SetBits(&w.step->left, 1);
      TakeLargest(&w.step->furthest, Abs(u));
    }
  });
  if (w.step->covers && w.step->of == &m && !w.step->left) return;
  const float margin = reach / 2 + (w.step->furthest < slack / 2 ? slack : 0);
  Each(m.vertices, [&](int v) {
    for (int k = 0; k < 3; ++k) {
      const float a = w.position[4 * v + k], b = a + w.move[4 * v + k];
      w.low[4 * v + k] = Min(a, b) - margin;
      w.high[4 * v + k] = Max(a, b) + margin;
    }
  });
  const Items vertices = {m.At<int>(m.vertex_order_at), nullptr, 1, m.vertex_leaves, w.vertex_boxes, w.vertex_leaves};
  const Items triangles = {m.At<int>(m.triangle_order_at),
                           m.At<int>(m.triangle_vertex_at),
                           3,
                           m.triangle_leaves,
                           w.triangle_boxes,
                           w.triangle_leaves};
  const Items edges = {
      m.At<int>(m.edge_order_by_place_at), m.At<int>(m.edge_vertex_at), 2, m.edge_leaves, w.edge_boxes, w.edge_leaves};
  BoundBoxes(w, vertices);
  BoundBoxes(w, triangles);
  BoundBoxes(w, edges);
  Once([&] { w.step->num_candidates[0] = w.step->num_candidates[1] = 0; });
  Collect(w, vertices, triangles, false, &w.step->num_candidates[0], w.triangle_candidates);
  Collect(w, edges, edges, true, &w.step->num_candidates[1], w.edge_candidates);
  Once([&] {
    w.step->covers = 1, w.step->of = &m;
    for (int& count : w.step->num_candidates) {
      if (count <= m.candidates) continue;
      w.step->flags |= kCandidatesFull;
      count = m.candidates;
      w.step->covers = 0;
    }
  });
}

// Thickness of a pair [m], as `Layers::Thickness`.
inline float ThicknessOf(const Model& m, const Pair& pair) {
  return m.has_slim ? Thickness(m.At<float>(m.vertex_thickness_at), pair) : m.thickness;
}

// Fills `found`, pairs that must not pass through each other, and `pairs`, pairs that push.
SGM_APART void FindPairs(const Environment& w) {
  const Model& m = *w.model;
  FindCandidates(w);
  Each(m.triangles, [&](int t) { FindNormal(w.position, m.At<int>(m.triangle_vertex_at) + 3 * t, w.normals + 3 * t); });
  Once([&] { w.step->num_found = w.step->num_pairs = 0; });
  const PairRules rules = {m.At<int>(m.triangle_owned_at), m.At<int>(m.edge_triangle_at), w.normals,
                           m.At<int>(m.chain_at),          m.At<int>(m.place_at),         m.At<int>(m.owner_at)};
  const Scene scene = {w.position,
                       w.move,
                       m.At<int>(m.triangle_vertex_at),
                       m.At<int>(m.edge_vertex_at),
                       m.At<int>(m.part_at),
                       &m.thickness,
                       1,
                       kInterest};
  const auto append = [&](const Pair& pair) {
    const bool counts = Counts(rules, pair, ThicknessOf(m, pair));
    if (counts || !pair.edges || !AreRopes(rules, pair)) {
      const int n = Add(&w.step->num_found, 1);
      if (n < m.found) w.found[n] = pair;
    }
    if (!counts) return;
    const int n = Add(&w.step->num_pairs, 1);
    if (n < m.rows) w.pairs[n] = pair;
  };
  const int triangles = w.step->num_candidates[0], edges = w.step->num_candidates[1];
  EachBlock(0, (triangles + kBlock - 1) / kBlock, [&](int block) {
    const int first = kBlock * block, left = triangles - first;
    Filter<false>(scene, w.triangle_candidates + 2 * first, left < kBlock ? left : kBlock, append);
  });
  EachBlock(0, (edges + kBlock - 1) / kBlock, [&](int block) {
    const int first = kBlock * block, left = edges - first;
    Filter<true>(scene, w.edge_candidates + 2 * first, left < kBlock ? left : kBlock, append);
  });
  Once([&] {
    if (w.step->num_found > m.found) w.step->flags |= kPairsFull, w.step->num_found = m.found;
    if (w.step->num_pairs > m.rows) w.step->flags |= kRowsFull, w.step->num_pairs = m.rows;
  });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_SEARCH_H_
