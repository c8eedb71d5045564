#include "cloth/plugin/kernels.h"

#include "native/instructions.h"

namespace softgym_mj::cloth {

const ClothKernels& ChooseClothKernels() {
#ifdef SOFTGYM_MJ_X86
  if (UseAvx2()) return kAvx2ClothKernels;
#endif
  return kPortableClothKernels;
}

}  // namespace softgym_mj::cloth
