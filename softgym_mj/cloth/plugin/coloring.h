// Graph coloring of rows: eight consecutive rows have no vertex in common.

#ifndef SOFTGYM_MJ_CLOTH_COLORING_H_
#define SOFTGYM_MJ_CLOTH_COLORING_H_

#include <cstdint>
#include <vector>

namespace softgym_mj::cloth {

// Greedy coloring in the order of a hash of the rows' vertices: each row gets the first color in which it shares no
// vertex with an earlier one. Thus adding or removing a distant row does not change the order of others, as it would
// with the order in which rows are found.
class Coloring {
 public:
  // `vertices` holds `corners` vertices per row; vertices v with !counts[v] may be shared. Fills `order` with the
  // indices of rows, color by color, padded with -1 to a multiple of eight per color.
  void Order(const int* vertices, int rows, int corners, const std::uint8_t* counts, int num_vertices,
             std::vector<int>* order);

 private:
  static constexpr int kWords = 4;  // Words of 64 colors; a row that fits none of these gets its own color.

  std::vector<std::uint64_t> keys_, sorted_, taken_;
  std::vector<int> color_, begin_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_COLORING_H_
