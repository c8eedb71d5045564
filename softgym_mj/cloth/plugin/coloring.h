// Puts rows in an order in which eight at a time have no vertex in common.

#ifndef SOFTGYM_MJ_CLOTH_COLORING_H_
#define SOFTGYM_MJ_CLOTH_COLORING_H_

#include <cstdint>
#include <vector>

namespace softgym_mj::cloth {

// Rows are taken in the order of a hash of their vertices; each comes to the first color on which it has no vertex in
// common with an earlier one. So a row more or less, far away, changes nothing here, as it would if rows were taken in
// the order in which they are found.
class Coloring {
 public:
  // `vertices` holds `corners` of each row; those v with !counts[v] may be shared. Fills `order` with the rows'
  // indices, color by color, and with -1 so that each color has a multiple of eight.
  void Order(const int* vertices, int rows, int corners, const std::uint8_t* counts, int num_vertices,
             std::vector<int>* order);

 private:
  static constexpr int kWords = 4;  // Of 64 colors; what finds none among them gets a color of its own.

  std::vector<std::uint64_t> keys_, sorted_, taken_;
  std::vector<int> color_, begin_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_COLORING_H_
