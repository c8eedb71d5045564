// Sweeps over rows, eight at a time, under the restrictions of native/simd.h; kernels.h has the equation.

#ifndef SOFTGYM_MJ_CLOTH_SWEEPS_H_
#define SOFTGYM_MJ_CLOTH_SWEEPS_H_

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/method.h"
#include "native/simd.h"
#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

constexpr float kTinyLength = 1e-9f;   // [m] Shorter edges have no direction.
constexpr float kTinySquare = 1e-24f;  // [m^2] Squared slips below this count as zero.

using Lanes3 = Vec3<Lanes>;

template <class T>
inline T Inner(const Vec3<T>& a, const Vec3<T>& b) {
  return MultiplyAdd(a.x, b.x, MultiplyAdd(a.y, b.y, a.z * b.z));
}
// a + s b.
template <class T>
inline Vec3<T> AddScaled(const Vec3<T>& a, T s, const Vec3<T>& b) {
  return {MultiplyAdd(s, b.x, a.x), MultiplyAdd(s, b.y, a.y), MultiplyAdd(s, b.z, a.z)};
}

inline Lanes3 Load3(const float (*p)[kBlock]) { return {Lanes::Load(p[0]), Lanes::Load(p[1]), Lanes::Load(p[2])}; }
inline void Store3(const Lanes3& a, float (*p)[kBlock]) {
  a.x.Store(p[0]);
  a.y.Store(p[1]);
  a.z.Store(p[2]);
}
inline Lanes3 Gather(const float* p, const int* index, Lanes* w) {
  Lanes3 out;
  Gather4(p, index, &out.x, &out.y, &out.z, w);
  return out;
}
// Writes vertices of inverse mass w. Immovable vertices may be shared by rows and are not written.
inline void Scatter(float* p, const int* index, const Lanes3& a, Lanes w) {
#ifdef __CUDACC__
  if (w.v == 0) return;
#endif
  Scatter4(p, index, a.x, a.y, a.z, w);
}

// Moves eight numbers of the points, from `i` on, by a substep without forces.
inline void Move(const Points& points, int i) {
  const Lanes now = Lanes::Load(points.now + i), moved = now - Lanes::Load(points.before + i);
  moved.Store(points.moved + i);
  now.Store(points.before + i);
  (now + (moved + Lanes::Load(points.bent_drift + i))).Store(points.now + i);
}

// Applies added mass to eight vertices, from `first` on.
inline void MoveAir(const Points& points, int first) {
  const int index[kBlock] = {first, first + 1, first + 2, first + 3, first + 4, first + 5, first + 6, first + 7};
  Lanes w, unused;
  const Lanes3 now = Gather(points.now, index, &w), before = Gather(points.before, index, &unused);
  const Lanes3 air = Gather(points.air, index, &unused), last = Gather(points.moved, index, &unused);
  const Lanes gained = Inner(air, (now - before) - last);
  Scatter(points.now, index, AddScaled(now, -gained, air), w);
}

// Solves one edge row. `d`: vector from the second to the first vertex. Returns the impulse; sets its direction and the
// length after it.
template <class T>
inline T EdgeImpulse(const Vec3<T>& d, T length, T gamma, T keep, T mass, T* before, Vec3<T>* normal) {
  const T now = Max(Sqrt(Inner(d, d)), T(kTinyLength));
  const T inverse = T(1.0f) / now;
  *normal = {d.x * inverse, d.y * inverse, d.z * inverse};
  const T violation = NegativeMultiplyAdd(keep, *before - length, now - length);
  const T impulse = -(violation / (mass + gamma));
  *before = MultiplyAdd(mass, impulse, now);
  return impulse;
}

// Sets gamma and keep of edges that stiffen. In a strip under tension each vertex is moved again by w J by the later
// one of its two rows: on average, edges end a substep longer by w J than after their row. The elongation is estimated
// with half of the row's motion 2 w J, and stiffness is given back as by a spring of 1 / w in series.
inline void Stiffen(const StiffeningBlock& block, const Lanes3& d, Lanes length, Lanes before, Lanes* gamma,
                    Lanes* keep) {
  const Lanes one(1.0f), damping = Lanes::Load(block.damping), now = Sqrt(Inner(d, d));
  const Lanes longer = MultiplyAdd(Lanes(0.5f), now - before, before) - length;
  const Lanes grown = MultiplyAdd(Lanes::Load(block.growth), Max(longer, Lanes(0.0f)), one);
  const Lanes stiffness = Lanes::Load(block.stiffness) * grown;
  const Lanes back = Min(Lanes::Load(block.mass) * stiffness, Lanes(static_cast<float>(kMostGivenBack)));
  *gamma = one / (stiffness / (one - back) + damping);
  *keep = damping * *gamma;
}

inline void SweepEdges(const Points& points, EdgeBlock* block, const StiffeningBlock* stiffening) {
  Lanes wa, wb, before = Lanes::Load(block->before);
  const Lanes3 a = Gather(points.now, block->vertex[0], &wa), b = Gather(points.now, block->vertex[1], &wb);
  const Lanes3 d = Load3(block->start) + (a - b);
  const Lanes length = Lanes::Load(block->length);
  Lanes gamma = Lanes::Load(block->gamma), keep = Lanes::Load(block->keep);
  if (stiffening) Stiffen(*stiffening, d, length, before, &gamma, &keep);
  Lanes3 normal;
  const Lanes impulse = EdgeImpulse(d, length, gamma, keep, wa + wb, &before, &normal);
  before.Store(block->before);
  impulse.Store(block->impulse);
  Scatter(points.now, block->vertex[0], AddScaled(a, wa * impulse, normal), wa);
  Scatter(points.now, block->vertex[1], AddScaled(b, -(wb * impulse), normal), wb);
}

// Bending over several substeps, part 1: positions without bending, from number `i` on.
inline Lanes Unbent(const Points& points, int i, float substeps) {
  const Lanes now = Lanes::Load(points.now + i), moved = now - Lanes::Load(points.before + i);
  return MultiplyAdd(Lanes(substeps * substeps), Lanes::Load(points.drift + i),
                     MultiplyAdd(Lanes(substeps), moved, now));
}
// Part 2: sweep over the rows.
inline void SweepHinges(const Points& points, HingeBlock* block) {
  Lanes w[4], masses[4], mass(0.0f);
  Lanes3 x[4], sum = Load3(block->start);
  for (int k = 0; k < 4; ++k) {
    x[k] = Gather(points.predicted, block->vertex[k], &masses[k]);
    const Lanes weight = Lanes::Load(block->weight[k]);
    sum = AddScaled(sum, weight, x[k]);
    w[k] = weight * masses[k];
    mass = MultiplyAdd(weight, w[k], mass);
  }
  const Lanes scale = Lanes(-1.0f) / (mass + Lanes::Load(block->gamma));
  const Lanes3 impulse = scale * AddScaled(sum, -Lanes::Load(block->keep), Load3(block->before));
  Store3(AddScaled(sum, mass, impulse), block->before);
  for (int k = 0; k < 4; ++k) {
    Scatter(points.predicted, block->vertex[k], AddScaled(x[k], w[k], impulse), masses[k]);
  }
}
// Part 3: distributes the change of velocity evenly over the substeps.
inline void SpreadBend(const Points& points, int i, float substeps) {
  const Lanes bent = Lanes::Load(points.predicted + i) - Unbent(points, i, substeps);
  MultiplyAdd(Lanes(1.0f / (substeps * substeps)), bent, Lanes::Load(points.drift + i)).Store(points.bent_drift + i);
}

// Violation along the normal: gaps may close; overlaps are damped springs with limited recovery speed. `gap`: at the
// last sweep, `way`: displacement since then.
template <class T>
inline T ContactViolation(T gap, T way, T b, T recovery) {
  return way + Select(Less(gap, T(0.0f)), Max(b * gap, -recovery), gap);
}

// Coulomb's cone: admissible share of the friction impulse.
template <class T>
inline T Grip(T square, T most) {
  return Min(T(1.0f), Max(most, T(0.0f)) / Sqrt(Max(square, T(kTinySquare))));
}

inline void SweepLayers(const Points& points, const ContactRow& row, LayerBlock* block, SweepPass pass) {
  const Lanes gamma(row.gamma), b(row.b), recovery(row.recovery), zero(0.0f);
  const Lanes old = pass.first ? zero : Lanes::Load(block->impulse);
  constexpr int kAhead = 4;  // Blocks that a warp sweeps at a time.
  Prefetch(block + kAhead);
  // Rows without an impulse by now wait for the next substep.
  if (!pass.first && !Bits(Less(zero, old))) return;
  Lanes w[4], masses[4];
  Lanes3 x[4], sum = {zero, zero, zero};
  for (int k = 0; k < 4; ++k) {
    x[k] = Gather(points.now, block->vertex[k], &masses[k]);
    const Lanes weight = Lanes::Load(block->weight[k]);
    sum = AddScaled(sum, weight, x[k]);
    w[k] = weight * masses[k];
  }
  const Lanes3 normal = Load3(block->normal), before = Load3(block->before);
  const Lanes3 moved = sum - before;
  const Lanes way = Inner(normal, moved), mass = Lanes::Load(block->mass);
  const Lanes gap = MultiplyAdd(Lanes(1.0f), Inner(normal, before), Lanes::Load(block->gap));
  const Lanes violation = MultiplyAdd(gamma, old, ContactViolation(gap, way, b, recovery));
  const Lanes impulse = Max(NegativeMultiplyAdd(violation, Lanes::Load(block->inverse), old), zero);
  impulse.Store(block->impulse);
  if (pass.first && !Bits(Less(zero, impulse))) {
    Store3(sum, block->before);
    return;
  }
  // Friction opposes slip up to its share of the normal impulse.
  const Lanes3 slip = AddScaled(moved, -way, normal);
  const Lanes inverse = Lanes(1.0f) / Max(mass, Lanes(1e-12f));
  const Lanes3 old_held = pass.first ? Lanes3{zero, zero, zero} : Load3(block->held);
  Lanes3 held = AddScaled(old_held, -inverse, slip);
  const Lanes grip = Grip(Inner(held, held), Lanes::Load(block->friction) * impulse);
  held = grip * held;
  const Lanes3 change = AddScaled(held - old_held, impulse - old, normal);
  for (int k = 0; k < 4; ++k) {
    Scatter(points.now, block->vertex[k], AddScaled(x[k], w[k], change), masses[k]);
  }
  Store3(held, block->held);
  if (pass.last) Store3(AddScaled(sum, mass, change), block->before);
}

// Warm start: applies a share of the impulses of the last substep.
inline void WarmLayers(const Points& points, LayerBlock* block, float share) {
  const Lanes impulse = Lanes(share) * Lanes::Load(block->impulse);
  const Lanes3 held = Lanes(share) * Load3(block->held);
  impulse.Store(block->impulse);
  if (!Bits(Less(Lanes(0.0f), impulse))) return;
  Store3(held, block->held);
  const Lanes3 change = AddScaled(held, impulse, Load3(block->normal));
  for (int k = 0; k < 4; ++k) {
    Lanes mass;
    const Lanes3 x = Gather(points.now, block->vertex[k], &mass);
    Scatter(points.now, block->vertex[k], AddScaled(x, Lanes::Load(block->weight[k]) * mass, change), mass);
  }
}

// Sweeps the plane rows of eight vertices from `first` on.
inline void SweepPlane(const Points& points, const ContactRow& row, const Plane& plane, int first, SweepPass pass) {
  const Lanes gamma(row.gamma), b(row.b), recovery(row.recovery), zero(0.0f);
  const Lanes3 normal = {Lanes(plane.normal[0]), Lanes(plane.normal[1]), Lanes(plane.normal[2])};
  const int index[kBlock] = {first, first + 1, first + 2, first + 3, first + 4, first + 5, first + 6, first + 7};
  Lanes w, unused;
  const Lanes3 now = Gather(points.now, index, &w), before = Gather(points.before, index, &unused);
  const Lanes3 moved = now - before;
  const Lanes way = Inner(normal, moved);
  const Lanes gap = Lanes::Load(plane.gap + first) + Inner(normal, before);
  Lanes old = zero;
  Lanes3 old_held = {zero, zero, zero};
  if (!pass.first) old_held = Gather(plane.impulse, index, &old);
  const Lanes violation = MultiplyAdd(gamma, old, ContactViolation(gap, way, b, recovery));
  const Lanes impulse = Max(old - violation / (w + gamma), zero);
  const Lanes3 slip = AddScaled(moved, -way, normal);
  const Lanes inverse = Lanes(1.0f) / Max(w, Lanes(1e-12f));
  Lanes3 held = AddScaled(old_held, -inverse, slip);
  held = Grip(Inner(held, held), Lanes::Load(plane.friction + first) * impulse) * held;
  Scatter(points.now, index, AddScaled(now, w, AddScaled(held - old_held, impulse - old, normal)), w);
  if (plane.impulse) Scatter4(plane.impulse, index, held.x, held.y, held.z, impulse);
}

inline void WarmPlane(const Points& points, const Plane& plane, int first, float share) {
  const Lanes3 normal = {Lanes(plane.normal[0]), Lanes(plane.normal[1]), Lanes(plane.normal[2])};
  const int index[kBlock] = {first, first + 1, first + 2, first + 3, first + 4, first + 5, first + 6, first + 7};
  Lanes w, impulse;
  const Lanes3 now = Gather(points.now, index, &w), held = Lanes(share) * Gather(plane.impulse, index, &impulse);
  impulse = Lanes(share) * impulse;
  Scatter(points.now, index, AddScaled(now, w, AddScaled(held, impulse, normal)), w);
  Scatter4(plane.impulse, index, held.x, held.y, held.z, impulse);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SWEEPS_H_
