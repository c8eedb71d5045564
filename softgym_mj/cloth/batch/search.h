// Pairs of layers that may touch in a step: the same as `Layers` finds.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_SEARCH_H_
#define SOFTGYM_MJ_CLOTH_BATCH_SEARCH_H_

#include "cloth/batch/world.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/pair_rules.h"
#include "cloth/plugin/search.h"

namespace softgym_mj::cloth {
namespace {

constexpr float kFar = 3e38f;  // [m] Boxes of empty places overlap nothing.

// Items in the order of their places, with boxes around each and around eight of them. `vertex`: `corners` of each
// item; null of vertices themselves.
struct Items {
  const int *order, *vertex;
  int corners, leaves;
  Boxes* boxes;
  Bounds* bounds;

  int Corner(int item, int c) const { return vertex ? vertex[corners * item + c] : item; }
};

inline void BoundBoxes(const World& w, const Items& items) {
  Each(items.leaves, [&](int leaf) {
    Boxes& box = items.boxes[leaf];
    Bounds& bounds = items.bounds[leaf];
    for (int k = 0; k < 3; ++k) {
      bounds.low[k] = kFar, bounds.high[k] = -kFar;
      for (int lane = 0; lane < kBlock; ++lane) {
        const int item = items.order[kBlock * leaf + lane];
        float low = kFar, high = -kFar;
        for (int c = 0; item >= 0 && c < items.corners; ++c) {
          const int v = items.Corner(item, c);
          low = Min(low, w.low[4 * v + k]);
          high = Max(high, w.high[4 * v + k]);
        }
        box.low[k][lane] = low, box.high[k][lane] = high;
        bounds.low[k] = Min(bounds.low[k], low), bounds.high[k] = Max(bounds.high[k], high);
      }
    }
  });
}

// Appends the pairs of items whose boxes overlap and that have no corner in common.
inline void Collect(const World& w, const Items& a, const Items& b, bool same, int* count, int* out) {
  Each(a.leaves * kBlock, [&](int place) {
    const int item = a.order[place], lane = place % kBlock;
    if (item < 0) return;
    const Boxes& box = a.boxes[place / kBlock];
    const auto meets = [&](const float* low, const float* high, int stride) {
      bool all = true;
      for (int k = 0; k < 3; ++k) {
        all = all && box.low[k][lane] <= high[stride * k] && low[stride * k] <= box.high[k][lane];
      }
      return all;
    };
    for (int leaf = same ? place / kBlock : 0; leaf < b.leaves; ++leaf) {
      if (!meets(b.bounds[leaf].low, b.bounds[leaf].high, 1)) continue;
      for (int i = 0; i < kBlock; ++i) {
        const int other = b.order[kBlock * leaf + i];
        if (other < 0 || (same && kBlock * leaf + i <= place)) continue;
        if (!meets(&b.boxes[leaf].low[0][i], &b.boxes[leaf].high[0][i], kBlock)) continue;
        bool shared = false;
        for (int c = 0; c < a.corners; ++c) {
          for (int d = 0; d < b.corners; ++d) shared = shared || a.Corner(item, c) == b.Corner(other, d);
        }
        if (shared) continue;
        const int n = Add(count, 1);
        if (n >= w.model->candidates) continue;
        out[2 * n] = item;
        out[2 * n + 1] = other;
      }
    }
  });
}

// Candidates for vertices at `position` that move by `move`; those of earlier steps suffice while vertices stay within
// their boxes.
inline void FindCandidates(const World& w) {
  const Model& m = *w.model;
  const float reach = kInterest * m.thickness, slack = kSlack * reach;
  Once([&] { w.step->furthest = 0; });
  Each(m.vertices, [&](int v) {
    for (int k = 0; k < 3; ++k) {
      const float a = w.position[4 * v + k], u = w.move[4 * v + k], b = a + u;
      const bool inside = Min(a, b) - reach / 2 >= w.low[4 * v + k] && Max(a, b) + reach / 2 <= w.high[4 * v + k];
      if (!inside) w.step->covers = 0;
      TakeLargest(&w.step->furthest, Abs(u));
    }
  });
  if (w.step->covers) return;
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
    w.step->covers = 1;
    for (int& count : w.step->num_candidates) {
      if (count <= m.candidates) continue;
      w.step->flags |= kCandidatesFull;
      count = m.candidates;
      w.step->covers = 0;
    }
  });
}

// A candidate as a pair; whether it may touch.
inline bool MakePair(const World& w, const int* ids, bool edges, Pair* pair) {
  const Model& m = *w.model;
  const int *corners = m.At<int>(m.triangle_vertex_at), *ends = m.At<int>(m.edge_vertex_at);
  using Float3 = Vec3<float>;
  Float3 x[4], move[4];
  for (int k = 0; k < 4; ++k) {
    const int v = edges ? ends[2 * ids[k / 2] + k % 2] : k == 0 ? ids[0] : corners[3 * ids[1] + k - 1];
    const float *p = w.position + 4 * v, *u = w.move + 4 * v;
    pair->vertex[k] = v;
    x[k] = {p[0], p[1], p[2]};
    move[k] = {u[0], u[1], u[2]};
  }
  float* q = pair->weight;
  if (edges) {
    float s, t;
    ClosestOnSegments(x[1] - x[0], x[3] - x[2], x[0] - x[2], &s, &t);
    q[0] = 1.0f - s, q[1] = s, q[2] = t - 1.0f, q[3] = -t;
  } else {
    float on[3];
    ClosestOnTriangle(x[0], x[1], x[2], x[3], on);
    q[0] = 1, q[1] = -on[0], q[2] = -on[1], q[3] = -on[2];
  }
  Float3 normal;
  if (!MayMeet(x, move, edges ? 2 : 1, q, kInterest * m.thickness, &normal, &pair->distance)) return false;
  pair->normal[0] = normal.x, pair->normal[1] = normal.y, pair->normal[2] = normal.z;
  int region = 0;
  for (int k = 0; k < 4; ++k) region |= (q[k] != 0) << k;
  pair->edges = edges;
  pair->region = static_cast<std::int16_t>(edges ? region : region >> 1);
  pair->first = ids[0];
  pair->second = ids[1];
  return true;
}

// Fills `found`, those that must not pass through each other, and `pairs`, those that push.
inline void FindPairs(const World& w) {
  const Model& m = *w.model;
  FindCandidates(w);
  Each(m.triangles, [&](int t) { FindNormal(w.position, m.At<int>(m.triangle_vertex_at) + 3 * t, w.normals + 3 * t); });
  Once([&] { w.step->num_found = w.step->num_pairs = 0; });
  const PairRules rules = {m.At<int>(m.triangle_owned_at), m.At<int>(m.edge_triangle_at), w.normals,
                           m.At<int>(m.chain_at),          m.At<int>(m.place_at),         m.At<int>(m.owner_at)};
  for (int edges = 0; edges < 2; ++edges) {
    const int* candidates = edges ? w.edge_candidates : w.triangle_candidates;
    Each(w.step->num_candidates[edges], [&](int i) {
      Pair pair;
      if (!MakePair(w, candidates + 2 * i, edges, &pair)) return;
      const bool counts = Counts(rules, pair, m.thickness);
      if (counts || !edges || !AreCords(rules, pair)) {
        const int n = Add(&w.step->num_found, 1);
        if (n < m.found) w.found[n] = pair;
      }
      if (!counts) return;
      const int n = Add(&w.step->num_pairs, 1);
      if (n < m.rows) w.pairs[n] = pair;
    });
  }
  Once([&] {
    if (w.step->num_found > m.found) w.step->flags |= kPairsFull, w.step->num_found = m.found;
    if (w.step->num_pairs > m.rows) w.step->flags |= kRowsFull, w.step->num_pairs = m.rows;
  });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_SEARCH_H_
