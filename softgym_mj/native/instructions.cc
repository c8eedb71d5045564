#include "instructions.h"

#include <cstdlib>
#include <cstring>

namespace softgym_mj {

bool UseAvx2() {
#ifdef SOFTGYM_MJ_X86
  static const bool has_both = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const char* asked = std::getenv("SOFTGYM_MJ_SIMD");
  return has_both && !(asked && std::strcmp(asked, "scalar") == 0);
#else
  return false;
#endif
}

}  // namespace softgym_mj
