// Vectors of three and distances to shapes, for any vector type V. See kernels.h for what this must
// not use.

#ifndef SOFTGYM_MJ_FLUID_SHAPES_H_
#define SOFTGYM_MJ_FLUID_SHAPES_H_

#include "kernels.h"

namespace softgym_mj {
namespace {

constexpr float kTiny = 1e-12f;  // [m^2] Squared distances below it count as zero.

template <class V>
struct Vector3 {
  V x, y, z;
};

template <class V>
inline V Dot(const Vector3<V>& a, const Vector3<V>& b) {
  return MultiplyAdd(a.x, b.x, MultiplyAdd(a.y, b.y, a.z * b.z));
}

template <class V>
inline V Clamp(V a, float low, float high) {
  return Min(Max(a, V(low)), V(high));
}

template <class V>
inline V Square(V a) {
  return a * a;
}

// Adds to the vectors of four floats at `index`, one after the other: some may be the same.
template <class V>
inline void Add(float* p, const int* index, const Vector3<V>& a) {
  float x[V::kWidth], y[V::kWidth], z[V::kWidth];
  a.x.Store(x);
  a.y.Store(y);
  a.z.Store(z);
  for (int lane = 0; lane < V::kWidth; ++lane) {
    float* q = p + 4 * index[lane];
    q[0] += x[lane];
    q[1] += y[lane];
    q[2] += z[lane];
  }
}

// Into the frame of a pose (position, row-major rotation matrix).
template <class V>
inline Vector3<V> ToLocal(const float* pose, const Vector3<V>& point) {
  const float* r = pose + 3;
  Vector3<V> d = {point.x - V(pose[0]), point.y - V(pose[1]), point.z - V(pose[2])};
  return {MultiplyAdd(V(r[0]), d.x, MultiplyAdd(V(r[3]), d.y, V(r[6]) * d.z)),
          MultiplyAdd(V(r[1]), d.x, MultiplyAdd(V(r[4]), d.y, V(r[7]) * d.z)),
          MultiplyAdd(V(r[2]), d.x, MultiplyAdd(V(r[5]), d.y, V(r[8]) * d.z))};
}

template <class V>
inline Vector3<V> Rotate(const float* pose, const Vector3<V>& a) {
  const float* r = pose + 3;
  return {MultiplyAdd(V(r[0]), a.x, MultiplyAdd(V(r[1]), a.y, V(r[2]) * a.z)),
          MultiplyAdd(V(r[3]), a.x, MultiplyAdd(V(r[4]), a.y, V(r[5]) * a.z)),
          MultiplyAdd(V(r[6]), a.x, MultiplyAdd(V(r[7]), a.y, V(r[8]) * a.z))};
}

// Signed distance to a box in one, two or three dimensions, from the excess over the half extents.
template <class V>
inline V BoxDistance(const Vector3<V>& p, const Vector3<V>& half, Vector3<V>* normal) {
  V zero(0.0f), one(1.0f);
  Vector3<V> excess = {Abs(p.x) - half.x, Abs(p.y) - half.y, Abs(p.z) - half.z};
  Vector3<V> out = {Max(excess.x, zero), Max(excess.y, zero), Max(excess.z, zero)};
  V squared = Dot(out, out);
  V inverse = InverseSqrt(Max(squared, V(kTiny)));
  auto outside = Less(V(kTiny), squared);
  V deepest = Max(excess.x, Max(excess.y, excess.z));
  auto is_x = Equal(excess.x, deepest), is_y = Equal(excess.y, deepest);
  V in_x = Select(is_x, one, zero);
  V in_y = Select(is_x, zero, Select(is_y, one, zero));
  V in_z = one - in_x - in_y;
  normal->x = CopySign(Select(outside, out.x * inverse, in_x), p.x);
  normal->y = CopySign(Select(outside, out.y * inverse, in_y), p.y);
  normal->z = CopySign(Select(outside, out.z * inverse, in_z), p.z);
  return Select(outside, squared * inverse, deepest);
}

// Signed distance to a shape and its outward normal, in the frame of the shape.
template <class V>
inline V Distance(Shape shape, const float* size, const Vector3<V>& p, Vector3<V>* normal) {
  V zero(0.0f);
  switch (shape) {
    case Shape::kPlane:
      *normal = {zero, zero, V(1.0f)};
      return p.z;
    case Shape::kSphere:
    case Shape::kCapsule: {
      Vector3<V> d = p;
      if (shape == Shape::kCapsule) d.z = p.z - Clamp(p.z, -size[1], size[1]);
      V squared = Max(Dot(d, d), V(kTiny)), inverse = InverseSqrt(squared);
      *normal = {d.x * inverse, d.y * inverse, d.z * inverse};
      return squared * inverse - V(size[0]);
    }
    case Shape::kEllipsoid: {
      // First-order estimate (k0 (k0 - 1) / k1): exact on the surface.
      Vector3<V> a = {p.x * V(1 / size[0]), p.y * V(1 / size[1]), p.z * V(1 / size[2])};
      Vector3<V> b = {a.x * V(1 / size[0]), a.y * V(1 / size[1]), a.z * V(1 / size[2])};
      V k0 = Max(Dot(a, a), V(1e-6f)), k1 = Max(Dot(b, b), V(kTiny));
      k0 = k0 * InverseSqrt(k0);
      V inverse = InverseSqrt(k1);
      *normal = {b.x * inverse, b.y * inverse, b.z * inverse};
      return k0 * (k0 - V(1.0f)) * inverse;
    }
    case Shape::kCylinder: {
      V squared = Max(MultiplyAdd(p.x, p.x, p.y * p.y), V(kTiny)), inverse = InverseSqrt(squared);
      Vector3<V> flat, q = {squared * inverse, zero, p.z};
      V distance = BoxDistance<V>(q, {V(size[0]), V(1e6f), V(size[1])}, &flat);
      *normal = {flat.x * p.x * inverse, flat.x * p.y * inverse, flat.z};
      return distance;
    }
    default:
      return BoxDistance<V>(p, {V(size[0]), V(size[1]), V(size[2])}, normal);
  }
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_SHAPES_H_
