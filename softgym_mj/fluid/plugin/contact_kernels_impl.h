// The sweeps, for any type V of kLanes floats.

#ifndef SOFTGYM_MJ_FLUID_CONTACT_KERNELS_IMPL_H_
#define SOFTGYM_MJ_FLUID_CONTACT_KERNELS_IMPL_H_

#include "contact_kernels.h"

namespace softgym_mj {
namespace {

constexpr float kNoError = 1e-7f;  // [m] Springs that nothing to speak of has reached yet.

template <class V>
struct Vector3 {
  V x, y, z;
};
template <class V>
inline Vector3<V> operator+(const Vector3<V>& a, const Vector3<V>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class V>
inline Vector3<V> operator-(const Vector3<V>& a, const Vector3<V>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class V>
inline Vector3<V> operator*(V s, const Vector3<V>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class V>
inline V Dot(const Vector3<V>& a, const Vector3<V>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class V>
inline Vector3<V> Load3(const float p[3][kLanes]) {
  return {V::Load(p[0]), V::Load(p[1]), V::Load(p[2])};
}
template <class V>
inline void Store3(const Vector3<V>& a, float p[3][kLanes]) {
  a.x.Store(p[0]);
  a.y.Store(p[1]);
  a.z.Store(p[2]);
}

// Moves the vertices of the rows by the impulses.
template <class V, int C>
inline void Push(const Rows<C>& rows, const Vector3<V>& impulse, float* move) {
  for (int k = 0; k < C; ++k) {
    V w;
    Vector3<V> u;
    V::LoadVertices(move, rows.vertex[k], &u.x, &u.y, &u.z, &w);
    u = u + (V::Load(rows.weight[k]) * w) * impulse;
    V::StoreVertices(u.x, u.y, u.z, w, rows.vertex[k], move);
  }
}

template <class V, int C>
float Sweep(Rows<C>* batches, int count, float* move) {
  const V zero(0);
  V change(0);
  for (int b = 0; b < count; ++b) {
    Rows<C>& rows = batches[b];
    Vector3<V> u[C], r;
    V w[C];
    for (int k = 0; k < C; ++k) {
      V::LoadVertices(move, rows.vertex[k], &u[k].x, &u[k].y, &u[k].z, &w[k]);
      const V weight = V::Load(rows.weight[k]);
      r = k == 0 ? weight * u[k] : r + weight * u[k];
    }
    const Vector3<V> normal = Load3<V>(rows.normal);
    const V mass = V::Load(rows.mass), along = Dot(normal, r), old = V::Load(rows.impulse[0]);
    const V lowest = V::Load(rows.lowest), error = V::Load(rows.least) - along;
    old.Store(rows.before[0]);
    if (C == 2 && !Any((V(kNoError) < Abs(error)) | Differ(old, zero))) continue;
    const V total = Max(old + mass * (error - V::Load(rows.compliance) * old), lowest);
    const V push = total - old;
    Vector3<V> impulse = push * normal;
    if (C == 4) {
      const Vector3<V> held = Load3<V>(rows.impulse + 1);
      Store3(held, rows.before + 1);
      const V acts = Differ(total, lowest) | Differ(old, lowest) | Differ(Dot(held, held), zero);
      if (!Any(acts)) continue;
      Vector3<V> wanted = held - mass * (r - along * normal);
      const V square = Dot(wanted, wanted), limit = V::Load(rows.friction) * Max(total, zero);
      wanted = Select(limit * limit < square, limit / Sqrt(square), V(1)) * wanted;
      Store3(wanted, rows.impulse + 1);
      const Vector3<V> more = wanted - held;
      change = change + Dot(more, more);
      impulse = impulse + more;
    }
    change = change + push * push;
    total.Store(rows.impulse[0]);
    for (int k = 0; k < C; ++k) {
      u[k] = u[k] + (V::Load(rows.weight[k]) * w[k]) * impulse;
      V::StoreVertices(u[k].x, u[k].y, u[k].z, w[k], rows.vertex[k], move);
    }
  }
  return Sum(change);
}

template <class V, int C>
void Extend(Rows<C>* batches, int count, float share, float* move) {
  for (int b = 0; b < count; ++b) {
    Rows<C>& rows = batches[b];
    V ahead[Rows<C>::kParts], any(0);
    for (int i = 0; i < Rows<C>::kParts; ++i) {
      const V impulse = V::Load(rows.impulse[i]);
      ahead[i] = V(share) * V::Load(rows.search[i]);
      (ahead[i] + (impulse - V::Load(rows.before[i]))).Store(rows.search[i]);
      (impulse + ahead[i]).Store(rows.impulse[i]);
      any = any + Abs(ahead[i]);
    }
    if (!Any(Differ(any, V(0)))) continue;
    Vector3<V> push = ahead[0] * Load3<V>(rows.normal);
    if (C == 4) push = push + Vector3<V>{ahead[C - 3], ahead[C - 2], ahead[C - 1]};
    Push(rows, push, move);
  }
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CONTACT_KERNELS_IMPL_H_
