// State of layer contacts that is kept from step to step, and the start of their rows.

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "cloth/plugin/layers.h"

namespace softgym_mj::cloth {
namespace {

// Key of a pair, never 0: positive for a vertex and a triangle, negative for two edges.
double KeyOf(const Mesh& mesh, const Pair& pair) {
  if (pair.edges) return -1.0 - static_cast<double>(pair.first) * mesh.edges.size() - pair.second;
  return 1.0 + static_cast<double>(pair.first) * mesh.triangles.size() + pair.second;
}

// Index of the first item of a pair among all vertices and edges; -1 if a number of the state is not a key.
int FirstOf(const Mesh& mesh, double key) {
  const bool edges = key < 0;
  const double first = (std::fabs(key) - 1) / (edges ? mesh.edges.size() : mesh.triangles.size());
  if (!(first >= 0 && first < (edges ? mesh.edges.size() : mesh.NumVertices()))) return -1;
  return (edges ? mesh.NumVertices() : 0) + static_cast<int>(first);
}

}  // namespace

void Layers::Start(const Mesh& mesh, const double* position, const double* after, int size) {
  head_.assign(mesh.NumVertices() + mesh.edges.size(), -1);
  next_.resize(size);
  for (int i = 0; i < size && after[4 * i] != 0; ++i) {
    const int first = FirstOf(mesh, after[4 * i]);
    if (first >= 0) next_[i] = std::exchange(head_[first], i);
  }
  for (size_t i = 0; i < order_.size(); ++i) {
    LayerBlock& block = blocks[i / kBlock];
    const int lane = i % kBlock, row = order_[i];
    for (int k = 0; k < 3; ++k) block.before[k][lane] = block.held[k][lane] = 0;
    block.impulse[lane] = 0;
    if (row < 0) continue;
    const Pair& pair = pairs[row];
    const double key = KeyOf(mesh, pair);
    int found = head_[FirstOf(mesh, key)];
    while (found >= 0 && after[4 * found] != key) found = next_[found];
    double gap = -Thickness(mesh, pair);
    for (int k = 0; k < 3; ++k) {
      double apart = 0;
      for (int c = 0; c < 4; ++c) apart += static_cast<double>(pair.weight[c]) * position[3 * pair.vertex[c] + k];
      if (found >= 0) block.before[k][lane] = static_cast<float>(-after[4 * found + 1 + k]);
      gap += pair.normal[k] * apart;
    }
    block.gap[lane] = static_cast<float>(gap);
  }
}

void Layers::Keep(const Mesh& mesh, const Points& points, const float* with_layers, bool repeated, double* after,
                  int size) {
  std::fill(after, after + 4 * size, 0.0);
  later_.assign(3 * (mesh.NumVertices() + 1), 0);
  int count = 0;
  for (size_t i = order_.size(); i-- > 0;) {
    const LayerBlock& block = blocks[i / kBlock];
    const int lane = i % kBlock;
    if (!(block.impulse[lane] > 0)) continue;
    double moved[3] = {0, 0, 0}, change[3];
    for (int k = 0; k < 3; ++k) {
      change[k] = block.held[k][lane] + static_cast<double>(block.impulse[lane]) * block.normal[k][lane];
    }
    const bool last = !repeated || static_cast<int>(i) >= num_near_ * kBlock;  // Its only sweep in the substep.
    for (int c = 0; c < 4; ++c) {
      const int v = block.vertex[c][lane];
      const double weight = block.weight[c][lane], mass = points.now[4 * v + 3];
      for (int k = 0; k < 3; ++k) {
        double* later = &later_[3 * v + k];
        moved[k] += weight * (points.now[4 * v + k] - with_layers[4 * v + k] + (last ? *later : 0));
        *later += weight * mass * change[k];
      }
    }
    if (count == size) continue;
    after[4 * count] = KeyOf(mesh, pairs[order_[i]]);
    std::copy(moved, moved + 3, after + 4 * count++ + 1);
  }
}

}  // namespace softgym_mj::cloth
