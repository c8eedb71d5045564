// State that solids keep after a step: contacts for Python, and entry faces for the next step.

#include <algorithm>
#include <vector>

#include "cloth/plugin/method.h"
#include "cloth/plugin/solids.h"

namespace softgym_mj::cloth {

// Returns the entry face of a point; -1 if it was outside.
float Solids::SideOf(double key) const {
  const mjtNum* end = sides_ + kNumSides;
  const mjtNum* found = std::lower_bound(sides_, end, key * kFaces + 1);
  return found < end && *found < (key + 1) * kFaces ? static_cast<float>(*found - key * kFaces - 1) : -1;
}

// Stores key * kFaces + face + 1 for each point, sorted, with unused numbers (0) first.
void Solids::KeepSides(mjtNum* sides) const {
  std::vector<mjtNum> kept;
  for (const Active& active : actives_) {
    if (!active.small || active.view.shape != Shape::kBox) continue;
    for (size_t i = 0; i < active.point_order.size(); ++i) {
      const SolidBlock& block = active.point_blocks[i / kBlock];
      const int lane = i % kBlock, row = active.point_order[i];
      if (row < 0 || block.side[lane] < 0 || block.gap[lane] + block.radius[lane] > kRemembered) continue;
      kept.push_back(active.points[row].key * kFaces + block.side[lane] + 1);
    }
  }
  std::sort(kept.begin(), kept.end());
  if (kept.size() > kNumSides) kept.resize(kNumSides);
  std::fill(sides, sides + kNumSides, 0);
  std::copy(kept.begin(), kept.end(), sides + kNumSides - kept.size());
}

void Solids::Collect(int substeps) {
  contacts_.clear();
  const double share = 1 / (h_ * h_ * substeps);
  for (const Active& active : actives_) {
    for (const auto* blocks : {&active.point_blocks, &active.triangle_blocks}) {
      for (const SolidBlock& block : *blocks) {
        for (int lane = 0; lane < kBlock; ++lane) {
          if (!(block.pressed[lane] > 0)) continue;
          Contact contact = {};
          contact.geom = active.geom;
          contact.pressure = share * block.pressed[lane];
          for (int k = 0; k < 3; ++k) {
            contact.vertex[k] = block.vertex[k][lane];
            contact.weight[k] = block.weight[k][lane];
            contact.normal[k] = block.normal[k][lane];
            contact.force[k] = share * block.total[k][lane];
          }
          contacts_.push_back(contact);
        }
      }
    }
  }
}

}  // namespace softgym_mj::cloth
