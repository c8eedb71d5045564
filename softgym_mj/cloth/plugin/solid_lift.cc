// Removes displacements of impact zones into solids.

#include <algorithm>

#include "cloth/plugin/solids.h"

namespace softgym_mj::cloth {
namespace {

constexpr int kRounds = 10;  // Iterations, because vertices that share triangles are coupled.

// Weight of a vertex in a row; 0 if it is immovable.
double Weight(const Points& points, const SolidBlock& block, int k, int lane) {
  return points.now[4 * block.vertex[k][lane] + 3] > 0 ? block.weight[k][lane] : 0;
}

void Lift(const Points& points, const SolidBlock& block, int lane, Motion* motion) {
  double way = 0, squares = 0;
  for (int k = 0; k < 3; ++k) {
    const int v = block.vertex[k][lane];
    const double weight = Weight(points, block, k, lane);
    squares += weight * weight;
    for (int c = 0; weight > 0 && c < 3; ++c) {
      way += weight * block.normal[c][lane] * (motion->move[3 * v + c] - points.before[4 * v + c]);
    }
  }
  const double gap = block.gap[lane], lift = std::clamp(gap, -kPressed, 0.0) - (gap + way);
  for (int k = 0; lift > 0 && k < 3; ++k) {
    const int v = block.vertex[k][lane];
    const double weight = Weight(points, block, k, lane);
    if (!(weight > 0)) continue;
    double speed = 0;
    for (int c = 0; c < 3; ++c) speed += block.normal[c][lane] * motion->velocity[3 * v + c];
    for (int c = 0; c < 3; ++c) {
      motion->move[3 * v + c] += lift * weight / squares * block.normal[c][lane];
      motion->velocity[3 * v + c] -= std::min(speed, 0.0) * block.normal[c][lane];
    }
  }
}

}  // namespace

void Solids::LiftOut(const Points& points, Motion* motion) const {
  for (int round = 0; round < kRounds; ++round) {
    for (const Active& active : actives_) {
      if (active.body >= 0) continue;  // Dynamic bodies are skipped: between two bodies there may be no room.
      for (const auto* blocks : {&active.point_blocks, &active.triangle_blocks}) {
        for (const SolidBlock& block : *blocks) {
          for (int lane = 0; block.active && lane < kBlock; ++lane) Lift(points, block, lane, motion);
        }
      }
    }
  }
}

}  // namespace softgym_mj::cloth
