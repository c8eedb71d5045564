#include "cloth/plugin/loops.h"

namespace softgym_mj::cloth {

const ClothKernels kPortableClothKernels = kLoops;

}  // namespace softgym_mj::cloth
