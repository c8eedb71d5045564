#include "cloth/plugin/loops.h"

namespace softgym_mj::cloth {

const ClothKernels kAvx2ClothKernels = kLoops;

}  // namespace softgym_mj::cloth
