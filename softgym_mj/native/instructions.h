// Selection of the build of the inner loops.

#ifndef SOFTGYM_MJ_NATIVE_INSTRUCTIONS_H_
#define SOFTGYM_MJ_NATIVE_INSTRUCTIONS_H_

namespace softgym_mj {

// Whether to run code compiled for AVX2 and FMA: if the processor has both and SOFTGYM_MJ_SIMD=scalar is not set, which
// selects the portable build. Results are bit-identical.
bool UseAvx2();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_INSTRUCTIONS_H_
