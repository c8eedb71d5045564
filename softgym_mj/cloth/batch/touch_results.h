// Results of contact with solids at the end of a step: entry faces, pushed vertices and forces.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_TOUCH_RESULTS_H_
#define SOFTGYM_MJ_CLOTH_BATCH_TOUCH_RESULTS_H_

#include "cloth/batch/environment.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

// Stores the entry faces of points inside small solids, as `Solids::KeepSides`.
inline void KeepSides(const Environment& w) {
  const Model& m = *w.model;
  if (Solids(m) == 0) return;
  Once([&] { w.step->num_sides = 0; });
  for (int t = m.grippers; t < m.grippers + Solids(m); ++t) {
    const Touch& touch = w.touch[t];
    const bool counts = touch.small && touch.geom.shape == Shape::kBox;
    Each(counts ? kBlock * touch.points.blocks : 0, [&](int i) {
      const SolidBlock& block = touch.point_blocks[i / kBlock];
      const int lane = i % kBlock, row = touch.points.order[i];
      if (row < 0 || block.side[lane] < 0 || block.gap[lane] + block.radius[lane] > kRemembered) return;
      w.found_sides[Add(&w.step->num_sides, 1)] = touch.key[row] * kFaces + block.side[lane] + 1;
    });
  }
  const int found = w.step->num_sides, kept = found < kNumSides ? found : kNumSides;
  Each(kNumSides, [&](int i) { w.sides[i] = 0; });
  Each(found, [&](int i) {
    int rank = 0;
    for (int j = 0; j < found; ++j) rank += w.found_sides[j] < w.found_sides[i];
    if (rank < kept) w.sides[kNumSides - kept + rank] = w.found_sides[i];
  });
}

// Writes for each vertex of the elements that a solid pressed on last the least component of the contact normals along
// the solid's y axis.
inline void FindPushes(const Environment& w) {
  const Model& m = *w.model;
  if (!w.pushes) return;
  Each(Solids(m) * w.pushed, [&](int i) { w.pushes[i] = 0; });
  Each(Solids(m), [&](int s) {
    const Touch& touch = w.touch[m.grippers + s];
    const double* q = w.poses + 7 * s + 3;
    const double axis[3] = {2 * (q[1] * q[2] - q[0] * q[3]), 1 - 2 * (q[1] * q[1] + q[3] * q[3]),
                            2 * (q[2] * q[3] + q[0] * q[1])};
    const auto note = [&](const Rows& rows, const SolidBlock* blocks) {
      for (int i = 0; i < kBlock * rows.blocks; ++i) {
        const SolidBlock& block = blocks[i / kBlock];
        const int lane = i % kBlock;
        if (!(block.pressed[lane] > 0)) continue;
        double along = 0;
        for (int k = 0; k < 3; ++k) along += axis[k] * block.normal[k][lane];
        for (int k = 0; k < 3; ++k) {
          const int v = block.vertex[k][lane];
          if (v >= m.vertices) continue;
          double* least = w.pushes + s * w.pushed + v;
          *least = along < *least ? along : *least;
        }
      }
    };
    note(touch.points, touch.point_blocks);
    note(touch.triangles, touch.triangle_blocks);
  });
}

// Writes mean forces of the flex on solids in the step, and torques about the centers of mass of their bodies.
inline void SumForces(const Environment& w) {
  const Model& m = *w.model;
  const double share = 1 / (m.h * m.h * m.substeps);
  Each(Solids(m), [&](int s) {
    const Touch& touch = w.touch[m.grippers + s];
    double* sum = w.solid_forces + 6 * s;
    for (int k = 0; k < 6; ++k) sum[k] = 0;
    const auto add = [&](const Rows& rows, const SolidBlock* blocks) {
      for (int i = 0; i < kBlock * rows.blocks; ++i) {
        const SolidBlock& block = blocks[i / kBlock];
        const int lane = i % kBlock;
        if (!(block.pressed[lane] > 0)) continue;
        double force[3], arm[3];
        for (int k = 0; k < 3; ++k) force[k] = -share * block.total[k][lane], arm[k] = block.arm[k][lane];
        for (int k = 0; k < 3; ++k) {
          const int next = (k + 1) % 3, last = (k + 2) % 3;
          sum[k] += force[k];
          sum[3 + k] += arm[next] * force[last] - arm[last] * force[next];
        }
      }
    };
    add(touch.points, touch.point_blocks);
    add(touch.triangles, touch.triangle_blocks);
  });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_TOUCH_RESULTS_H_
