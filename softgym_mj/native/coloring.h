// Puts rows in an order in which eight at a time have no vertex in common.

#ifndef SOFTGYM_MJ_NATIVE_COLORING_H_
#define SOFTGYM_MJ_NATIVE_COLORING_H_

#include <cstdint>
#include <vector>

namespace softgym_mj {

class Coloring {
 public:
  // `vertices` holds `corners` of each row; those from `num_vertices` on stand for none. Fills `order` with
  // the rows' indices, and -1 where fewer than eight go together.
  void Order(const std::vector<int>& vertices, int corners, int num_vertices, std::vector<int>* order);

 private:
  std::vector<std::uint64_t> groups_;  // Of each vertex: the open groups it occurs in, as bits.
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_COLORING_H_
