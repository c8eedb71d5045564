// Contact with grippers, spheres with prescribed motion, and other solids, as in `Solids`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_
#define SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_

#include "cloth/batch/bodies.h"
#include "cloth/batch/environment.h"
#include "cloth/batch/rows.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/near.h"
#include "cloth/plugin/solid_sweeps.h"

namespace softgym_mj::cloth {
namespace {

inline double Length(const double a[3]) { return std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]); }

// Whether no vertex can come near a solid, as in `Solids::Start`.
inline bool IsAway(const Environment& w, const double* center, double most) {
  for (int k = 0; k < 3; ++k) {
    if (center[k] + most < w.step->low[k] || center[k] - most > w.step->high[k]) return true;
  }
  return false;
}

// Entry face of the point of a key, from the sorted state; -1 if it was outside.
inline float SideOf(const double* sides, double key) {
  int first = 0;
  for (int size = kNumSides; size > 0;) {
    const int half = size / 2;
    const bool less = sides[first + half] < key * kFaces + 1;
    first += less ? half + 1 : 0;
    size = less ? size - half - 1 : half;
  }
  const bool found = first < kNumSides && sides[first] < (key + 1) * kFaces;
  return found ? static_cast<float>(sides[first] - key * kFaces - 1) : -1;
}

// Body of a gripper or solid; null if it is static.
inline Rigid* RigidOf(const Environment& w, const Solid& solid) {
  return kSolids && solid.is_static ? nullptr : &w.bodies[solid.body].rigid;
}

// Shape and pose of a gripper, which is a sphere, or of a solid.
inline Geom GeomOf(const Touch& touch) {
  Geom geom = touch.geom;
  if (!kSolids) geom.shape = Shape::kSphere;
  return geom;
}

// Fills blocks with empty rows of points or elements.
inline void FillBlocks(const Environment& w, const Touch& touch, bool elements, float friction) {
  const Model& m = *w.model;
  const Rows& rows = elements ? touch.triangles : touch.points;
  SolidBlock* blocks = elements ? touch.triangle_blocks : touch.point_blocks;
  const double radius = kSolids && touch.small && kThin < m.radius ? kThin : m.radius;
  Each(kBlock * rows.blocks, [&](int i) {
    SolidBlock& block = blocks[i / kBlock];
    const int lane = i % kBlock, row = rows.order[i], none = m.vertices;
    const bool fixed = row >= 0 && !elements;
    if (lane == 0) block.active = 1;
    block.side[lane] = kSolids && fixed && touch.small ? SideOf(w.sides, touch.key[row]) : -2;
    block.rope[lane] = row >= 0 && rows.vertex[3 * row + 2] == none;
    block.friction[lane] = row < 0 ? 0 : friction;
    block.radius[lane] = row < 0 ? -1e3f : static_cast<float>(radius);
    block.impulse[lane] = block.pressed[lane] = 0;
    for (int k = 0; k < 3; ++k) {
      block.vertex[k][lane] = row < 0 ? none : rows.vertex[3 * row + k];
      block.weight[k][lane] = kSolids && fixed && touch.fixed ? touch.weight[3 * row + k] : fixed && k == 0;
      block.held[k][lane] = block.total[k][lane] = block.arm[k][lane] = 0;
    }
  });
}

// Appends a row; `number`: its rank among rows with the same vertices.
inline int AddRow(const Environment& w, Rows* rows, int room, const int* vertex, int corners, int number) {
  const int n = Add(&rows->count, 1);
  if (n >= room) {
    SetBits(&w.step->flags, kRowsFull);
    return -1;
  }
  for (int k = 0; k < 3; ++k) rows->vertex[3 * n + k] = k < corners ? vertex[k] : w.model->vertices;
  rows->key[n] = RowKey(rows->vertex + 3 * n, 3, number);
  return n;
}

// Appends rows of fixed points of an element, or of a vertex, as `Solids::AddRows`.
inline void AddPoints(const Environment& w, const Solid& solid, const int* vertex, int corners, int element,
                      Touch* touch) {
  const Model& m = *w.model;
  const double elements = static_cast<double>(m.vertices + m.triangles + m.edges);
  int rank = 0;
  const auto add = [&](int place, int i, int j, float first, float second, float third) {
    const int number = (place * kMostPoints + i) * kMostPoints + j;
    const int row = AddRow(w, &touch->points, touch->room, vertex, corners, number);
    if (row < 0) return;
    touch->rank[row] = rank++;
    float* weight = touch->weight + 3 * row;
    weight[0] = first, weight[1] = second, weight[2] = third;
    touch->key[row] = ((solid.geom * elements + place) * kMostPoints + i) * kMostPoints + j;
  };
  if (corners == 1) return add(element, 0, 0, 1, 0, 0);
  const double count = std::ceil(m.At<double>(m.longest_at)[element] / kPointDistance);
  const int n = count < kMostPoints ? static_cast<int>(count) : kMostPoints;
  const float scale = 1.0f / n;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; i + j <= n; ++j) {
      const int k = n - i - j;
      if (i == n || j == n || k == n || (corners == 2 && k > 0)) continue;
      add(m.vertices + element, i, j, scale * i, scale * j, scale * k);
    }
  }
}

// Makes rows of vertices and elements that may touch a gripper or solid in the step.
inline void StartTouch(const Environment& w, int t) {
  const Model& m = *w.model;
  Touch* touch = w.touch + t;
  const Solid& solid = m.At<Solid>(m.solids_at)[t];
  const Mover& body = w.bodies[solid.body];
  const int own = kSolids ? t - m.grippers : -1;
  Once([&] {
    touch->geom.shape = solid.shape;
    if (HasGrid(touch->geom)) touch->geom.grid = m.At<Grid>(m.grids_at)[t];
    touch->small = !solid.is_static && body.rigid.is_pushable && solid.bound < kSmall;
    touch->fixed = touch->small || (own >= 0 && w.step->fastest >= kHasty);
    const double unturned[4] = {1, 0, 0, 0};
    Quat2Mat(own < 0 ? unturned : w.poses + 7 * own + 3, touch->matrix);
    for (int k = 0; k < 3; ++k) {
      const double place = own < 0 ? body.center[k] : w.poses[7 * own + k];
      touch->offset[k] = place - body.center[k];
      touch->geom.size[k] = solid.size[k];
      touch->geom.pose[k] = static_cast<float>(place);
    }
    for (int k = 0; k < 9; ++k) touch->geom.pose[3 + k] = static_cast<float>(touch->matrix[k]);
    touch->points.count = touch->triangles.count = touch->num_active = 0;
  });
  double velocity[6];
  for (int k = 0; k < 6; ++k) {
    const double of_gripper = k < 3 && own < 0 ? w.gripper_qvel[3 * solid.body + k] : 0;
    velocity[k] = own < 0 ? of_gripper : w.velocities[6 * own + k];
  }
  const double turning = Length(velocity + 3), speed = Length(velocity) + turning * solid.bound;
  const double margin =
      m.radius + kSolidMargin + (kSolids && solid.is_static ? 0 : m.timestep * (speed + kVelocityMargin));
  const float bound = static_cast<float>(solid.bound), reach = static_cast<float>(margin);
  const Geom geom = GeomOf(*touch);
  const auto add = [&](const int* vertex, int corners, int number) {
    if (!ComesNear(w.solid_position, vertex, corners, geom, bound, reach)) return;
    if (kSolids && touch->fixed) return AddPoints(w, solid, vertex, corners, number, touch);
    AddRow(w, corners == 1 ? &touch->points : &touch->triangles, m.vertices + m.triangles + m.edges, vertex, corners,
           number);
  };
  const bool touches = own < 0
                           ? solid.geom >= 0
                           : (w.touching[own] && !IsAway(w, w.poses + 7 * own, solid.bound + margin + w.step->fastest));
  Each(touches ? m.vertices : 0, [&](int v) { add(&v, 1, v); });
  if (m.is_surface) {
    Each(touches ? m.triangles : 0, [&](int i) { add(m.At<int>(m.triangle_vertex_at) + 3 * i, 3, i); });
  } else {
    Each(touches ? m.edges : 0, [&](int e) { add(m.At<int>(m.edge_vertex_at) + 2 * e, 2, e); });
  }
  Once([&] {
    if (touch->points.count > touch->room) touch->points.count = touch->room;
    touch->pushes = !solid.is_static && body.rigid.is_pushable && touch->points.count + touch->triangles.count > 0;
    w.step->touches_bodies |= touch->pushes;
    w.step->touches_light |= touch->pushes && body.inverse_mass > 1 / kLight;
    w.step->repeats = w.step->touches_bodies && m.sweeps > 1;
  });
  const auto counts = [&](int v) { return v < m.vertices; };
  ColorRows(w, 3, true, &touch->points, counts, kSolids && touch->fixed ? touch->rank : nullptr);
  ColorRows(w, 3, true, &touch->triangles, counts);
  FillBlocks(w, *touch, false, solid.friction);
  FillBlocks(w, *touch, true, solid.friction);
}

// Starts contact with grippers and solids.
SGM_APART void StartTouches(const Environment& w) {
  StartBodies(w);
  for (int t = 0; t < w.model->grippers + Solids(*w.model); ++t) StartTouch(w, t);
}

// Lists the active blocks of a body that gives way.
inline void ListActive(Touch* touch) {
  touch->num_active = 0;
  const auto list = [&](SolidBlock* blocks, int count) {
    for (int b = 0; b < count; ++b) {
      if (blocks[b].active) touch->active[touch->num_active++] = blocks + b;
    }
  };
  list(touch->point_blocks, touch->points.blocks);
  list(touch->triangle_blocks, touch->triangles.blocks);
}

// Updates rows.
SGM_APART void FindTouches(const Environment& w, int substeps) {
  const Model& m = *w.model;
  const Solid* solids = m.At<Solid>(m.solids_at);
  const int touches = m.grippers + Solids(m);
  Each(touches, [&](int t) {
    Touch& touch = w.touch[t];
    const Mover& body = w.bodies[solids[t].body];
    if (kSolids && solids[t].is_static) return;
    if (kSolids && t >= m.grippers) return PlaceGeom(body.center, body.so_far, touch.offset, touch.matrix, &touch.geom);
    for (int k = 0; k < 3; ++k) touch.geom.pose[k] = body.rigid.center[k];
  });
  const float left = static_cast<float>(substeps);
  for (int t = 0; t < touches; ++t) {
    const Touch& touch = w.touch[t];
    const Geom geom = GeomOf(touch);
    const Rigid* rigid = RigidOf(w, solids[t]);
    EachBlock(0, touch.points.blocks,
              [&](int b) { FindSolid(w.points, w.solid_position, geom, rigid, touch.point_blocks + b, false, left); });
    EachBlock(0, touch.triangles.blocks, [&](int b) {
      FindSolid(w.points, w.solid_position, geom, rigid, touch.triangle_blocks + b, true, left);
    });
  }
  Each(TouchesBodies(w) && substeps > 0 ? touches : 0, [&](int t) {
    const Rigid* rigid = RigidOf(w, solids[t]);
    if (rigid && rigid->is_pushable) ListActive(&w.touch[t]);
  });
}

// Makes the visits make(block, row, body) of all blocks that may touch, in the order of geoms. Those of bodies that
// give way follow each other, because they act on each other through their body.
template <class F>
inline void EachTouch(const Environment& w, F make) {
  static_assert(kGroups == 1 || !kSolids, "InSequence needs all threads of a block");
  const Model& m = *w.model;
  for (int i = 0; i < m.grippers + Solids(m); ++i) {
    const int t = kSolids ? m.At<int>(m.order_at)[i] : i;
    const Touch& touch = w.touch[t];
    Rigid* rigid = RigidOf(w, m.At<Solid>(m.solids_at)[t]);
    if (kSolids && rigid && rigid->is_pushable) {
      if (touch.num_active == 0) continue;
      InSequence(touch.num_active, [&](int b) { return make(touch.active[b], m.contact, rigid); });
      continue;
    }
    const auto visit = [&](SolidBlock* block) {
      if (block->active) MakeVisit(make(block, rigid ? m.solid_row : m.contact, rigid));
    };
    EachColor(touch.points, [&](int b) { visit(touch.point_blocks + b); });
    EachColor(touch.triangles, [&](int b) { visit(touch.triangle_blocks + b); });
  }
  ShareImpulses(w);
}

inline void SweepTouches(const Environment& w, SweepPass pass) {
  EachTouch(w, [&](SolidBlock* block, const ContactRow& row, Rigid* rigid) {
    return SolidSweep(w.points, row, block, rigid, pass);
  });
}

inline void WarmTouches(const Environment& w) {
  EachTouch(w, [&](SolidBlock* block, const ContactRow&, Rigid* rigid) {
    return SolidWarmStart(w.points, block, rigid, kWarm);
  });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_TOUCH_H_
