// The kernels one particle at a time: for any processor, and the reference for the vector ones.

#include <math.h>

namespace softgym_mj {
namespace {

struct One {
  static constexpr int kWidth = 1;
  float v;

  explicit One(float a) : v(a) {}
  One() = default;
  static One Load(const float* p) { return One(*p); }
  static One Pick(const float* p, const int* index) { return One(p[*index]); }
  void Store(float* p) const { *p = v; }
  // Writes first + lane for every set bit; returns their number.
  static int Compress(int first, unsigned bits, int* out) {
    *out = first;
    return bits & 1;
  }
};

inline One operator+(One a, One b) { return One(a.v + b.v); }
inline One operator-(One a, One b) { return One(a.v - b.v); }
inline One operator*(One a, One b) { return One(a.v * b.v); }
inline One MultiplyAdd(One a, One b, One c) { return One(a.v * b.v + c.v); }
inline One Max(One a, One b) { return One(a.v > b.v ? a.v : b.v); }
inline One Min(One a, One b) { return One(a.v < b.v ? a.v : b.v); }
inline One Abs(One a) { return One(fabsf(a.v)); }
inline One CopySign(One a, One sign) { return One(copysignf(a.v, sign.v)); }
inline One InverseSqrt(One a) { return One(1.0f / sqrtf(a.v)); }
inline bool Less(One a, One b) { return a.v < b.v; }
inline bool Equal(One a, One b) { return a.v == b.v; }
inline One Select(bool mask, One a, One b) { return mask ? a : b; }
inline unsigned Bits(bool mask) { return mask; }
inline float Sum(One a) { return a.v; }

template <class V>
struct Vector3;
template <class V>
inline Vector3<V> Gather(const float* p, const int* index) {
  p += 4 * *index;
  return {V(p[0]), V(p[1]), V(p[2])};
}

}  // namespace
}  // namespace softgym_mj

#include "kernels_impl.h"

namespace softgym_mj {
const Kernels kScalarKernels = MakeKernels<One>();
}  // namespace softgym_mj
