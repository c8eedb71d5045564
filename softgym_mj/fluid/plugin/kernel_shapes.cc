#include "kernel_shapes.h"

#include <algorithm>
#include <cmath>

namespace softgym_mj {

const std::vector<KernelShape>& KernelShapes::Find(const std::vector<double>& centers, double spacing) {
  const double side = kNear * spacing;
  const int count = static_cast<int>(centers.size() / 3);
  const auto cell = [side](double x) { return static_cast<long long>(std::floor(x / side)); };
  cells_.clear();
  for (int i = 0; i < count; ++i) {
    const double* x = &centers[3 * i];
    cells_.emplace_back(CellKey(cell(x[0]), cell(x[1]), cell(x[2])), i);
  }
  std::sort(cells_.begin(), cells_.end());
  shapes_.resize(count);
  for (auto first = cells_.begin(), last = first; first != cells_.end(); first = last) {
    while (last != cells_.end() && last->first == first->first) ++last;
    const double* own = &centers[3 * first->second];
    near_.clear();
    for (int k = 0; k < 27; ++k) {
      const auto key = CellKey(cell(own[0]) + k % 3 - 1, cell(own[1]) + k / 3 % 3 - 1, cell(own[2]) + k / 9 - 1);
      auto entry = std::lower_bound(cells_.begin(), cells_.end(), std::make_pair(key, 0));
      for (int n = 0; n < kMostInCell && entry != cells_.end() && entry->first == key; ++n, ++entry) {
        near_.push_back(FromArray(&centers[3 * entry->second]));
      }
    }
    for (auto entry = first; entry != last; ++entry) {
      const Vector center = FromArray(&centers[3 * entry->second]);
      offsets_.clear();
      for (const Vector& other : near_) {
        const Vector d = other - center;
        const double squared = Dot(d, d);
        if (squared > 0 && squared < side * side) offsets_.push_back(d);
      }
      shapes_[entry->second] = FitKernel(center, spacing, [&](const auto& f) {
        for (const Vector& d : offsets_) f(d);
      });
    }
  }
  return shapes_;
}

}  // namespace softgym_mj
