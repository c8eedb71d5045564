// Kernels for x86 processors with AVX2 and FMA.

#include "kernels_impl.h"

namespace softgym_mj {
const Kernels kAvx2Kernels = kLoops;
}  // namespace softgym_mj
