// The kernels for any processor.

#include "kernels_impl.h"

namespace softgym_mj {
const Kernels kScalarKernels = MakeKernels();
}  // namespace softgym_mj
