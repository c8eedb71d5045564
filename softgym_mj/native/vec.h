// `Vec3`: vector of three doubles, floats or lanes.

#ifndef SOFTGYM_MJ_NATIVE_VEC_H_
#define SOFTGYM_MJ_NATIVE_VEC_H_

#include <cmath>

namespace softgym_mj {

template <class T>
struct Vec3 {
  T x, y, z;
};

using Vector = Vec3<double>;

// Unnamed namespace, as in simd.h: files compiled for several instruction sets share none of this code.
namespace {

template <class T>
inline Vec3<T> operator+(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
inline Vec3<T> operator-(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
inline Vec3<T> operator*(T s, const Vec3<T>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
inline Vec3<T> Cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Converts an array x y z.
inline Vector FromArray(const double* a) { return {a[0], a[1], a[2]}; }
inline double Dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double Norm(const Vector& a) { return std::sqrt(Dot(a, a)); }

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_VEC_H_
