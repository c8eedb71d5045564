// Contact with grippers, spheres with prescribed motion, as in `Solids`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_
#define SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_

#include "cloth/batch/environment.h"
#include "cloth/batch/rows.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/near.h"
#include "cloth/plugin/solid_sweeps.h"

namespace softgym_mj::cloth {
namespace {

// Fills blocks with empty rows of vertices or elements.
inline void FillBlocks(const Environment& w, const Rows& rows, bool elements, SolidBlock* blocks) {
  const Model& m = *w.model;
  Each(kBlock * rows.blocks, [&](int i) {
    SolidBlock& block = blocks[i / kBlock];
    const int lane = i % kBlock, row = rows.order[i], none = m.vertices;
    if (lane == 0) block.active = 1;
    block.side[lane] = -2;
    block.rope[lane] = row >= 0 && rows.vertex[3 * row + 2] == none;
    block.friction[lane] = row < 0 ? 0 : m.gripper_friction;
    block.radius[lane] = row < 0 ? -1e3f : static_cast<float>(m.radius);
    block.impulse[lane] = block.pressed[lane] = 0;
    for (int k = 0; k < 3; ++k) {
      block.vertex[k][lane] = row < 0 ? none : rows.vertex[3 * row + k];
      block.weight[k][lane] = row >= 0 && !elements && k == 0 ? 1 : 0;
      block.held[k][lane] = block.total[k][lane] = block.arm[k][lane] = 0;
    }
  });
}

// Makes rows of vertices and elements that may touch a gripper in the step.
inline void StartTouch(const Environment& w, int gripper) {
  const Model& m = *w.model;
  Touch* touch = w.touch + gripper;
  const double* velocity = w.gripper_qvel + 3 * gripper;
  const double dt = m.timestep;
  Once([&] {
    touch->geom.shape = Shape::kSphere;
    touch->rigid.gives_way = false;
    for (int k = 0; k < 3; ++k) {
      touch->center[k] = w.gripper_qpos[3 * gripper + k];
      touch->shift[k] = 0;
      touch->geom.size[k] = k == 0 ? m.gripper_radius : 0;
      touch->geom.pose[k] = static_cast<float>(touch->center[k]);
      for (int c = 0; c < 3; ++c) touch->geom.pose[3 + 3 * k + c] = k == c;
    }
    for (int k = 0; k < 6; ++k) {
      touch->rigid.move[k] = k < 3 ? m.h * velocity[k] : 0;
      touch->rigid.impulse[k] = 0;
      for (int c = 0; c < 6; ++c) touch->rigid.compliance[k][c] = 0;
    }
    touch->points.count = touch->triangles.count = 0;
  });
  const double speed = std::sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2]);
  const float margin = static_cast<float>(m.radius + kSolidMargin + dt * (speed + kVelocityMargin));
  const auto add = [&](Rows* rows, const int* vertex, int corners, int number) {
    if (!ComesNear(w.solid_position, vertex, corners, touch->geom, m.gripper_radius, margin)) return;
    const int n = Add(&rows->count, 1);
    for (int k = 0; k < 3; ++k) rows->vertex[3 * n + k] = k < corners ? vertex[k] : m.vertices;
    rows->key[n] = RowKey(rows->vertex + 3 * n, 3, number);
  };
  Each(m.vertices, [&](int v) { add(&touch->points, &v, 1, v); });
  if (m.is_surface) {
    Each(m.triangles, [&](int t) { add(&touch->triangles, m.At<int>(m.triangle_vertex_at) + 3 * t, 3, t); });
  } else {
    Each(m.edges, [&](int e) { add(&touch->triangles, m.At<int>(m.edge_vertex_at) + 2 * e, 2, e); });
  }
  const auto counts = [&](int v) { return v < m.vertices; };
  ColorRows(w, 3, true, &touch->points, counts);
  ColorRows(w, 3, true, &touch->triangles, counts);
  FillBlocks(w, touch->points, false, touch->point_blocks);
  FillBlocks(w, touch->triangles, true, touch->triangle_blocks);
}

inline void FindTouch(const Environment& w, Touch* touch, int substeps) {
  Once([&] {
    for (int k = 0; k < 3; ++k) {
      touch->geom.pose[k] = static_cast<float>(touch->center[k] + touch->shift[k]);
      touch->rigid.center[k] = touch->geom.pose[k];
    }
  });
  const float left = static_cast<float>(substeps);
  EachBlock(0, touch->points.blocks, [&](int b) {
    FindSolid(w.points, w.solid_position, touch->geom, &touch->rigid, touch->point_blocks + b, false, left);
  });
  EachBlock(0, touch->triangles.blocks, [&](int b) {
    FindSolid(w.points, w.solid_position, touch->geom, &touch->rigid, touch->triangle_blocks + b, true, left);
  });
}

inline void SweepTouch(const Environment& w, Touch* touch) {
  const ContactRow& row = w.model->gripper_row;
  EachColor(touch->points,
            [&](int b) { SweepSolid(w.points, row, touch->point_blocks + b, &touch->rigid, {true, true}); });
  EachColor(touch->triangles,
            [&](int b) { SweepSolid(w.points, row, touch->triangle_blocks + b, &touch->rigid, {true, true}); });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_
