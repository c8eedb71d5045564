// Poses and distances to shapes, for T = float or `Lanes`, under the restrictions of simd.h.

#ifndef SOFTGYM_MJ_NATIVE_SHAPES_H_
#define SOFTGYM_MJ_NATIVE_SHAPES_H_

#include "native/simd.h"
#include "native/vec.h"

namespace softgym_mj {

// `Distance` computes all but meshes and heightfields, whose distances need a grid.
enum class Shape { kPlane, kSphere, kCapsule, kEllipsoid, kCylinder, kBox, kMesh, kHeights };

namespace {

constexpr float kTiny = 1e-12f;  // [m^2] Squared distances below it count as zero.

template <class T>
inline T Dot(const Vec3<T>& a, const Vec3<T>& b) {
  return MultiplyAdd(a.x, b.x, MultiplyAdd(a.y, b.y, a.z * b.z));
}

template <class T>
inline T Clamp(T a, float low, float high) {
  return Min(Max(a, T(low)), T(high));
}

template <class T>
inline T Square(T a) {
  return a * a;
}

// Transforms to the frame of a pose (position, row-major rotation matrix).
template <class T>
inline Vec3<T> ToLocal(const float* pose, const Vec3<T>& point) {
  const float* r = pose + 3;
  Vec3<T> d = {point.x - T(pose[0]), point.y - T(pose[1]), point.z - T(pose[2])};
  return {MultiplyAdd(T(r[0]), d.x, MultiplyAdd(T(r[3]), d.y, T(r[6]) * d.z)),
          MultiplyAdd(T(r[1]), d.x, MultiplyAdd(T(r[4]), d.y, T(r[7]) * d.z)),
          MultiplyAdd(T(r[2]), d.x, MultiplyAdd(T(r[5]), d.y, T(r[8]) * d.z))};
}

template <class T>
inline Vec3<T> Rotate(const float* pose, const Vec3<T>& a) {
  const float* r = pose + 3;
  return {MultiplyAdd(T(r[0]), a.x, MultiplyAdd(T(r[1]), a.y, T(r[2]) * a.z)),
          MultiplyAdd(T(r[3]), a.x, MultiplyAdd(T(r[4]), a.y, T(r[5]) * a.z)),
          MultiplyAdd(T(r[6]), a.x, MultiplyAdd(T(r[7]), a.y, T(r[8]) * a.z))};
}

// Signed distance to a box in one, two or three dimensions, from the excess over the half extents.
template <class T>
inline T BoxDistance(const Vec3<T>& p, const Vec3<T>& half, Vec3<T>* normal) {
  T zero(0.0f), one(1.0f);
  Vec3<T> excess = {Abs(p.x) - half.x, Abs(p.y) - half.y, Abs(p.z) - half.z};
  Vec3<T> out = {Max(excess.x, zero), Max(excess.y, zero), Max(excess.z, zero)};
  T squared = Dot(out, out);
  T length = Sqrt(Max(squared, T(kTiny))), inverse = one / length;
  auto outside = Less(T(kTiny), squared);
  T deepest = Max(excess.x, Max(excess.y, excess.z));
  auto is_x = Equal(excess.x, deepest), is_y = Equal(excess.y, deepest);
  T in_x = Select(is_x, one, zero);
  T in_y = Select(is_x, zero, Select(is_y, one, zero));
  T in_z = one - in_x - in_y;
  normal->x = CopySign(Select(outside, out.x * inverse, in_x), p.x);
  normal->y = CopySign(Select(outside, out.y * inverse, in_y), p.y);
  normal->z = CopySign(Select(outside, out.z * inverse, in_z), p.z);
  return Select(outside, length, deepest);
}

// Signed distance to a shape and its outward normal, in the frame of the shape.
template <class T>
inline T Distance(Shape shape, const float* size, const Vec3<T>& p, Vec3<T>* normal) {
  T zero(0.0f);
  switch (shape) {
    case Shape::kPlane:
      *normal = {zero, zero, T(1.0f)};
      return p.z;
    case Shape::kSphere:
    case Shape::kCapsule: {
      Vec3<T> d = p;
      if (shape == Shape::kCapsule) d.z = p.z - Clamp(p.z, -size[1], size[1]);
      T length = Sqrt(Max(Dot(d, d), T(kTiny))), inverse = T(1.0f) / length;
      *normal = {d.x * inverse, d.y * inverse, d.z * inverse};
      return length - T(size[0]);
    }
    case Shape::kEllipsoid: {
      // First-order estimate (k0 (k0 - 1) / k1): exact on the surface.
      Vec3<T> a = {p.x * T(1 / size[0]), p.y * T(1 / size[1]), p.z * T(1 / size[2])};
      Vec3<T> b = {a.x * T(1 / size[0]), a.y * T(1 / size[1]), a.z * T(1 / size[2])};
      T k0 = Sqrt(Max(Dot(a, a), T(1e-6f)));
      T inverse = T(1.0f) / Sqrt(Max(Dot(b, b), T(kTiny)));
      *normal = {b.x * inverse, b.y * inverse, b.z * inverse};
      return k0 * (k0 - T(1.0f)) * inverse;
    }
    case Shape::kCylinder: {
      T radius = Sqrt(Max(MultiplyAdd(p.x, p.x, p.y * p.y), T(kTiny))), inverse = T(1.0f) / radius;
      Vec3<T> flat, q = {radius, zero, p.z};
      T distance = BoxDistance<T>(q, {T(size[0]), T(1e6f), T(size[1])}, &flat);
      *normal = {flat.x * p.x * inverse, flat.x * p.y * inverse, flat.z};
      return distance;
    }
    default:
      return BoxDistance<T>(p, {T(size[0]), T(size[1]), T(size[2])}, normal);
  }
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_SHAPES_H_
