#include "cloth/batch/one.h"

namespace softgym_mj::cloth {

void StepOneAvx2(const Batch& batch, int i, int slot, int turns) {
  Turns() = turns;
  StepEnvironmentOf(batch, i, slot);
}

}  // namespace softgym_mj::cloth
