// Removes a displacement of impact zones into a solid at one contact.

#ifndef SOFTGYM_MJ_CLOTH_LIFT_H_
#define SOFTGYM_MJ_CLOTH_LIFT_H_

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/meets.h"

namespace softgym_mj::cloth {
namespace {

constexpr int kLiftRounds = 10;  // Iterations, because vertices that share triangles are coupled.

// Weight of a vertex in a row; 0 if it is immovable.
inline double LiftWeight(const Points& points, const SolidBlock& block, int k, int lane) {
  return points.now[4 * block.vertex[k][lane] + 3] > 0 ? block.weight[k][lane] : 0;
}

// Changes displacements `move` [m] and velocities [m/s] of all vertices (n, 3).
inline void Lift(const Points& points, const SolidBlock& block, int lane, double* move, double* velocity) {
  double way = 0, squares = 0;
  for (int k = 0; k < 3; ++k) {
    const int v = block.vertex[k][lane];
    const double weight = LiftWeight(points, block, k, lane);
    squares += weight * weight;
    for (int c = 0; weight > 0 && c < 3; ++c) {
      way += weight * block.normal[c][lane] * (move[3 * v + c] - points.before[4 * v + c]);
    }
  }
  const double gap = block.gap[lane], deepest = gap < -kPressed ? -kPressed : gap;
  const double lift = (deepest > 0 ? 0 : deepest) - (gap + way);
  for (int k = 0; lift > 0 && k < 3; ++k) {
    const int v = block.vertex[k][lane];
    const double weight = LiftWeight(points, block, k, lane);
    if (!(weight > 0)) continue;
    double speed = 0;
    for (int c = 0; c < 3; ++c) speed += block.normal[c][lane] * velocity[3 * v + c];
    for (int c = 0; c < 3; ++c) {
      move[3 * v + c] += lift * weight / squares * block.normal[c][lane];
      velocity[3 * v + c] -= (speed < 0 ? speed : 0.0) * block.normal[c][lane];
    }
  }
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_LIFT_H_
