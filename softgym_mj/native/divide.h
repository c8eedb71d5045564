// Roots and quotients of vectors with the bits of `Sqrt` and `/`, which take a GPU less time in some ranges.

#ifndef SOFTGYM_MJ_NATIVE_DIVIDE_H_
#define SOFTGYM_MJ_NATIVE_DIVIDE_H_

#include "native/simd.h"

namespace softgym_mj {
namespace {

// `Sqrt(a)`, and `a / b` also for a = 0, of numbers between 2^-60 and 2^60. They have the bits of these: on a GPU they
// are what the compiler makes of them for such numbers, without its branch for others, for which loops are not unrolled
// and which a dividend of 0 takes.
#ifdef __CUDACC_RTC__
inline Lanes SqrtOfModerate(Lanes a) {
  float inverse;
  asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(inverse) : "f"(a.v));
  const float root = __fmul_rn(a.v, inverse);
  return Lanes(__fmaf_rn(__fmaf_rn(-root, root, a.v), __fmul_rn(inverse, 0.5f), root));
}
inline Lanes DivideModerate(Lanes a, Lanes b) {
  float inverse;
  asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(inverse) : "f"(b.v));
  inverse = __fmaf_rn(inverse, __fmaf_rn(inverse, -b.v, 1.0f), inverse);
  const float quotient = __fmul_rn(a.v, inverse);
  return Lanes(__fmaf_rn(inverse, __fmaf_rn(quotient, -b.v, a.v), quotient));
}
#else
inline Lanes SqrtOfModerate(Lanes a) { return Sqrt(a); }
inline Lanes DivideModerate(Lanes a, Lanes b) { return a / b; }
#endif

// a / b for a >= 0 and b > 0 where a is often 0, for which a division takes a GPU several times as long.
template <class T>
inline T DivideOften0(T a, T b) {
#ifdef __CUDACC__
  const auto positive = Less(T(0.0f), a);
  return Select(positive, Select(positive, a, T(1.0f)) / b, a);
#else
  return a / b;
#endif
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_DIVIDE_H_
