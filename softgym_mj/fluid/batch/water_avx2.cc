#include "fluid/batch/one.h"

namespace softgym_mj::fluid {

void StepOneAvx2(const Batch& batch, int i, int turns) {
  Turns() = turns;
  StepWorldOf(batch, i);
}

}  // namespace softgym_mj::fluid
