#include "coloring.h"

#include "simd.h"

namespace softgym_mj {
namespace {

constexpr int kOpen = 64;  // Groups that are filled at the same time; one bit each.

}  // namespace

void Coloring::Order(const std::vector<int>& vertices, int corners, int num_vertices, std::vector<int>* order) {
  int group[kOpen][kLanes], size[kOpen] = {}, oldest = 0;
  groups_.assign(num_vertices, 0);
  order->clear();
  const auto close = [&](int g) {
    const std::uint64_t others = ~(std::uint64_t{1} << g);
    for (int i = 0; i < kLanes; ++i) {
      order->push_back(i < size[g] ? group[g][i] : -1);
      for (int k = 0; i < size[g] && k < corners; ++k) {
        const int v = vertices[corners * group[g][i] + k];
        if (v < num_vertices) groups_[v] &= others;
      }
    }
    size[g] = 0;
  };
  const int count = static_cast<int>(vertices.size()) / corners;
  for (int row = 0; row < count; ++row) {
    const int* vertex = &vertices[corners * row];
    std::uint64_t taken = 0;
    for (int k = 0; k < corners; ++k) taken |= vertex[k] < num_vertices ? groups_[vertex[k]] : 0;
    int g = 0;
    if (taken == ~std::uint64_t{0}) {
      g = oldest;
      oldest = (oldest + 1) % kOpen;
      close(g);
    } else {
      while (taken >> g & 1) ++g;
    }
    for (int k = 0; k < corners; ++k) {
      if (vertex[k] < num_vertices) groups_[vertex[k]] |= std::uint64_t{1} << g;
    }
    group[g][size[g]++] = row;
    if (size[g] == kLanes) close(g);
  }
  for (int g = 0; g < kOpen; ++g) {
    if (size[g] > 0) close(g);
  }
}

}  // namespace softgym_mj
