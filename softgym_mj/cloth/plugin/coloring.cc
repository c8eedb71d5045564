#include "cloth/plugin/coloring.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

constexpr size_t kFew = 300;  // Number of keys below which std::sort is faster.

// Sorts stably by the upper 32 bits.
void SortByHash(std::vector<std::uint64_t>* keys, std::vector<std::uint64_t>* other) {
  if (keys->size() < kFew) {
    std::sort(keys->begin(), keys->end());  // Keys are unique because their lower bits are.
    return;
  }
  constexpr int kBits = 11, kSize = 1 << kBits;
  other->resize(keys->size());
  for (int shift = 32; shift < 64; shift += kBits) {
    int place[kSize] = {}, sum = 0;
    for (std::uint64_t key : *keys) ++place[key >> shift & (kSize - 1)];
    for (int& p : place) sum += std::exchange(p, sum);
    for (std::uint64_t key : *keys) (*other)[place[key >> shift & (kSize - 1)]++] = key;
    std::swap(*keys, *other);
  }
}

}  // namespace

void Coloring::Order(const int* vertices, int rows, int corners, const std::uint8_t* counts, int num_vertices,
                     std::vector<int>* order) {
  keys_.resize(rows);
  for (int row = 0; row < rows; ++row) {
    keys_[row] = std::uint64_t{RowHash(vertices + corners * row, corners)} << 32 | static_cast<std::uint32_t>(row);
  }
  SortByHash(&keys_, &sorted_);
  taken_.assign(static_cast<size_t>(kWords) * num_vertices, 0);
  color_.resize(rows);
  begin_.assign(64 * kWords + 1, 0);
  int num_colors = 64 * kWords;
  for (std::uint64_t key : keys_) {
    const int row = static_cast<int>(key & 0xffffffffu);
    const int* vertex = vertices + corners * row;
    int color = -1;
    for (int word = 0; word < kWords && color < 0; ++word) {
      std::uint64_t taken = 0;
      for (int k = 0; k < corners; ++k) taken |= counts[vertex[k]] ? taken_[kWords * vertex[k] + word] : 0;
      if (~taken == 0) continue;
      color = 64 * word + __builtin_ctzll(~taken);
      const std::uint64_t bit = std::uint64_t{1} << (color % 64);
      for (int k = 0; k < corners; ++k) taken_[kWords * vertex[k] + word] |= bit;
    }
    if (color < 0) {
      color = num_colors++;
      begin_.push_back(0);
    }
    color_[row] = color;
    ++begin_[color];
  }
  int sum = 0;
  for (int& begin : begin_) {
    const int size = (begin + kBlock - 1) / kBlock * kBlock;
    begin = sum;
    sum += size;
  }
  order->assign(sum, -1);
  for (std::uint64_t key : keys_) {
    const int row = static_cast<int>(key & 0xffffffffu);
    (*order)[begin_[color_[row]]++] = row;
  }
}

}  // namespace softgym_mj::cloth
