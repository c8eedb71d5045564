#include "cloth/plugin/impact_zones.h"

#include <algorithm>
#include <numeric>

#include "cloth/plugin/meets.h"

namespace softgym_mj::cloth {
namespace {

int Root(std::vector<int>* parent, int v) {
  while ((*parent)[v] != v) v = (*parent)[v] = (*parent)[(*parent)[v]];
  return v;
}

}  // namespace

bool ImpactZones::AreOne(const Pair& pair) {
  bool one = !zone_.empty();
  for (int k = 1; one && k < 4; ++k) one = Root(&zone_, pair.vertex[0]) == Root(&zone_, pair.vertex[k]);
  return one;
}

int ImpactZones::Prevent(const ClothKernels& kernels, const std::vector<Pair>& pairs, Zones zones, Motion* motion) {
  const int count = static_cast<int>(motion->mass.size());
  zone_.clear();
  near_.resize(pairs.size());
  move_.resize(4 * count);
  int changed = 0;
  for (int round = 0; round < kMaxRounds; ++round) {
    for (int v = 0; v < count; ++v) {
      for (int k = 0; k < 3; ++k) move_[4 * v + k] = static_cast<float>(motion->move[3 * v + k]);
    }
    // A plane perpendicular to the normal, between the closest points, separates all other pairs.
    const int approaching =
        kernels.FindApproaching(move_.data(), pairs.data(), static_cast<int>(pairs.size()), 1 - kNearest, near_.data());
    bool found = false;
    for (int i = 0; i < approaching; ++i) {
      const Pair& pair = pairs[near_[i]];
      if (pair.distance < kPast || AreOne(pair) || !Meets(pair, motion->start, motion->move.data())) continue;
      if (zone_.empty()) {
        zone_.resize(count);
        std::iota(zone_.begin(), zone_.end(), 0);
      }
      found = true;
      for (int k = 1; k < 4; ++k) {
        const int a = Root(&zone_, pair.vertex[0]), b = Root(&zone_, pair.vertex[k]);
        zone_[std::max(a, b)] = std::min(a, b);
      }
    }
    if (!found) break;
    // Mass, displacement and velocity times mass, number of vertices.
    sum_.assign(8 * count, 0);
    for (int v = 0; v < count; ++v) {
      double* s = &sum_[8 * Root(&zone_, v)];
      s[0] += motion->mass[v];
      s[7] += 1;
      for (int k = 0; k < 3; ++k) {
        s[1 + k] += motion->mass[v] * motion->move[3 * v + k];
        s[4 + k] += motion->mass[v] * motion->velocity[3 * v + k];
      }
    }
    changed = 0;
    for (int v = 0; v < count; ++v) {
      const double* s = &sum_[8 * Root(&zone_, v)];
      if (s[7] == 1) continue;
      ++changed;
      const double share = zones == Zones::kMove || s[0] > kImmovable ? 1 / s[0] : 0;
      for (int k = 0; k < 3; ++k) {
        motion->move[3 * v + k] = share * s[1 + k];
        motion->velocity[3 * v + k] = share * s[4 + k];
      }
    }
  }
  return changed;
}

}  // namespace softgym_mj::cloth
