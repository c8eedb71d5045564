#include "cloth/plugin/layers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "cloth/plugin/method.h"
#include "cloth/plugin/pair_rules.h"

namespace softgym_mj::cloth {
namespace {

// Coincident or very fast vertices form pairs of all with all: 64 x 64 vertices have 100 million. The search is limited
// to this number of overlapping boxes, 8 bytes each. Pairs that may touch are limited to kMostPairs or, for larger
// cloth, to kMostOfVertex per vertex on average, several times the number of a pile: each takes about 200 bytes, and up
// to eight times that if a vertex has more than 256 of them, because rows that share a vertex fill a block each.
constexpr size_t kMostOverlaps = 1 << 24;
constexpr size_t kMostPairs = 1 << 18, kMostOfVertex = 64;
constexpr float kFurthest = 1e30f;  // [m] Limit of boxes, so that none overlaps those of unused lanes.
constexpr int kChunk = 1 << 12;     // Candidates that are filtered together: whole blocks.

// Morton code: interleaved bits of three coordinates, so that near items get near numbers.
std::uint64_t Morton(const double* x, const double* low, double size) {
  std::uint64_t code = 0;
  for (int k = 0; k < 3; ++k) {
    const auto cell = static_cast<std::uint64_t>(std::min(1023.0, (x[k] - low[k]) / size * 1024));
    for (int bit = 0; bit < 10; ++bit) code |= (cell >> bit & 1) << (3 * bit + k);
  }
  return code;
}

}  // namespace

void Layers::Tree::Build(const std::vector<int>& items_by_place, const std::vector<int>& vertices,
                         int corners_of_item) {
  id = items_by_place;
  const int padded = (static_cast<int>(id.size()) + kBlock - 1) / kBlock * kBlock;
  id.resize(padded, -1);
  corners.resize(3 * padded);
  for (int i = 0; i < padded; ++i) {
    for (int k = 0; k < 3; ++k) {
      corners[3 * i + k] = id[i] < 0 ? 0 : vertices[corners_of_item * id[i] + std::min(k, corners_of_item - 1)];
    }
  }
  items.resize(padded / kBlock);
  leaves.resize((items.size() + kBlock - 1) / kBlock);
  bounds.resize(6 * leaves.size());
}

void Layers::Tree::Bound(const ClothKernels& kernels, const float* low, const float* high) {
  constexpr float kFar = std::numeric_limits<float>::max();
  for (size_t leaf = 0; leaf < items.size(); ++leaf) {
    Boxes& boxes = items[leaf];
    kernels.BoundItems(low, high, &corners[3 * kBlock * leaf], &boxes);
    Boxes& node = leaves[leaf / kBlock];
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < kBlock; ++i) {
        if (id[kBlock * leaf + i] < 0) boxes.low[k][i] = kFar, boxes.high[k][i] = -kFar;
      }
      node.low[k][leaf % kBlock] = *std::min_element(boxes.low[k], boxes.low[k] + kBlock);
      node.high[k][leaf % kBlock] = *std::max_element(boxes.high[k], boxes.high[k] + kBlock);
    }
  }
  for (size_t node = 0; node < leaves.size(); ++node) {
    const int size = std::min<int>(kBlock, static_cast<int>(items.size() - kBlock * node));
    for (int k = 0; k < 3; ++k) {
      for (int i = size; i < kBlock; ++i) leaves[node].low[k][i] = kFar, leaves[node].high[k][i] = -kFar;
      bounds[6 * node + k] = *std::min_element(leaves[node].low[k], leaves[node].low[k] + size);
      bounds[6 * node + 3 + k] = *std::max_element(leaves[node].high[k], leaves[node].high[k] + size);
    }
  }
}

BoxTree Layers::Tree::View() {
  return {static_cast<int>(items.size()),
          static_cast<int>(leaves.size()),
          items.data(),
          leaves.data(),
          bounds.data(),
          id.data(),
          corners.data()};
}

void Layers::Reset(const Mesh& mesh, const ClothKernels& kernels) {
  kernels_ = &kernels;
  found_once_ = false;
  reach_ = kInterest * *std::max_element(mesh.thickness.begin(), mesh.thickness.end());
  corners_.clear();
  ends_.clear();
  for (const Mesh::Triangle& t : mesh.triangles) corners_.insert(corners_.end(), t.vertex, t.vertex + 3);
  for (const Mesh::Edge& e : mesh.edges) ends_.insert(ends_.end(), e.vertex, e.vertex + 2);
  owned_.clear();
  sides_.clear();
  for (const Mesh::Triangle& t : mesh.triangles) owned_.push_back(t.owned);
  for (const Mesh::Edge& e : mesh.edges) sides_.insert(sides_.end(), e.triangle, e.triangle + 2);
  chain_.assign(mesh.edges.size(), -1);
  place_.assign(mesh.edges.size(), 0);
  owner_.assign(mesh.NumVertices(), -1);
  for (size_t c = 0; c < mesh.chains.size(); ++c) {
    for (size_t i = 0; i < mesh.chains[c].edge.size(); ++i) {
      chain_[mesh.chains[c].edge[i]] = static_cast<int>(c);
      place_[mesh.chains[c].edge[i]] = static_cast<int>(i);
    }
    for (size_t i = 0; i < mesh.chains[c].edge.size(); ++i) {
      const int edge = mesh.chains[c].edge[i];
      for (int v : mesh.edges[edge].vertex) owner_[v] = owner_[v] < 0 ? edge : owner_[v];
    }
  }
  const auto order = [&](const std::vector<int>& vertices, int corners) {
    const int count = static_cast<int>(vertices.size()) / corners;
    std::vector<double> middle(3 * count, 0.0);
    double low[3], high[3];
    for (int k = 0; k < 3; ++k) {
      low[k] = std::numeric_limits<double>::max(), high[k] = -low[k];
      for (int i = 0; i < count; ++i) {
        for (int c = 0; c < corners; ++c) middle[3 * i + k] += mesh.rest[3 * vertices[corners * i + c] + k] / corners;
        low[k] = std::min(low[k], middle[3 * i + k]);
        high[k] = std::max(high[k], middle[3 * i + k]);
      }
    }
    const double size = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-9});
    std::vector<std::pair<std::uint64_t, int>> codes(count);
    for (int i = 0; i < count; ++i) codes[i] = {Morton(&middle[3 * i], low, size), i};
    std::sort(codes.begin(), codes.end());
    std::vector<int> ids(count);
    for (int i = 0; i < count; ++i) ids[i] = codes[i].second;
    return ids;
  };
  // Vertices of ropes can touch the inside of triangles, too.
  std::vector<int> single(mesh.NumVertices());
  for (int v = 0; v < mesh.NumVertices(); ++v) single[v] = v;
  vertices_.Build(order(single, 1), single, 1);
  triangles_.Build(mesh.triangles.empty() ? std::vector<int>() : order(corners_, 3), corners_, 3);
  edges_.Build(order(ends_, 2), ends_, 2);
}

bool Layers::Covers(const AlignedFloats& position, const AlignedFloats& move) const {
  if (low_.size() != position.size()) return false;
  const float margin = reach_ / 2;
  for (size_t i = 0; i < position.size(); ++i) {
    if (i % 4 == 3) continue;
    const float a = position[i], b = position[i] + move[i];
    if (std::min(a, b) - margin < low_[i] || std::max(a, b) + margin > high_[i]) return false;
  }
  return true;
}

bool Layers::Collect(Tree* a, Tree* b, bool same, std::vector<int>* out) {
  out->resize(std::clamp<size_t>(out->capacity(), 1 << 12, 2 * kMostOverlaps));
  int count = 0;
  bool full = false;
  while (!a->items.empty() && !b->items.empty()) {
    count = kernels_->Overlap(a->View(), b->View(), same, out->data(), static_cast<int>(out->size() / 2), &full);
    if (!full || out->size() == 2 * kMostOverlaps) break;
    out->resize(std::min(2 * out->size(), 2 * kMostOverlaps));
  }
  out->resize(2 * count);
  for (int i = 0; i < count; ++i) {
    (*out)[2 * i] = a->id[(*out)[2 * i]];
    (*out)[2 * i + 1] = b->id[(*out)[2 * i + 1]];
  }
  return !full;
}

void Layers::FindCandidates(const AlignedFloats& position, const AlignedFloats& move) {
  if (Covers(position, move)) return;
  // Vertices that are too fast to keep candidates get no margin.
  float fastest = 0;
  for (float u : move) fastest = std::max(fastest, std::fabs(u));
  const float slack = kSlack * reach_, margin = reach_ / 2 + (fastest < slack / 2 ? slack : 0);
  low_.resize(position.size());
  high_.resize(position.size());
  for (size_t i = 0; i < position.size(); ++i) {
    const float a = position[i], b = position[i] + move[i];
    low_[i] = std::max(std::min(a, b) - margin, -kFurthest);
    high_[i] = std::min(std::max(a, b) + margin, kFurthest);
  }
  for (Tree* tree : {&vertices_, &triangles_, &edges_}) tree->Bound(*kernels_, low_.data(), high_.data());
  all_overlaps_ = Collect(&vertices_, &triangles_, false, &triangle_candidates_);
  all_overlaps_ &= Collect(&edges_, &edges_, true, &edge_candidates_);
  if (!all_overlaps_) low_.clear();  // Incomplete candidates depend on the boxes and are not kept.
}

void Layers::Filter(const Scene& scene, const std::vector<int>& candidates,
                    int (*filter)(const Scene&, const int*, int, Pair*)) {
  const size_t most = std::max(kMostPairs, kMostOfVertex * owner_.size());
  for (size_t first = 0; first < candidates.size() && found_.size() <= most; first += 2 * kChunk) {
    const int count = static_cast<int>(std::min<size_t>(kChunk, (candidates.size() - first) / 2));
    const size_t before = found_.size();
    found_.resize(before + count);
    found_.resize(before + filter(scene, &candidates[first], count, &found_[before]));
  }
  all_pairs_ &= found_.size() <= most;
  if (found_.size() > most) found_.resize(most);
}

void Layers::FindNormals(const Mesh& mesh, const AlignedFloats& position) {
  normals_.resize(3 * mesh.triangles.size());
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    FindNormal(position.data(), mesh.triangles[t].vertex, &normals_[3 * t]);
  }
}

void Layers::Find(const Mesh& mesh, const AlignedFloats& position, const AlignedFloats& move) {
  FindCandidates(position, move);
  const Scene scene = {position.data(),
                       move.data(),
                       corners_.data(),
                       ends_.data(),
                       mesh.part.data(),
                       mesh.thickness.data(),
                       static_cast<int>(mesh.flexes.size()),
                       kInterest};
  found_.clear();
  all_pairs_ = all_overlaps_;
  Filter(scene, triangle_candidates_, kernels_->FilterTriangles);
  Filter(scene, edge_candidates_, kernels_->FilterEdges);
  FindNormals(mesh, position);
  pairs.clear();
  const PairRules rules = {owned_.data(), sides_.data(), normals_.data(), chain_.data(), place_.data(), owner_.data()};
  const auto left_out = [&](const Pair& pair) {
    const bool counts = Counts(rules, pair, Thickness(mesh, pair));
    if (counts) pairs.push_back(pair);
    return !counts && pair.edges && AreRopes(rules, pair);
  };
  found_.erase(std::remove_if(found_.begin(), found_.end(), left_out), found_.end());
}

// Returns 0 for pushing pairs near marked vertices, 1 for other pairs near them, 2 for all others. The result depends
// on reference positions only, not on gaps.
std::vector<int> Layers::GroupRows(const Mesh& mesh, const std::vector<bool>& near) {
  std::vector<int> group(pairs.size(), 2);
  std::vector<bool> marked = near;
  for (int ring = 0; ring < 2 && !near.empty(); ++ring) {
    std::vector<bool> next = marked;
    for (size_t i = 0; i < pairs.size(); ++i) {
      const int* v = pairs[i].vertex;
      if (!marked[v[0]] && !marked[v[1]] && !marked[v[2]] && !marked[v[3]]) continue;
      group[i] = pairs[i].distance > (1 + kNotYet) * Thickness(mesh, pairs[i]);
      for (int k = 0; k < 4; ++k) next[v[k]] = true;
    }
    marked = next;
  }
  near_vertex_ = marked;
  return group;
}

void Layers::MakeRows(const Mesh& mesh, const AlignedFloats& position, const AlignedFloats& move,
                      const std::vector<float>& inverse_mass, const std::vector<bool>& near, float gamma) {
  const bool same = found_once_ && position == position_ && move == move_;
  if (same && inverse_mass == inverse_mass_ && near == near_) return;
  if (!same) Find(mesh, position, move);
  found_once_ = true;
  position_ = position, move_ = move, inverse_mass_ = inverse_mass, near_ = near;
  const int dummy = mesh.NumVertices();
  movable_.resize(dummy + 1);
  for (int v = 0; v < dummy; ++v) movable_[v] = inverse_mass[v] > 0;
  const std::vector<int> group = GroupRows(mesh, near);
  order_.clear();
  std::vector<int> rows, part;
  for (int g = 0; g < 3; ++g) {
    rows.clear();
    row_vertices_.clear();
    for (size_t i = 0; i < pairs.size(); ++i) {
      if (group[i] != g) continue;
      rows.push_back(static_cast<int>(i));
      row_vertices_.insert(row_vertices_.end(), pairs[i].vertex, pairs[i].vertex + 4);
    }
    if (g == 2) num_near_ = static_cast<int>(order_.size()) / kBlock;
    coloring_.Order(row_vertices_.data(), static_cast<int>(rows.size()), 4, movable_.data(), dummy + 1, &part);
    for (int i : part) order_.push_back(i < 0 ? -1 : rows[i]);
  }
  blocks.resize(order_.size() / kBlock);
  for (size_t i = 0; i < order_.size(); ++i) {
    LayerBlock& block = blocks[i / kBlock];
    const int lane = i % kBlock, row = order_[i];
    block.gap[lane] = 1;
    block.friction[lane] = block.mass[lane] = block.inverse[lane] = 0;
    for (int k = 0; k < 3; ++k) block.normal[k][lane] = 0;
    for (int k = 0; k < 4; ++k) block.vertex[k][lane] = dummy, block.weight[k][lane] = 0;
    if (row < 0) continue;
    const Pair& pair = pairs[row];
    float mass = 0;
    for (int k = 0; k < 4; ++k) {
      block.vertex[k][lane] = pair.vertex[k];
      block.weight[k][lane] = pair.weight[k];
      mass += pair.weight[k] * pair.weight[k] * inverse_mass[pair.vertex[k]];
    }
    for (int k = 0; k < 3; ++k) block.normal[k][lane] = pair.normal[k];
    block.friction[lane] = mesh.friction[mesh.Pair(pair.vertex[0], pair.vertex[3])];
    block.mass[lane] = mass;
    block.inverse[lane] = mass > 0 ? 1 / (mass + gamma) : 0;
  }
}

}  // namespace softgym_mj::cloth
