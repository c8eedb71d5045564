// The sweeps, for any type V of four floats.

#ifndef SOFTGYM_MJ_FLUID_CONTACT_KERNELS_IMPL_H_
#define SOFTGYM_MJ_FLUID_CONTACT_KERNELS_IMPL_H_

#include <math.h>

#include "contact_kernels.h"

namespace softgym_mj {
namespace {

constexpr float kNoError = 1e-7f;  // [m] Springs that nothing to speak of has reached yet.

template <class V>
inline void Push(float* move, V a, float scaled) {
  (V::Load(move) + a * V(scaled)).Store(move);
}

template <class V>
float SweepRows(Row* rows, int count, float* move) {
  float change = 0;
  for (int k = 0; k < count; ++k) {
    Row& row = rows[k];
    float *m0 = move + 4 * row.vertex[0], *m1 = move + 4 * row.vertex[1];
    float *m2 = move + 4 * row.vertex[2], *m3 = move + 4 * row.vertex[3];
    const V u0 = V::Load(m0), u1 = V::Load(m1), u2 = V::Load(m2), u3 = V::Load(m3);
    const V r = (u0 * V(row.weight[0]) + u1 * V(row.weight[1])) +
                (u2 * V(row.weight[2]) + u3 * V(row.weight[3]));
    const V normal = V::Load(row.normal).Vector(), before = V::Load(row.impulse);
    const float mass = row.normal[3], along = Dot(normal, r), old = row.impulse[3];
    before.Store(row.before);
    float total = old + mass * (row.least - along - row.compliance * old);
    if (total <= row.lowest) {
      if (old == row.lowest) continue;
      total = row.lowest;
    }
    V impulse = normal * V(total - old);
    change += (total - old) * (total - old);
    if (row.friction > 0) {
      const V held = before.Vector();
      V wanted = held - (r - normal * V(along)).Vector() * V(mass);
      const float square = Dot(wanted, wanted), limit = total > 0 ? row.friction * total : 0;
      if (square > limit * limit) wanted = wanted * V(limit / sqrtf(square));
      const V more = wanted - held;
      change += Dot(more, more);
      impulse = impulse + more;
      wanted.Store(row.impulse);
    }
    row.impulse[3] = total;
    (u0 + impulse * V(row.scaled[0])).Store(m0);
    (u1 + impulse * V(row.scaled[1])).Store(m1);
    (u2 + impulse * V(row.scaled[2])).Store(m2);
    (u3 + impulse * V(row.scaled[3])).Store(m3);
  }
  return change;
}

template <class V>
void ExtendRows(Row* rows, int count, float share, float* move) {
  for (int k = 0; k < count; ++k) {
    Row& row = rows[k];
    const V impulse = V::Load(row.impulse);
    const V sweep = impulse - V::Load(row.before), ahead = V::Load(row.search) * V(share);
    (ahead + sweep).Store(row.search);
    if (Dot4(ahead, ahead) == 0) continue;
    (impulse + ahead).Store(row.impulse);
    float along[4];
    ahead.Store(along);
    const V push = ahead.Vector() + V::Load(row.normal).Vector() * V(along[3]);
    for (int i = 0; i < 4; ++i) Push(move + 4 * row.vertex[i], push, row.scaled[i]);
  }
}

template <class V>
float SweepSprings(Spring* springs, int count, float* move) {
  float change = 0;
  for (int k = 0; k < count; ++k) {
    Spring& spring = springs[k];
    float *m0 = move + 4 * spring.vertex[0], *m1 = move + 4 * spring.vertex[1];
    const V u0 = V::Load(m0), u1 = V::Load(m1), normal = V::Load(spring.normal);
    const float error = spring.target - Dot(normal, u0 - u1);
    spring.before = spring.impulse;
    if (fabsf(error) < kNoError && spring.impulse == 0) continue;
    const float impulse = spring.normal[3] * (error - spring.compliance * spring.impulse);
    spring.impulse += impulse;
    change += impulse * impulse;
    const V direction = normal.Vector();
    (u0 + direction * V(impulse * spring.scaled[0])).Store(m0);
    (u1 - direction * V(impulse * spring.scaled[1])).Store(m1);
  }
  return change;
}

template <class V>
void ExtendSprings(Spring* springs, int count, float share, float* move) {
  for (int k = 0; k < count; ++k) {
    Spring& spring = springs[k];
    const float ahead = share * spring.search;
    spring.search = ahead + spring.impulse - spring.before;
    if (ahead == 0) continue;
    spring.impulse += ahead;
    const V push = V::Load(spring.normal).Vector() * V(ahead);
    Push(move + 4 * spring.vertex[0], push, spring.scaled[0]);
    Push(move + 4 * spring.vertex[1], push, -spring.scaled[1]);
  }
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CONTACT_KERNELS_IMPL_H_
