// Rows of vertices, triangles and ropes against rigid shapes, under the restrictions of native/simd.h.

#ifndef SOFTGYM_MJ_CLOTH_SOLID_SWEEPS_H_
#define SOFTGYM_MJ_CLOTH_SOLID_SWEEPS_H_

#include "cloth/plugin/grids.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/search.h"
#include "cloth/plugin/solid_push.h"
#include "cloth/plugin/sweeps.h"
#include "native/shapes.h"
#include "native/simd.h"

namespace softgym_mj::cloth {
namespace {

constexpr int kFrankWolfe = 12;  // Iterations to find the point of a triangle nearest to a shape.
// If a corner's weight in the nearest point exceeds this, the row of the vertex handles the contact.
constexpr float kCorner = 0.97f;
constexpr float kNowhere = 1e3f;  // [m] A gap that never closes.
constexpr float kNear = 5e-4f;    // [m] Rows with smaller gaps are always active.

// Face of a box, 2 axis + (0 low, 1 high), with the largest signed distance to a point.
inline Lanes FaceOf(const float* half, const Lanes3& p) {
  const Lanes zero(0.0f), one(1.0f), two(2.0f);
  const Lanes x = Abs(p.x) - Lanes(half[0]), y = Abs(p.y) - Lanes(half[1]), z = Abs(p.z) - Lanes(half[2]);
  const Mask is_x = LessEqual(y, x) & LessEqual(z, x), is_y = LessEqual(z, y);
  const Lanes axis = Select(is_x, zero, Select(is_y, one, two));
  const Lanes along = Select(is_x, p.x, Select(is_y, p.y, p.z));
  return MultiplyAdd(two, axis, Select(Less(zero, along), one, zero));
}

// Signed distance and outward normal in the frame of the shape. A point inside a box uses its entry face until it is
// outside again: the nearest face would push it through thin boxes.
inline Lanes SidedDistance(const Geom& geom, const Lanes3& p, float* side, Lanes3* normal) {
  Lanes distance = GeomDistance(geom, p, normal);
  const Lanes zero(0.0f), old = Lanes::Load(side);
  const Mask sided = LessEqual(Lanes(-1.0f), old);
  if (geom.shape != Shape::kBox || !Bits(sided)) return distance;
  const Mask inside = Less(distance, zero);
  const Lanes now = Select((sided & LessEqual(zero, distance)) | Equal(old, Lanes(-1.0f)), FaceOf(geom.size, p), old);
  now.Store(side);
  if (!Bits(inside)) return distance;
  const Lanes* coordinate[3] = {&p.x, &p.y, &p.z};
  for (int face = 0; face < 6; ++face) {
    const Mask on = inside & Equal(now, Lanes(static_cast<float>(face)));
    if (!Bits(on)) continue;
    const Lanes sign(face % 2 ? 1.0f : -1.0f);
    distance = Select(on, sign * *coordinate[face / 2] - Lanes(geom.size[face / 2]), distance);
    normal->x = Select(on, face / 2 == 0 ? sign : zero, normal->x);
    normal->y = Select(on, face / 2 == 1 ? sign : zero, normal->y);
    normal->z = Select(on, face / 2 == 2 ? sign : zero, normal->z);
  }
  return distance;
}

// Finds the weights of the point of a triangle nearest to the shape (Frank and Wolfe, 1956).
inline void Approach(const Geom& geom, const Lanes3 corner[3], Lanes weight[3]) {
  if (geom.shape == Shape::kSphere) {
    const Lanes3 center = {Lanes(0.0f), Lanes(0.0f), Lanes(0.0f)};
    return ClosestOnTriangle(center, corner[0], corner[1], corner[2], weight);
  }
  const Lanes tie(HasGrid(geom) ? kTie : 0.0f);
  for (int k = 0; k < 3; ++k) weight[k] = Lanes(1.0f / 3);
  for (int i = 0; i < kFrankWolfe; ++i) {
    Lanes3 point = weight[0] * corner[0], normal;
    point = AddScaled(AddScaled(point, weight[1], corner[1]), weight[2], corner[2]);
    GeomDistance(geom, point, &normal);
    const Lanes a = Inner(normal, corner[0]), b = Inner(normal, corner[1]), c = Inner(normal, corner[2]);
    const Mask first = LessEqual(a, b + tie) & LessEqual(a, c + tie), second = LessEqual(b, c + tie);
    const Lanes step(2.0f / (i + 3)), zero(0.0f), one(1.0f);
    const Lanes to_a = Select(first, one, zero), to_b = Select(first, zero, Select(second, one, zero));
    weight[0] = MultiplyAdd(step, to_a - weight[0], weight[0]);
    weight[1] = MultiplyAdd(step, to_b - weight[1], weight[1]);
    weight[2] = one - weight[0] - weight[1];
  }
}

// Whether a row of the block may touch before the next search, even at twice the current closing speed.
inline bool MayClose(const Points& points, const SolidBlock& block, const Rigid* body, float substeps) {
  const Lanes zero(0.0f);
  Lanes3 moved = {zero, zero, zero};
  for (int k = 0; k < 3; ++k) {
    Lanes unused;
    const int* vertex = block.vertex[k];
    moved = AddScaled(moved, Lanes::Load(block.weight[k]),
                      Gather(points.now, vertex, &unused) - Gather(points.before, vertex, &unused));
  }
  const Lanes3 normal = Load3(block.normal);
  Lanes closing = -Inner(normal, moved);
  if (body) {
    float speed = 0;
    for (int i = 0; i < 3; ++i) speed += static_cast<float>(body->move[i] * body->move[i]);
    float turning = 0;
    for (int i = 3; i < 6; ++i) turning += static_cast<float>(body->move[i] * body->move[i]);
    const Lanes3 arm = Load3(block.arm);
    closing = closing + Lanes(sqrtf(speed)) + Lanes(sqrtf(turning)) * Sqrt(Inner(arm, arm));
  }
  const Lanes reach = MultiplyAdd(Lanes(2 * substeps), Max(closing, zero), Lanes(kNear));
  return Bits(Less(Lanes::Load(block.gap), reach)) != 0;
}

inline void FindSolid(const Points& points, const float* start, const Geom& geom, const Rigid* body, SolidBlock* block,
                      bool nearest, float substeps) {
  const bool search = nearest && substeps > 0;
  if (substeps == 0 && !block->active) return;
  Lanes weight[3], w[3], unused;
  Lanes3 world[3], corner[3];
  for (int k = 0; k < 3; ++k) {
    weight[k] = Lanes::Load(block->weight[k]);
    world[k] = Gather(start, block->vertex[k], &unused) + Gather(points.before, block->vertex[k], &w[k]);
    corner[k] = ToLocal(geom.pose, world[k]);
  }
  Lanes away(0.0f);
  if (search) {
    const Lanes zero(0.0f);
    const Mask rope = Less(zero, Lanes::Load(block->rope));
    corner[2] = {Select(rope, corner[1].x, corner[2].x), Select(rope, corner[1].y, corner[2].y),
                 Select(rope, corner[1].z, corner[2].z)};
    Approach(geom, corner, weight);
    weight[1] = weight[1] + Select(rope, weight[2], zero);
    weight[2] = Select(rope, zero, weight[2]);
    for (int k = 0; k < 3; ++k) {
      weight[k].Store(block->weight[k]);
      away = Select(Less(Lanes(kCorner), weight[k]), Lanes(kNowhere), away);
    }
  }
  Lanes3 point = AddScaled(AddScaled(weight[0] * corner[0], weight[1], corner[1]), weight[2], corner[2]), local;
  const Lanes distance = SidedDistance(geom, point, block->side, &local);
  (distance - Lanes::Load(block->radius) + away).Store(block->gap);
  Store3(Rotate<Lanes>(geom.pose, local), block->normal);
  Lanes mass(0.0f);
  for (int k = 0; k < 3; ++k) mass = MultiplyAdd(weight[k] * weight[k], w[k], mass);
  if (body) {
    const Lanes3 there = AddScaled(AddScaled(weight[0] * world[0], weight[1], world[1]), weight[2], world[2]);
    const Lanes3 center = {Lanes(body->center[0]), Lanes(body->center[1]), Lanes(body->center[2])};
    const Lanes3 arm = there - center;
    Store3(arm, block->arm);
    // Upper bound of the point's compliance in any direction. All eight rows may push the body.
    const double (*c)[6] = body->compliance;
    const float linear = static_cast<float>(c[0][0] + c[1][1] + c[2][2]);
    const float angular = static_cast<float>(c[3][3] + c[4][4] + c[5][5]);
    mass =
        mass + Lanes(static_cast<float>(kBlock)) * MultiplyAdd(Lanes(2 * angular), Inner(arm, arm), Lanes(2 * linear));
  }
  mass.Store(block->mass);
  if (substeps == 0) return;
  const bool may_close = MayClose(points, *block, body, substeps);
  OneLane([&] { block->active = may_close; });
}

// A block of rows in a sweep. Its calls: `Acts`, then `Act` if that is true for a row, and `End`.
class SolidSweep {
 public:
  SolidSweep(const Points& points, const ContactRow& row, SolidBlock* block, Rigid* body, SweepPass pass)
      : points_(points), row_(row), block_(block), body_(body), pass_(pass) {
    gap_ = Lanes::Load(block->gap), mass_ = Lanes::Load(block->mass);
    normal_ = Load3(block->normal), arm_ = Load3(block->arm);
    for (int k = 0; k < 3; ++k) weight_[k] = Lanes::Load(block->weight[k]);
    old_ = pass.first ? Lanes(0.0f) : Lanes::Load(block->impulse);
    held_ = {Lanes(0.0f), Lanes(0.0f), Lanes(0.0f)};
  }

  // Computes the impulses at the current motion of vertices and body; returns which rows have or had one.
  Mask Acts() {
    const Lanes gamma(row_.gamma), zero(0.0f);
    moved_ = {zero, zero, zero};
    for (int k = 0; k < 3; ++k) {
      Lanes unused;
      const int* vertex = block_->vertex[k];
      moved_ =
          AddScaled(moved_, weight_[k], Gather(points_.now, vertex, &unused) - Gather(points_.before, vertex, &unused));
    }
    if (body_) {
      float m[6];
      for (int i = 0; i < 6; ++i) m[i] = static_cast<float>(body_->move[i]);
      const Lanes3 turned = {Lanes(m[3]), Lanes(m[4]), Lanes(m[5])};
      const Lanes3 along = {NegativeMultiplyAdd(turned.z, arm_.y, turned.y * arm_.z),
                            NegativeMultiplyAdd(turned.x, arm_.z, turned.z * arm_.x),
                            NegativeMultiplyAdd(turned.y, arm_.x, turned.x * arm_.y)};
      moved_ = moved_ - along - Lanes3{Lanes(m[0]), Lanes(m[1]), Lanes(m[2])};
    }
    way_ = Inner(normal_, moved_);
    const Lanes violation = MultiplyAdd(gamma, old_, ContactViolation(gap_, way_, Lanes(row_.b), Lanes(row_.recovery)));
    impulse_ = Min(Max(old_ - violation / (mass_ + gamma), zero), Lanes(row_.most));
    return Less(zero, Max(old_, impulse_));
  }

  // Pushes vertices and body.
  void Act() {
    const SolidPush push(points_, *block_, body_);
    const Lanes3 old_held = pass_.first ? held_ : Load3(block_->held);
    const Lanes friction = Lanes::Load(block_->friction);
    held_ = AddScaled(old_held, Lanes(-1.0f) / Max(mass_, Lanes(1e-12f)), AddScaled(moved_, -way_, normal_));
    held_ = Grip(Inner(held_, held_), friction * impulse_) * held_;
    push.Apply(AddScaled(held_ - old_held, impulse_ - old_, normal_));
  }

  // Stores the impulses.
  void End() {
    impulse_.Store(block_->impulse);
    Store3(held_, block_->held);
    if (!pass_.last) return;
    Store3(AddScaled(Load3(block_->total) + held_, impulse_, normal_), block_->total);
    (Lanes::Load(block_->pressed) + impulse_).Store(block_->pressed);
  }

 private:
  const Points& points_;
  const ContactRow& row_;
  SolidBlock* block_;
  Rigid* body_;
  SweepPass pass_;
  Lanes weight_[3], gap_, mass_, old_, way_, impulse_;
  Lanes3 normal_, arm_, moved_, held_;
};

// The same for a warm start: it applies a share of the impulses of the last substep.
class SolidWarmStart {
 public:
  SolidWarmStart(const Points& points, SolidBlock* block, Rigid* body, float share)
      : points_(points), block_(block), body_(body) {
    impulse_ = Lanes(share) * Lanes::Load(block->impulse);
    held_ = Lanes(share) * Load3(block->held);
  }
  Mask Acts() const { return Less(Lanes(0.0f), impulse_); }
  void Act() const { SolidPush(points_, *block_, body_).Apply(AddScaled(held_, impulse_, Load3(block_->normal))); }
  void End() {
    impulse_.Store(block_->impulse);
    Store3(held_, block_->held);
  }

 private:
  const Points& points_;
  SolidBlock* block_;
  Rigid* body_;
  Lanes impulse_;
  Lanes3 held_;
};

// Makes a visit of a block apart from others, as `InSequence` of batch/group.h does for many.
template <class Visit>
inline void MakeVisit(Visit visit) {
  if (Bits(visit.Acts())) visit.Act();
  visit.End();
}

inline void SweepSolid(const Points& points, const ContactRow& row, SolidBlock* block, Rigid* body, SweepPass pass) {
  if (block->active) MakeVisit(SolidSweep(points, row, block, body, pass));
}

inline void WarmSolid(const Points& points, SolidBlock* block, Rigid* body, float share) {
  if (block->active) MakeVisit(SolidWarmStart(points, block, body, share));
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SOLID_SWEEPS_H_
