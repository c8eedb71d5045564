// Which build of the inner loops a processor can run.

#ifndef SOFTGYM_MJ_NATIVE_INSTRUCTIONS_H_
#define SOFTGYM_MJ_NATIVE_INSTRUCTIONS_H_

namespace softgym_mj {

// Whether to run what was compiled for AVX2 and FMA: wherever the processor has both, unless SOFTGYM_MJ_SIMD=scalar
// in the environment asks for the portable build. Results have the same bits.
bool UseAvx2();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_INSTRUCTIONS_H_
