#include "fluid/batch/one.h"

namespace softgym_mj::fluid {

void StepOneAvx2(const Batch& batch, int i, int slot, int turns) {
  Turns() = turns;
  StepWorldOf(batch, i, slot);
}

}  // namespace softgym_mj::fluid
