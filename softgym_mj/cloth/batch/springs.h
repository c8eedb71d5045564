// Rows of edges, hinges and ropes, solved as in `EdgeRows`, `HingeRows` and `ChainRows`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_SPRINGS_H_
#define SOFTGYM_MJ_CLOTH_BATCH_SPRINGS_H_

#include "cloth/batch/environment.h"
#include "cloth/batch/rows.h"
#include "cloth/plugin/edges.h"

namespace softgym_mj::cloth {
namespace {

inline void StartSprings(const Environment& w) {
  const Model& m = *w.model;
  const int *edge_order = m.At<int>(m.edge_order_at), *hinge_order = m.At<int>(m.hinge_order_at);
  const EdgeBlock* edges = m.At<EdgeBlock>(m.edge_blocks_at);
  const HingeBlock* hinges = m.At<HingeBlock>(m.hinge_blocks_at);
  Each(kBlock * m.edge_blocks, [&](int i) {
    const EdgeBlock& from = edges[i / kBlock];
    EdgeBlock& block = w.edges[i / kBlock];
    const int lane = i % kBlock, edge = edge_order[i];
    for (int k = 0; k < 2; ++k) block.vertex[k][lane] = from.vertex[k][lane];
    block.length[lane] = from.length[lane];
    block.gamma[lane] = from.gamma[lane];
    block.keep[lane] = from.keep[lane];
    float way[3] = {1, 0, 0}, length = 1;
    if (edge >= 0) length = StartWay(w.start, block.vertex[0][lane], block.vertex[1][lane], way);
    block.before[lane] = edge < 0 ? 1 : length - static_cast<float>(w.after_edge[edge]);
    block.impulse[lane] = 0;
    for (int k = 0; k < 3; ++k) block.start[k][lane] = way[k];
  });
  Each(kBlock * m.hinge_blocks, [&](int i) {
    const HingeBlock& from = hinges[i / kBlock];
    HingeBlock& block = w.hinges[i / kBlock];
    const int lane = i % kBlock;
    for (int k = 0; k < 4; ++k) {
      block.vertex[k][lane] = from.vertex[k][lane];
      block.weight[k][lane] = from.weight[k][lane];
    }
    block.gamma[lane] = from.gamma[lane];
    block.keep[lane] = from.keep[lane];
    for (int k = 0; k < 3; ++k) {
      double sum = 0;
      for (int c = 0; hinge_order[i] >= 0 && c < 4; ++c) {
        const int v = block.vertex[c][lane];
        if (v < m.vertices) sum += block.weight[c][lane] * w.start[3 * v + k];
      }
      block.start[k][lane] = block.before[k][lane] = static_cast<float>(sum);
    }
  });
  for (int c = 0; c < m.chains; ++c) {
    const int first = m.At<int>(m.chain_first_at)[c], end = m.At<int>(m.chain_first_at)[c + 1];
    const int *vertex = m.At<int>(m.chain_vertex_at) + c, *edge = m.At<int>(m.chain_edge_at);
    Each(end - first, [&](int i) {
      const int e = first + i;
      const float length = StartWay(w.start, vertex[e + 1], vertex[e], w.chain_start + 3 * e);
      w.chain_before[e] = length - static_cast<float>(w.after_edge[edge[e]]);
    });
  }
}

SGM_APART void Bend(const Environment& w, int substep) {
  const Model& m = *w.model;
  if (m.hinge_blocks == 0 || substep % m.bend_interval != 0) return;
  const float n = static_cast<float>(m.bend_interval);
  const int chunks = 4 * m.padded / kLanes;
  EachBlock(0, chunks, [&](int i) { Unbent(w.points, kLanes * i, n).Store(w.points.predicted + kLanes * i); });
  EachBlockOf(m.At<int>(m.hinge_colors_at), m.hinge_colors, [&](int b) { SweepHinges(w.points, w.hinges + b); });
  EachBlock(0, chunks, [&](int i) { SpreadBend(w.points, kLanes * i, n); });
}

inline ChainRow ChainOf(const Environment& w, int c) {
  const Model& m = *w.model;
  const int first = m.At<int>(m.chain_first_at)[c], size = m.At<int>(m.chain_first_at)[c + 1] - first;
  return {size,
          m.At<int>(m.chain_vertex_at) + c + first,
          w.chain_start + 3 * first,
          m.At<float>(m.chain_length_at) + first,
          m.At<float>(m.chain_gamma_at) + first,
          m.At<float>(m.chain_keep_at) + first,
          w.chain_before + first,
          w.chain_impulse + first,
          w.chain_lower + first,
          w.chain_diagonal + first,
          w.chain_right + first,
          w.chain_normal + 3 * first};
}

// Solves ropes, as `ChainRows::Solve`.
SGM_APART void SolveChains(const Environment& w, bool settles) {
  for (int c = 0; c < w.model->chains; ++c) {
    const ChainRow chain = ChainOf(w, c);
    const int size = chain.size;
    Each(size, [&](int e) { StartChainEdge(w.points, chain, e, settles); });
    Each(size, [&](int e) { ConnectChainEdge(w.points, chain, e); });
    Once([&] { SolveChain(chain); });
    Each(size + 1, [&](int i) { MoveChainVertex(w.points, chain, i, settles); });
  }
}

// Ends a sweep of ropes, as `ChainRows::End`.
inline void EndChains(const Environment& w) {
  for (int c = 0; c < w.model->chains; ++c) {
    const ChainRow chain = ChainOf(w, c);
    Each(chain.size, [&](int e) { EndChainEdge(w.points, chain, e); });
  }
}

inline void SweepSprings(const Environment& w) {
  const Model& m = *w.model;
  const StiffeningBlock* stiffening = m.stiffening_at ? m.At<StiffeningBlock>(m.stiffening_at) : nullptr;
  EachBlockOf(m.At<int>(m.edge_colors_at), m.edge_colors,
              [&](int b) { SweepEdges(w.points, w.edges + b, stiffening ? stiffening + b : nullptr); });
  SolveChains(w, false);
  EndChains(w);
}

// Adds `share` times the impulses of edges to the forces on held vertices.
inline void AddHoldingForces(const Environment& w, double share) {
  const Model& m = *w.model;
  // A separate loop through memory: GCC 12 would keep intermediate values unrounded.
  Each(3 * m.chain_edges, [&](int i) { w.chain_way[i] = static_cast<float>(w.chain_normal[i]); });
  Each(m.grippers, [&](int g) {
    const int v = w.held[g];
    if (v < 0) return;
    double* force = w.forces + 3 * v;
    const int *first = m.At<int>(m.lanes_of_at), *lanes = m.At<int>(m.lane_of_at);
    for (int i = first[v]; i < first[v + 1]; ++i) {
      const EdgeBlock& block = w.edges[lanes[i] / kBlock];
      const int lane = lanes[i] % kBlock, a = block.vertex[0][lane], b = block.vertex[1][lane];
      float way[3];
      for (int k = 0; k < 3; ++k) {
        way[k] = block.start[k][lane] + (w.points.now[4 * a + k] - w.points.now[4 * b + k]);
      }
      AddForce(way, (a == v ? share : -share) * block.impulse[lane], force);
    }
    for (int c = 0; c < m.chains; ++c) {
      const int begin = m.At<int>(m.chain_first_at)[c], end = m.At<int>(m.chain_first_at)[c + 1];
      const int* vertex = m.At<int>(m.chain_vertex_at) + c;
      for (int e = begin; e < end; ++e) {
        if (vertex[e] != v && vertex[e + 1] != v) continue;
        const float* way = w.chain_way + 3 * e;
        if (vertex[e + 1] == v) AddForce(way, share * w.chain_impulse[e], force);
        if (vertex[e] == v) AddForce(way, -share * w.chain_impulse[e], force);
      }
    }
  });
}

inline void KeepSprings(const Environment& w) {
  const Model& m = *w.model;
  const int* order = m.At<int>(m.edge_order_at);
  Each(kBlock * m.edge_blocks, [&](int i) {
    if (order[i] < 0) return;
    const EdgeBlock& block = w.edges[i / kBlock];
    const int lane = i % kBlock;
    const float way[3] = {block.start[0][lane], block.start[1][lane], block.start[2][lane]};
    w.after_edge[order[i]] =
        LengthNow(w.points, block.vertex[0][lane], block.vertex[1][lane], way) - block.before[lane];
  });
  for (int c = 0; c < m.chains; ++c) {
    const int first = m.At<int>(m.chain_first_at)[c], end = m.At<int>(m.chain_first_at)[c + 1];
    const int *vertex = m.At<int>(m.chain_vertex_at) + c, *edge = m.At<int>(m.chain_edge_at);
    Each(end - first, [&](int i) {
      const int e = first + i;
      w.after_edge[edge[e]] = LengthNow(w.points, vertex[e + 1], vertex[e], w.chain_start + 3 * e) - w.chain_before[e];
    });
  }
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_SPRINGS_H_
