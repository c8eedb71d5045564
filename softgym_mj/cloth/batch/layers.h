// Rows of layer contacts from pairs, as in `Layers`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_LAYERS_H_
#define SOFTGYM_MJ_CLOTH_BATCH_LAYERS_H_

#include "cloth/batch/environment.h"
#include "cloth/batch/rows.h"
#include "cloth/batch/search.h"

namespace softgym_mj::cloth {
namespace {

// Key of a pair, never 0: positive for a vertex and a triangle, negative for two edges.
inline double KeptKey(const Model& m, const Pair& pair) {
  if (pair.edges) return -1.0 - static_cast<double>(pair.first) * m.edges - pair.second;
  return 1.0 + static_cast<double>(pair.first) * m.triangles + pair.second;
}

// Index of the first item of a pair among all vertices and edges; -1 if the number is not a key.
inline int FirstOf(const Model& m, double key) {
  const bool edges = key < 0;
  const double first = ((edges ? -key : key) - 1) / (edges ? m.edges : m.triangles);
  if (!(first >= 0 && first < (edges ? m.edges : m.vertices))) return -1;
  return (edges ? m.vertices : 0) + static_cast<int>(first);
}

// Updates reference positions of vertices that have moved, and displacements of moving vertices.
inline void FollowReference(const Environment& w) {
  const Model& m = *w.model;
  const double dt = m.timestep;
  Each(3, [&](int k) {
    double mean = 0;
    for (int v = 0; v < m.vertices; ++v) mean += dt * w.velocity[3 * v + k] / m.vertices;
    w.step->mean[k] = mean;
    if (k == 0) w.step->moves = 0;
  });
  Each(m.vertices, [&](int v) {
    double away = 0, way = 0;
    for (int k = 0; k < 3; ++k) {
      const double d = w.start[3 * v + k] - w.reference[3 * v + k], u = dt * w.velocity[3 * v + k];
      away += d * d;
      way += u * u;
    }
    const bool stands = way < kHysteresis * kHysteresis;
    if (!stands) SetBits(&w.step->moves, 1);
    for (int k = 0; k < 3; ++k) {
      if (away > kHysteresis * kHysteresis) w.reference[3 * v + k] = w.start[3 * v + k];
      w.position[4 * v + k] = static_cast<float>(w.reference[3 * v + k]);
      w.move[4 * v + k] = stands ? 0 : static_cast<float>(dt * w.velocity[3 * v + k]);
    }
  });
  // Rigid motion of a whole cloth brings no layers together.
  Each(w.step->moves ? m.vertices : 0, [&](int v) {
    for (int k = 0; k < 3; ++k) w.move[4 * v + k] -= static_cast<float>(w.step->mean[k]);
  });
}

// Rows of pairs: group 0 of those near bodies that give way that push, group 1 of others near them, group 2 of the
// rest.
struct LayerGroup {
  Rows* rows;
  LayerBlock* blocks;
  int* pair_of;  // Pair of each row; null if rows are pairs.
};

constexpr int kFarGroup = 2;

inline LayerGroup GroupOf(const Environment& w, int g) {
  int* pair_of = TouchesBodies(w) ? w.pair_of + g * w.model->rows : nullptr;
  if (g == kFarGroup) return {&w.step->layers, w.layers, pair_of};
  return {&w.step->near_layers[g], w.near_layers[g], pair_of};
}
inline int FirstGroup(const Environment& w) { return TouchesBodies(w) ? 0 : kFarGroup; }

// Marks vertices near bodies that give way, and groups pairs, as `Layers::GroupRows`.
inline void GroupPairs(const Environment& w) {
  const Model& m = *w.model;
  Each(m.padded, [&](int v) { w.near_vertex[v] = 0; });
  Each(w.step->num_pairs, [&](int i) { w.group[i] = kFarGroup; });
  for (int t = m.grippers; t < m.grippers + Solids(m); ++t) {
    const Touch& touch = w.touch[t];
    for (const Rows* rows : {&touch.points, &touch.triangles}) {
      Each(touch.pushes ? 3 * rows->count : 0, [&](int i) { SetBits(&w.near_vertex[rows->vertex[i]], 1); });
    }
  }
  Once([&] { w.near_vertex[m.vertices] = 0; });
  for (int ring = 0; ring < 2; ++ring) {
    Each(m.padded, [&](int v) { w.next_near[v] = w.near_vertex[v]; });
    Each(w.step->num_pairs, [&](int i) {
      const Pair& pair = w.pairs[i];
      bool marked = false;
      for (int v : pair.vertex) marked = marked || w.near_vertex[v];
      if (!marked) return;
      w.group[i] = pair.distance > (1 + kNotYet) * ThicknessOf(m, pair);
      for (int v : pair.vertex) SetBits(&w.next_near[v], 1);
    });
    Each(m.padded, [&](int v) { w.near_vertex[v] = w.next_near[v]; });
  }
}

inline void MakeGroup(const Environment& w, int g) {
  const Model& m = *w.model;
  const LayerGroup group = GroupOf(w, g);
  Rows* rows = group.rows;
  Once([&] { rows->count = group.pair_of ? 0 : w.step->num_pairs; });
  Each(w.step->num_pairs, [&](int i) {
    if (group.pair_of && w.group[i] != g) return;
    const Pair& pair = w.pairs[i];
    const int row = group.pair_of ? Add(&rows->count, 1) : i;
    if (group.pair_of) group.pair_of[row] = i;
    for (int k = 0; k < 4; ++k) rows->vertex[4 * row + k] = pair.vertex[k];
    const unsigned number = static_cast<unsigned>(pair.edges) << 31 | static_cast<unsigned>(pair.first) << 16 |
                            static_cast<unsigned>(pair.second);
    rows->key[row] = RowKey(pair.vertex, 4, number);
  });
  // In repeated sweeps a block without an impulse is skipped as a whole: it matters which rows share it.
  ColorRows(w, 4, g != kFarGroup, rows, [&](int v) { return w.yielding[v] > 0; });
  Each(kBlock * rows->blocks, [&](int i) {
    LayerBlock& block = group.blocks[i / kBlock];
    const int lane = i % kBlock, row = rows->order[i];
    block.gap[lane] = 1;
    block.friction[lane] = block.mass[lane] = block.inverse[lane] = block.impulse[lane] = 0;
    for (int k = 0; k < 3; ++k) block.normal[k][lane] = block.before[k][lane] = block.held[k][lane] = 0;
    for (int k = 0; k < 4; ++k) block.vertex[k][lane] = m.vertices, block.weight[k][lane] = 0;
    if (row < 0) return;
    const Pair& pair = w.pairs[group.pair_of ? group.pair_of[row] : row];
    float mass = 0;
    for (int k = 0; k < 4; ++k) {
      block.vertex[k][lane] = pair.vertex[k];
      block.weight[k][lane] = pair.weight[k];
      mass += pair.weight[k] * pair.weight[k] * w.yielding[pair.vertex[k]];
    }
    const double key = KeptKey(m, pair);
    int found = w.head[FirstOf(m, key)];
    while (found >= 0 && w.after_layers[4 * found] != key) found = w.next[found];
    double gap = -ThicknessOf(m, pair);
    for (int k = 0; k < 3; ++k) {
      double apart = 0;
      for (int c = 0; c < 4; ++c) apart += static_cast<double>(pair.weight[c]) * w.start[3 * pair.vertex[c] + k];
      if (found >= 0) block.before[k][lane] = static_cast<float>(-w.after_layers[4 * found + 1 + k]);
      gap += pair.normal[k] * apart;
      block.normal[k][lane] = pair.normal[k];
    }
    block.gap[lane] = static_cast<float>(gap);
    block.friction[lane] = m.friction;
    block.mass[lane] = mass;
    block.inverse[lane] = mass > 0 ? 1 / (mass + m.contact.gamma) : 0;
  });
}

inline void MakeLayerRows(const Environment& w) {
  const Model& m = *w.model;
  if (TouchesBodies(w)) GroupPairs(w);
  // Kept pairs, linked by their first item.
  Each(m.vertices + m.edges, [&](int i) { w.head[i] = -1; });
  const int kept = kKeptPairs * m.vertices;
  Each(kept, [&](int i) {
    const int first = w.after_layers[4 * i] == 0 ? -1 : FirstOf(m, w.after_layers[4 * i]);
    if (first >= 0) w.next[i] = Exchange(&w.head[first], i);
  });
  for (int g = FirstGroup(w); g <= kFarGroup; ++g) MakeGroup(w, g);
}

// Calls f(block) for all blocks of near rows, or of the others.
template <class F>
inline void EachLayer(const Environment& w, bool near, F f) {
  for (int g = near ? FirstGroup(w) : kFarGroup; g < (near ? kFarGroup : kFarGroup + 1); ++g) {
    const LayerGroup group = GroupOf(w, g);
    EachColor(*group.rows, [&](int b) { f(group.blocks + b); });
  }
}

// Lists the blocks of near rows with an impulse after their first sweep in a substep; the others wait for the next one.
inline void ListPushing(const Environment& w) {
  for (int g = 0; g < kFarGroup; ++g) {
    const LayerGroup group = GroupOf(w, g);
    int* pushes = w.step->pushing[g].pushes;
    Each(group.rows->blocks, [&](int b) {
      bool any = false;
      for (int lane = 0; lane < kBlock; ++lane) any |= group.blocks[b].impulse[lane] > 0;
      pushes[b] = any;
    });
  }
  Each(kFarGroup, [&](int g) {
    const Rows& rows = *GroupOf(w, g).rows;
    PushingBlocks& pushing = w.step->pushing[g];
    int count = 0, colors = 0;
    for (int color = 0; color < rows.colors; ++color) {
      const int first = count;
      for (int b = rows.begin[color]; b < rows.begin[color + 1]; ++b) {
        if (pushing.pushes[b]) pushing.block[count++] = b;
      }
      if (count > first) pushing.begin[colors++] = first;
    }
    pushing.begin[colors] = count;
    pushing.colors = colors;
  });
}

// Calls f(block) for the blocks of near rows that `ListPushing` has listed.
template <class F>
inline void EachPushing(const Environment& w, F f) {
  for (int g = 0; g < kFarGroup; ++g) {
    const LayerGroup group = GroupOf(w, g);
    const PushingBlocks& pushing = w.step->pushing[g];
    EachBlockOf(pushing.begin, pushing.colors, [&](int i) { f(group.blocks + pushing.block[i]); });
  }
}

inline void KeepGroup(const Environment& w, int g) {
  const Model& m = *w.model;
  const LayerGroup group = GroupOf(w, g);
  const Rows& rows = *group.rows;
  const int size = kKeptPairs * m.vertices;
  const bool last_sweep = !kSolids || !w.step->repeats || g == kFarGroup;  // Its only sweep in the substep.
  for (int color = rows.colors; color-- > 0;) {
    const int first = kBlock * rows.begin[color];
    Each(kBlock * rows.begin[color + 1] - first, [&](int place) {
      const LayerBlock& block = group.blocks[(first + place) / kBlock];
      const int lane = place % kBlock;
      if (!(block.impulse[lane] > 0)) return;
      double moved[3] = {0, 0, 0}, change[3];
      for (int k = 0; k < 3; ++k) {
        change[k] = block.held[k][lane] + static_cast<double>(block.impulse[lane]) * block.normal[k][lane];
      }
      for (int c = 0; c < 4; ++c) {
        const int v = block.vertex[c][lane];
        const double weight = block.weight[c][lane], mass = w.points.now[4 * v + 3];
        for (int k = 0; k < 3; ++k) {
          double* later = &w.later[3 * v + k];
          moved[k] += weight * (w.points.now[4 * v + k] - w.with_layers[4 * v + k] + (last_sweep ? *later : 0));
          if (mass > 0) *later += weight * mass * change[k];
        }
      }
      const int n = Add(&w.step->num_kept, 1);
      if (n >= size) return;
      const int row = rows.order[first + place];
      w.after_layers[4 * n] = KeptKey(m, w.pairs[group.pair_of ? group.pair_of[row] : row]);
      for (int k = 0; k < 3; ++k) w.after_layers[4 * n + 1 + k] = moved[k];
    });
  }
}

// Stores the pairs that the next step needs, as `Layers::Keep`.
inline void KeepLayers(const Environment& w) {
  const Model& m = *w.model;
  Each(4 * kKeptPairs * m.vertices, [&](int i) { w.after_layers[i] = 0; });
  Each(3 * m.vertices, [&](int i) { w.later[i] = 0; });
  Once([&] { w.step->num_kept = 0; });
  for (int g = kFarGroup; g >= FirstGroup(w); --g) KeepGroup(w, g);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_LAYERS_H_
