// Contact with grippers, spheres with prescribed motion, and other solids with prescribed motion, as in `Solids`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_
#define SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_

#include "cloth/batch/environment.h"
#include "cloth/batch/rows.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/near.h"
#include "cloth/plugin/solid_sweeps.h"

namespace softgym_mj::cloth {
namespace {

inline double Length(const double a[3]) { return std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]); }

// Starts the bodies of grippers and solids.
inline void StartBodies(const Environment& w) {
  const Model& m = *w.model;
  const Solid* solids = m.At<Solid>(m.solids_at);
  Each(m.bodies, [&](int b) {
    Mover& body = w.bodies[b];
    const int first = m.At<int>(m.first_solids_at)[b], own = first - m.grippers;
    double center[3] = {0, 0, 0};
    if (own >= 0) RotVecQuat(solids[first].center, w.poses + 7 * own + 3, center);
    for (int k = 0; k < 3; ++k) {
      body.center[k] = own < 0 ? w.gripper_qpos[3 * b + k] : w.poses[7 * own + k] + center[k];
      body.so_far.shift[k] = 0;
    }
    for (int k = 0; k < 4; ++k) body.so_far.turn[k] = k == 0;
    body.rigid.gives_way = false;
    for (int k = 0; k < 6; ++k) {
      const double of_gripper = k < 3 && own < 0 ? w.gripper_qvel[3 * b + k] : 0;
      body.rigid.move[k] = m.h * (own < 0 ? of_gripper : w.velocities[6 * own + k]);
      body.acceleration[k] = own < 0 ? 0 : w.accelerations[6 * own + k];
      for (int c = 0; c < 6; ++c) body.rigid.compliance[k][c] = 0;
    }
  });
}

// Fills blocks with empty rows of vertices or elements.
inline void FillBlocks(const Environment& w, const Rows& rows, bool elements, float friction, SolidBlock* blocks) {
  const Model& m = *w.model;
  Each(kBlock * rows.blocks, [&](int i) {
    SolidBlock& block = blocks[i / kBlock];
    const int lane = i % kBlock, row = rows.order[i], none = m.vertices;
    if (lane == 0) block.active = 1;
    block.side[lane] = -2;
    block.rope[lane] = row >= 0 && rows.vertex[3 * row + 2] == none;
    block.friction[lane] = row < 0 ? 0 : friction;
    block.radius[lane] = row < 0 ? -1e3f : static_cast<float>(m.radius);
    block.impulse[lane] = block.pressed[lane] = 0;
    for (int k = 0; k < 3; ++k) {
      block.vertex[k][lane] = row < 0 ? none : rows.vertex[3 * row + k];
      block.weight[k][lane] = row >= 0 && !elements && k == 0 ? 1 : 0;
      block.held[k][lane] = block.total[k][lane] = block.arm[k][lane] = 0;
    }
  });
}

// Makes rows of vertices and elements that may touch a gripper or solid in the step.
inline void StartTouch(const Environment& w, int t) {
  const Model& m = *w.model;
  Touch* touch = w.touch + t;
  const Solid& solid = m.At<Solid>(m.solids_at)[t];
  const Mover& body = w.bodies[solid.body];
  const int own = t - m.grippers;
  Once([&] {
    touch->geom.shape = solid.shape;
    const double unturned[4] = {1, 0, 0, 0};
    Quat2Mat(own < 0 ? unturned : w.poses + 7 * own + 3, touch->matrix);
    for (int k = 0; k < 3; ++k) {
      const double place = own < 0 ? body.center[k] : w.poses[7 * own + k];
      touch->offset[k] = place - body.center[k];
      touch->geom.size[k] = solid.size[k];
      touch->geom.pose[k] = static_cast<float>(place);
    }
    for (int k = 0; k < 9; ++k) touch->geom.pose[3 + k] = static_cast<float>(touch->matrix[k]);
    touch->points.count = touch->triangles.count = 0;
  });
  double velocity[6];
  for (int k = 0; k < 6; ++k) {
    const double of_gripper = k < 3 && own < 0 ? w.gripper_qvel[3 * solid.body + k] : 0;
    velocity[k] = own < 0 ? of_gripper : w.velocities[6 * own + k];
  }
  const double turning = Length(velocity + 3), speed = Length(velocity) + turning * solid.bound;
  const float margin = static_cast<float>(m.radius + kSolidMargin + m.timestep * (speed + kVelocityMargin));
  const float bound = static_cast<float>(solid.bound);
  const auto add = [&](Rows* rows, const int* vertex, int corners, int number) {
    if (!ComesNear(w.solid_position, vertex, corners, touch->geom, bound, margin)) return;
    const int n = Add(&rows->count, 1);
    for (int k = 0; k < 3; ++k) rows->vertex[3 * n + k] = k < corners ? vertex[k] : m.vertices;
    rows->key[n] = RowKey(rows->vertex + 3 * n, 3, number);
  };
  const bool touches = own < 0 || w.touching[own];
  Each(touches ? m.vertices : 0, [&](int v) { add(&touch->points, &v, 1, v); });
  if (m.is_surface) {
    Each(touches ? m.triangles : 0,
         [&](int i) { add(&touch->triangles, m.At<int>(m.triangle_vertex_at) + 3 * i, 3, i); });
  } else {
    Each(touches ? m.edges : 0, [&](int e) { add(&touch->triangles, m.At<int>(m.edge_vertex_at) + 2 * e, 2, e); });
  }
  const auto counts = [&](int v) { return v < m.vertices; };
  ColorRows(w, 3, true, &touch->points, counts);
  ColorRows(w, 3, true, &touch->triangles, counts);
  FillBlocks(w, touch->points, false, solid.friction, touch->point_blocks);
  FillBlocks(w, touch->triangles, true, solid.friction, touch->triangle_blocks);
}

// Starts contact with grippers and solids.
inline void StartTouches(const Environment& w) {
  StartBodies(w);
  for (int t = 0; t < w.model->grippers + w.model->solids; ++t) StartTouch(w, t);
}

// Moves bodies by a substep without contact, and updates rows.
inline void FindTouches(const Environment& w, int substeps) {
  const Model& m = *w.model;
  const Solid* solids = m.At<Solid>(m.solids_at);
  const int touches = m.grippers + m.solids;
  Each(m.bodies, [&](int b) {
    Mover& body = w.bodies[b];
    MoveRigid(body.center, body.so_far, body.acceleration, m.h, &body.rigid);
  });
  Each(touches, [&](int t) {
    Touch& touch = w.touch[t];
    const Mover& body = w.bodies[solids[t].body];
    if (t >= m.grippers) return PlaceGeom(body.center, body.so_far, touch.offset, touch.matrix, &touch.geom);
    for (int k = 0; k < 3; ++k) touch.geom.pose[k] = body.rigid.center[k];
  });
  const float left = static_cast<float>(substeps);
  for (int t = 0; t < touches; ++t) {
    const Touch& touch = w.touch[t];
    const Rigid* rigid = &w.bodies[solids[t].body].rigid;
    EachBlock(0, touch.points.blocks, [&](int b) {
      FindSolid(w.points, w.solid_position, touch.geom, rigid, touch.point_blocks + b, false, left);
    });
    EachBlock(0, touch.triangles.blocks, [&](int b) {
      FindSolid(w.points, w.solid_position, touch.geom, rigid, touch.triangle_blocks + b, true, left);
    });
  }
}

inline void SweepTouches(const Environment& w) {
  const Model& m = *w.model;
  for (int t = 0; t < m.grippers + m.solids; ++t) {
    const Touch& touch = w.touch[t];
    Rigid* rigid = &w.bodies[m.At<Solid>(m.solids_at)[t].body].rigid;
    EachColor(touch.points,
              [&](int b) { SweepSolid(w.points, m.solid_row, touch.point_blocks + b, rigid, {true, true}); });
    EachColor(touch.triangles,
              [&](int b) { SweepSolid(w.points, m.solid_row, touch.triangle_blocks + b, rigid, {true, true}); });
  }
}

// Ends a substep.
inline void FinishBodies(const Environment& w) {
  Each(w.model->bodies, [&](int b) { FinishRigid(w.bodies[b].rigid, &w.bodies[b].so_far); });
}

// Writes mean forces of the flex on solids in the step, and torques about the centers of mass of their bodies.
inline void SumForces(const Environment& w) {
  const Model& m = *w.model;
  const double share = 1 / (m.h * m.h * m.substeps);
  Each(m.solids, [&](int s) {
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

#endif  // SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_
